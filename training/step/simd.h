// SPDX-License-Identifier: Apache-2.0
// Compiles a loop twice, for AVX2 and for the baseline, and picks at load time. Contraction is off everywhere, so both
// give the same bits.
#pragma once

// Sanitizers instrument the resolver that runs before they are set up, hence the exclusion.
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define TG_SIMD_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define TG_SIMD_CLONES
#endif
