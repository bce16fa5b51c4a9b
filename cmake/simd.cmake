# tg_simd: Highway, with the SIMD targets that kernels are compiled for: SSE4, AVX2 and AVX-512 on x86, NEON on ARM. The
# best that a machine has is picked at run time; core/system/program.cpp refuses one that has not even the first.
add_library(tg_simd INTERFACE)
target_link_libraries(tg_simd INTERFACE hwy::hwy)
# Kernels' structs hold vectors, which the scalable targets forbid. 0xFF: what goes beyond AVX3; not every Highway has names
# for all of these.
set(tg_targets_left_out "(HWY_SVE|HWY_SVE2|HWY_SVE_256|HWY_SVE2_128|HWY_RVV|0xFF)")
target_compile_definitions(tg_simd INTERFACE "HWY_DISABLED_TARGETS=${tg_targets_left_out}")
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  # The worst target to compile. Highway's own choice is code without SIMD, a third of all kernels' compile time.
  target_compile_definitions(tg_simd INTERFACE HWY_BASELINE_TARGETS=HWY_SSE4)
endif()
