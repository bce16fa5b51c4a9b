// SPDX-License-Identifier: Apache-2.0
// The sample of the extension's specification is still read without a word and still looks as the specification shows.
#include <cmath>

#include "converter/check.h"
#include "converter/registry/file_format.h"
#include "converter/sample_picture.h"
#include "converter/scenes.h"
#include "support/catch.h"

using namespace tg;

TEST_CASE("the specification's sample has its expected picture") {
  const std::filesystem::path folder = test::kSampleFolder;
  const CheckReport report = checkFile(folder / "sample.glb");
  CHECK(report.errors.empty());
  CHECK(report.warnings.empty());
  INFO("regenerate with build/bin/tg_make_sample_picture, then look at the picture");
  const Image stored = readImage(folder / "sample.png");
  const Image now = test::renderSample(folder);
  REQUIRE(stored.width == now.width);
  REQUIRE(stored.height == now.height);
  REQUIRE(stored.channels == 3);
  float worst = 0.0f;
  for (std::size_t i = 0; i < now.data.size(); ++i) {
    const float difference = std::abs(now.data[i] - stored.data[i]);
    if (!(difference <= worst)) worst = difference;
  }
  CHECK(worst <= 0.5001f / 255.0f);  // of the rounding to 8 bits
}

TEST_CASE("the CPU renderer shows the sample alike: splats that face the camera squarely, in the plane model") {
  const Bundle loaded = readModel(std::filesystem::path(test::kSampleFolder) / "sample.glb");
  const Image expected = test::renderSample(test::kSampleFolder);
  const Image shown = picture(loaded.model, resized(loaded.cameras.at(0), expected.width, expected.height));
  CHECK(psnr(shown, expected) > 80.0);
}
