// SPDX-License-Identifier: Apache-2.0
// Counts for a file of some size: more for more bytes, and texels only where photographs have pixels for them.
#include "training/run/size_plan.h"

#include "support/catch.h"

using tg::planForSize;
using tg::TextureMode;

TEST_CASE("more bytes make room for more Gaussians, of a higher SH degree for fewer", "[size plan]") {
  std::size_t before = 0;
  for (const std::uint64_t bytes : {10'000u, 100'000u, 1'000'000u, 100'000'000u}) {
    const std::size_t plain = planForSize(bytes, 1, 1'000'000, 3, TextureMode::none).gaussians;
    CHECK(plain > before);
    before = plain;
    CHECK(planForSize(bytes, 1, 1'000'000, 0, TextureMode::none).gaussians > plain);
    CHECK(planForSize(bytes, 1, 1'000'000, 3, TextureMode::rgba).gaussians <= plain);
  }
}

TEST_CASE("a plan has texels where the training views have pixels for them, and eight a Gaussian at most",
          "[size plan]") {
  const auto texels = [](std::uint64_t bytes, std::uint64_t pixels) {
    return planForSize(bytes, 1, pixels, 1, TextureMode::rgba).texels;
  };
  CHECK(texels(100'000, 1'000'000'000) == Approx(8));
  CHECK(texels(100'000, 1'000'000) < 8);
  CHECK(texels(10'000'000, 1'000'000) < 0.1);
  CHECK(planForSize(100'000, 1, 1'000'000'000, 1, TextureMode::none).texels == 0);
  // Texels take none of the fewest Gaussians.
  for (const std::uint64_t bytes : {3'631, 3'635, 3'700}) {
    const tg::SizePlan least = planForSize(bytes, 1, 1'000'000, 1, TextureMode::rgba);
    CHECK(least.gaussians >= 100);
    CHECK(least.texels > 0);
  }
}

TEST_CASE("a plan has shared textures where they are a small part of the file", "[size plan]") {
  CHECK(tg::planSharedTextures(8'000, 1, 8) == 0);
  CHECK(tg::planSharedTextures(30'000, 1, 8) == 16);
  CHECK(tg::planSharedTextures(60'000, 1, 8) == 64);
  CHECK(tg::planSharedTextures(60'000, 2, 8) == 16);
  CHECK(tg::planSharedTextures(300'000, 1, 8) == 256);
  CHECK(tg::planSharedTextures(300'000, 1, 16) == 64);
  CHECK(tg::planSharedTextures(300'000, 1, 32) == 16);
  CHECK(tg::planSharedTextures(100'000, 1, 32) == 0);
  const tg::SizePlan shared = tg::planForDictionary(200'000, 1, 1, 256, tg::kPlannedTextureSize);
  const tg::SizePlan plain = planForSize(200'000, 1, 1'000'000, 1, TextureMode::none);
  CHECK(shared.gaussians < plain.gaussians);
  CHECK(shared.gaussians > plain.gaussians * 3 / 4);
}

TEST_CASE("a size without room for anything is refused with the least", "[size plan]") {
  CHECK_THROWS_WITH(planForSize(1000, 1, 1, 3, TextureMode::rgba),
                    "--target-size is out of reach (expected at least 4200 bytes, found 1000)");
}
