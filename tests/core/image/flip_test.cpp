// SPDX-License-Identifier: Apache-2.0
// LDR-FLIP against numbers of the authors' published package (flip-evaluator 1.7 on PyPI, float32) and closed forms.
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/image/flip.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "support/catch.h"

using tg::Image;

namespace {

Image solid(int width, int height, float r, float g, float b) {
  Image image(width, height, 3);
  for (std::size_t i = 0; i < image.data.size(); i += 3) {
    image.data[i] = r;
    image.data[i + 1] = g;
    image.data[i + 2] = b;
  }
  return image;
}

// Waves and noise that any language can make the same, in 8 bit.
Image pattern(int width, int height, std::uint32_t seed) {
  Image image(width, height, 3);
  std::uint32_t state = seed;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        state = state * 1664525u + 1013904223u;
        const double wave = 0.5 + 0.45 * std::sin(0.11 * x * (c + 1) + 0.07 * y + seed) * std::cos(0.05 * y * (c + 1));
        const double noise = ((state >> 16) % 256) / 255.0;
        image.at(x, y, c) = static_cast<float>(std::round((0.8 * wave + 0.2 * noise) * 255) / 255);
      }
    }
  }
  return image;
}

double meanFlip(const Image& a, const Image& b) { return tg::flip(tg::flipMap(a, b)); }

}  // namespace

TEST_CASE("FLIP has the values of the authors' implementation", "[flip]") {
  const Image a = pattern(64, 48, 1), b = pattern(64, 48, 2);
  const Image map = tg::flipMap(a, b);
  // The package computes in float32: its own rounding is seen at 1e-5.
  CHECK(tg::flip(map) == Approx(0.6240057).margin(2e-5));
  CHECK(map.at(0, 0, 0) == Approx(0.33704627).margin(1e-4));
  CHECK(map.at(63, 0, 0) == Approx(0.8452965).margin(1e-4));
  CHECK(map.at(32, 24, 0) == Approx(0.8127175).margin(1e-4));
  CHECK(map.at(63, 47, 0) == Approx(0.7132741).margin(1e-4));
  CHECK(tg::flip(tg::flipMap(a, b, 30.0)) == Approx(0.6546443).margin(2e-5));
  CHECK(meanFlip(solid(32, 32, 0, 0, 0), solid(32, 32, 1, 1, 1)) == Approx(0.9673951).margin(2e-5));
  CHECK(meanFlip(solid(32, 32, 0.5f, 0.5f, 0.5f), solid(32, 32, 0.6f, 0.6f, 0.6f)) == Approx(0.2850645).margin(2e-5));
}

TEST_CASE("FLIP is a number where a degree has hardly a pixel", "[flip]") {
  const Image a = pattern(16, 16, 1), b = pattern(16, 16, 2);
  for (const double pixels_per_degree : {1.0, 1.3, 1.65, 1.75}) {
    CAPTURE(pixels_per_degree);
    const double found = tg::flip(tg::flipMap(a, b, pixels_per_degree));
    CHECK(found > 0.1);
    CHECK(found < 1.0);
    CHECK(tg::flip(tg::flipMap(a, a, pixels_per_degree)) == 0.0);
  }
}

TEST_CASE("FLIP sees a blurred edge where the authors' implementation does", "[flip]") {
  Image step(64, 48, 3), soft(64, 48, 3);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      for (int c = 0; c < 3; ++c) {
        step.at(x, y, c) = x < 32 ? 0.0f : 0.8f;
        soft.at(x, y, c) = std::clamp(static_cast<float>(x - 22) / 20.0f, 0.0f, 1.0f) * 0.8f;
      }
    }
  }
  const Image map = tg::flipMap(step, soft);
  CHECK(tg::flip(map) == Approx(0.1760660).margin(2e-5));
  const float expected[] = {0.0f, 0.00541615f, 0.7153323f, 0.58724636f, 0.77816135f, 0.44825664f, 0.0f};
  const int columns[] = {0, 20, 28, 31, 32, 40, 63};
  for (int i = 0; i < 7; ++i) CHECK(map.at(columns[i], 24, 0) == Approx(expected[i]).margin(1e-4));
}

TEST_CASE("FLIP is 0 for equal pictures, 1 for green against blue, and symmetric", "[flip]") {
  const Image a = pattern(40, 30, 3), b = pattern(40, 30, 4);
  CHECK(meanFlip(a, a) == 0);
  CHECK(meanFlip(solid(8, 8, 0, 1, 0), solid(8, 8, 0, 0, 1)) == Approx(1.0).margin(1e-6));
  CHECK(tg::flipMap(a, b).data == tg::flipMap(b, a).data);
  CHECK(meanFlip(Image(1, 1, 3, 0.2f), Image(1, 1, 3, 0.2f)) == 0);
}

TEST_CASE("the mean is over the pixels that count", "[flip]") {
  Image error(2, 1, 1);
  error.data = {0.5f, 0.0f};
  CHECK(tg::flip(error) == 0.25);
  CHECK(tg::flip(error, std::vector<std::uint8_t>{1, 0}) == 0.5);
}

TEST_CASE("FLIP gives the same bytes at any thread count and refuses what it cannot compare", "[flip]") {
  const Image a = pattern(50, 61, 6), b = pattern(50, 61, 7);
  tg::setThreadCount(1);
  const std::vector<float> one = tg::flipMap(a, b).data;
  tg::setThreadCount(3);
  CHECK(tg::flipMap(a, b).data == one);
  tg::setThreadCount(0);
  CHECK_THROWS_AS(tg::flipMap(a, Image(50, 60, 3)), tg::Error);
  CHECK_THROWS_AS(tg::flipMap(Image(4, 4, 1), Image(4, 4, 1)), tg::Error);
  CHECK_THROWS_AS(tg::flipMap(a, b, 0.0), tg::Error);
}
