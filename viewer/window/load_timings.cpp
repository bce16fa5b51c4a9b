// SPDX-License-Identifier: Apache-2.0
#include "viewer/window/load_timings.h"

#include <algorithm>
#include <cstdio>

#include "viewer/picture/benchmark.h"

namespace tg {

void LoadTimings::take(bool whole, const Scene& scene, const OpenModels& documents) {
  if (printed_) return;
  const double now = std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
  const double cpu = processMilliseconds() / 1e3;
  if (first_ == 0) {
    first_ = now;
    first_cpu_ = cpu;
  }
  if (!whole) return;
  printed_ = true;
  const double gigabytes = static_cast<double>(documents.readBytes()) / 1e9;
  const double read = std::max(documents.readSeconds(), 1e-9);
  std::printf("%s: %.1f MB read in %.2f s (%.2f GB/s)\n", scene.path.c_str(), 1e3 * gigabytes, read, gigabytes / read);
  std::printf("first picture after %.2f s (%.2f s of CPU time), all of it after %.2f s (%.2f s, %.2f GB/s from disk)\n",
              first_, first_cpu_, now, cpu, gigabytes / now);
  std::fflush(stdout);
}

}  // namespace tg
