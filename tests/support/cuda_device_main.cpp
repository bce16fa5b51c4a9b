// SPDX-License-Identifier: Apache-2.0
// The CUDA cases on a device: exit code 77 and the reason where there is none.
#define CATCH_CONFIG_RUNNER
#include <cstdio>

#include "core/system/error.h"
#include "support/catch.h"
#include "training/cuda/memory.h"

int main(int argc, char** argv) {
  try {
    std::printf("%s\n", tg::cuda::openDevice().c_str());
  } catch (const tg::Error& error) {
    std::printf("%s\n", error.what());
    return 77;
  }
  return Catch::Session().run(argc, argv);
}
