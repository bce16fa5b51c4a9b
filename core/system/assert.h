// SPDX-License-Identifier: Apache-2.0
// Promises between functions: TG_ASSERT(condition, "what was promised") says where one is broken and aborts. On in
// Debug and where the option TG_ASSERTS is; elsewhere it compiles to nothing. A broken promise is a fault of this
// program: what comes from a file, a command line or a device is an Error (core/system/error.h), in every build.
#pragma once

#if defined(TG_ASSERTS) || !defined(NDEBUG)
#include <cstdio>
#include <cstdlib>

namespace tg {

[[noreturn]] inline void promiseBroken(const char* file, int line, const char* condition, const char* promise) {
  std::fprintf(stderr, "%s:%d: broken promise: %s (%s)\n", file, line, promise, condition);
  std::abort();
}

}  // namespace tg

#define TG_ASSERT(condition, promise) \
  ((condition) ? static_cast<void>(0) : ::tg::promiseBroken(__FILE__, __LINE__, #condition, promise))
#else
#define TG_ASSERT(condition, promise) static_cast<void>(sizeof((condition) ? 1 : 2))
#endif
