// SPDX-License-Identifier: Apache-2.0
// Two pictures of one view: put together, subtracted, measured; photographs brought into the view.
#include "viewer/view/compare.h"

#include <cmath>
#include <numeric>

#include "core/image/metrics.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "viewer/view/camera_controller.h"

using namespace tg;
using test::noise;

namespace {

// Smooth, so that resampling has little to lose.
Image waves(int width, int height) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u = (x + 0.5) / width, v = (y + 0.5) / height;
      image.at(x, y, 0) = static_cast<float>(0.5 + 0.4 * std::sin(7 * u));
      image.at(x, y, 1) = static_cast<float>(0.5 + 0.4 * std::cos(5 * v));
      image.at(x, y, 2) = static_cast<float>(0.5 + 0.4 * std::sin(4 * (u + v)));
    }
  }
  return image;
}

Camera camera(int width, int height) { return lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, width, height); }

}  // namespace

TEST_CASE("mode names come back from text") {
  for (const CompareMode mode : valuesOf<CompareMode>()) CHECK(parse<CompareMode>(name(mode)) == mode);
  CHECK_FALSE(parse<CompareMode>("both"));
}

TEST_CASE("side by side keeps every pixel of both, a wipe takes each side of the divider from its own") {
  const Image a = noise(6, 4, 1), b = noise(7, 4, 2), c = noise(6, 4, 3);
  const Image side = composed(a, b, {}, {.mode = CompareMode::side});
  REQUIRE(side.width == 13);
  CHECK(side.at(5, 2, 1) == a.at(5, 2, 1));
  CHECK(side.at(6, 2, 1) == b.at(0, 2, 1));
  for (float divider : {0.0f, 0.5f, 1.0f}) {
    const Image wipe = composed(a, c, {}, {.mode = CompareMode::wipe, .divider = divider});
    for (int x = 0; x < 6; ++x) {
      const Image& from = static_cast<float>(x) < 6 * divider ? a : c;
      CHECK(wipe.at(x, 3, 2) == from.at(x, 3, 2));
    }
  }
  CHECK(composed(a, c, {}, {.mode = CompareMode::flicker}).data == a.data);
  CHECK(composed(a, c, {}, {.mode = CompareMode::flicker, .shows_other = true}).data == c.data);
}

TEST_CASE("a difference is nothing for equal pictures, grows with the gain, and has a sign if wanted") {
  const Image a(3, 2, 3, 0.5f);
  Image b = a;
  b.at(1, 1, 0) = 0.4f;
  b.at(2, 1, 0) = 0.7f;
  const Image plain = differenceOf(a, b, {}, {});
  CHECK(plain.at(0, 0, 0) == 0.0f);
  CHECK(plain.at(1, 1, 0) == Approx(0.1f));
  CHECK(differenceOf(a, b, {}, {.gain = 4}).at(2, 1, 0) == Approx(0.8f));
  const Image with_sign = differenceOf(a, b, {}, {.gain = 2, .with_sign = true});
  CHECK(with_sign.at(0, 0, 0) == 0.5f);
  CHECK(with_sign.at(1, 1, 0) == Approx(0.4f));
  CHECK(with_sign.at(2, 1, 0) == Approx(0.7f));
  const std::vector<std::uint8_t> mask = {1, 1, 1, 1, 0, 1};
  CHECK(differenceOf(a, b, mask, {}).at(1, 1, 0) == 0.0f);
}

TEST_CASE("a FLIP map is black where pictures are equal, bright where they are not, grey where nothing counts") {
  const Image a = noise(32, 24, 1), b = noise(32, 24, 2);
  const auto sumOf = [](const Image& image) { return std::accumulate(image.data.begin(), image.data.end(), 0.0); };
  const Image equal = composed(a, a, {}, {.mode = CompareMode::flip});
  CHECK(sumOf(equal) < 0.02 * static_cast<double>(equal.data.size()));  // magma begins at #000004
  CHECK(sumOf(composed(a, b, {}, {.mode = CompareMode::flip})) > 5 * sumOf(equal));
  std::vector<std::uint8_t> mask(32 * 24, 1);
  mask[5] = 0;
  const Image masked = flipOf(a, b, mask);
  CHECK(masked.at(5, 0, 0) == 0.5f);
  CHECK(masked.at(20, 20, 0) == flipOf(a, b, {}).at(20, 20, 0));
}

