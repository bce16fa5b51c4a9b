// SPDX-License-Identifier: Apache-2.0
// tg_make_goldens [DIR]: renders the golden frames anew into DIR (tests/goldens by default). Look at the pictures
// before you commit them.
#include <cstdio>
#include <filesystem>
#include <span>

#include "core/file/file.h"
#include "core/image/image.h"
#include "core/system/error.h"
#include "goldens/goldens.h"

int main(int argc, char** argv) {
  try {
    const std::filesystem::path folder = argc > 1 ? argv[1] : TG_GOLDENS;
    for (const tg::test::Golden& golden : tg::test::renderGoldens()) {
      const std::vector<float> values = tg::test::goldenValues(golden.frame);
      const std::span bytes(reinterpret_cast<const std::uint8_t*>(values.data()), values.size() * sizeof(float));
      tg::writeFileAtomically(folder / (golden.name + ".f32"), bytes);
      tg::writeImage(folder / (golden.name + ".png"),
                     tg::visualize(tg::test::toFloat(golden.frame), tg::Output::final));
      std::printf("%s: %d x %d\n", golden.name.c_str(), golden.frame.width, golden.frame.height);
    }
    return 0;
  } catch (const tg::Error& error) {
    std::fprintf(stderr, "tg_make_goldens: %s\n", error.what());
    return tg::exitCode(error);
  }
}
