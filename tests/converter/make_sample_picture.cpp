// SPDX-License-Identifier: Apache-2.0
// tg_make_sample_picture [FOLDER]: renders sample.png of FOLDER's sample.glb anew (docs/gltf-extension by default).
// Look at it before you commit it.
#include <cstdio>

#include "core/system/error.h"
#include "sample_picture.h"

int main(int argc, char** argv) {
  try {
    const std::filesystem::path folder = argc > 1 ? argv[1] : tg::test::kSampleFolder;
    tg::writeImage(folder / "sample.png", tg::test::renderSample(folder));
    return 0;
  } catch (const tg::Error& error) {
    std::fprintf(stderr, "tg_make_sample_picture: %s\n", error.what());
    return tg::exitCode(error);
  }
}