TEST_CASE("FLIP of a photograph in a wider view is that of the photograph") {
  const Image a = noise(32, 24, 1), b = noise(32, 24, 2);
  Image wide_a(48, 30, 3, 0.9f), wide_b(48, 30, 3, 0.0f);  // beside it the model goes on
  std::vector<std::uint8_t> mask(48 * 30, 0);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      for (int c = 0; c < 3; ++c) {
        wide_a.at(x + 9, y + 4, c) = a.at(x, y, c);
        wide_b.at(x + 9, y + 4, c) = b.at(x, y, c);
      }
      mask[static_cast<std::size_t>((y + 4) * 48 + x + 9)] = 1;
    }
  }
  CHECK(metricsOf(wide_a, wide_b, mask)->flip == Approx(metricsOf(a, b, {})->flip).epsilon(1e-6));
  const Image map = flipOf(a, b, {}), wide = flipOf(wide_a, wide_b, mask);
  for (int x : {0, 1, 15, 31}) CHECK(wide.at(x + 9, 12 + 4, 1) == map.at(x, 12, 1));
  CHECK(wide.at(8, 16, 0) == 0.5f);
}

TEST_CASE("metrics are those of core, of the pixels that count, with the other picture as the reference") {
  const Image a = noise(24, 20, 4), b = noise(24, 20, 5);
  const auto all = metricsOf(a, b, {});
  REQUIRE(all);
  CHECK(all->psnr == psnr(b, a));
  CHECK(all->ssim == ssim(b, a));
  CHECK(std::isinf(metricsOf(a, a, {})->psnr));
  std::vector<std::uint8_t> mask(24 * 20, 0);
  CHECK_FALSE(metricsOf(a, b, mask));
  Image c = a;
  c.at(3, 3, 0) = 1 - c.at(3, 3, 0);
  mask.assign(24 * 20, 1);
  mask[3 * 24 + 3] = 0;
  CHECK(std::isinf(metricsOf(a, c, mask)->psnr));
  CHECK(formatMetrics({31.234, 0.95123, 0.06712}) == "PSNR 31.23 dB, SSIM 0.9512, FLIP 0.0671");
}

TEST_CASE("a photograph at its own camera is itself, in another size or shape the same scene") {
  const Image photograph = waves(160, 120);
  const Camera taken = camera(160, 120);
  const ResampledPhotograph same = resampled(photograph, taken, taken, glm::vec3(0.0f));
  CHECK(psnr(same.image, photograph) > 100);
  CHECK(std::count(same.mask.begin(), same.mask.end(), 0) == 0);
  // A file of another size than its camera says.
  CHECK(psnr(resampled(waves(320, 240), taken, taken, glm::vec3(0.0f)).image, photograph) > 50);
  // Half the size, and twice.
  CHECK(psnr(resampled(photograph, taken, fitted(taken, 80, 60), glm::vec3(0.0f)).image, waves(80, 60)) > 50);
  CHECK(psnr(resampled(photograph, taken, fitted(taken, 320, 240), glm::vec3(0.0f)).image, waves(320, 240)) > 40);
  // A camera of --downscale 4, which cut the columns and rows that fill no pixel of it.
  const ResampledPhotograph shrunk = resampled(waves(163, 122), camera(40, 30), camera(40, 30), glm::vec3(0.0f));
  CHECK(psnr(shrunk.image, downsample(waves(163, 122), 4)) > 100);
  CHECK(std::count(shrunk.mask.begin(), shrunk.mask.end(), 0) == 0);
  // A wider view shows the photograph in its middle and nothing beside it.
  const ResampledPhotograph wide = resampled(photograph, taken, fitted(taken, 240, 120), glm::vec3(0.25f));
  for (int x : {0, 39, 40, 199, 200, 239}) {
    const bool inside = x >= 40 && x < 200;
    CHECK(wide.mask[60 * 240 + x] == (inside ? 1 : 0));
    CHECK(wide.image.at(x, 60, 1) == Approx(inside ? photograph.at(x - 40, 60, 1) : 0.25f).margin(1e-5));
  }
}

TEST_CASE("a grey photograph and one with holes are brought to three channels") {
  const Camera taken = camera(8, 6);
  const ResampledPhotograph grey = resampled(Image(8, 6, 1, 0.3f), taken, taken, glm::vec3(1.0f));
  CHECK(grey.image.at(4, 3, 2) == Approx(0.3f));
  Image holes(8, 6, 4, 0.5f);
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) holes.at(x, y, 3) = 0.0f;
  }
  CHECK(resampled(holes, taken, taken, glm::vec3(0, 1, 0)).image.at(4, 3, 1) == Approx(1.0f));
}
