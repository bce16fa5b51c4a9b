// SPDX-License-Identifier: Apache-2.0
// PSNR and SSIM against closed forms and against numbers computed elsewhere in float64.
#include <cmath>
#include <vector>

#include "core/image/metrics.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "support/catch.h"
#include "support/scenes.h"

using tg::Image;
using tg::test::noise;

namespace {

// The definition, straight: 11 x 11 window, zero padding, no separation. One value per pixel and channel.
Image ssimByDefinition(const Image& a, const Image& b, double* mean = nullptr) {
  double window[11][11], total = 0.0;
  for (int j = 0; j < 11; ++j) {
    for (int i = 0; i < 11; ++i) {
      total += window[j][i] = std::exp(-((i - 5) * (i - 5) + (j - 5) * (j - 5)) / (2.0 * 1.5 * 1.5));
    }
  }
  Image map(a.width, a.height, a.channels);
  double sum = 0.0;
  for (int c = 0; c < a.channels; ++c) {
    for (int y = 0; y < a.height; ++y) {
      for (int x = 0; x < a.width; ++x) {
        double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
        for (int j = 0; j < 11; ++j) {
          for (int i = 0; i < 11; ++i) {
            const int u = x + i - 5, v = y + j - 5;
            if (u < 0 || v < 0 || u >= a.width || v >= a.height) continue;
            const double w = window[j][i] / total, p = a.at(u, v, c), q = b.at(u, v, c);
            ma += w * p, mb += w * q, aa += w * p * p, bb += w * q * q, ab += w * p * q;
          }
        }
        const double value = (2 * ma * mb + 1e-4) * (2 * (ab - ma * mb) + 9e-4) /
                             ((ma * ma + mb * mb + 1e-4) * (aa - ma * ma + bb - mb * mb + 9e-4));
        map.at(x, y, c) = static_cast<float>(value);
        sum += value;
      }
    }
  }
  if (mean) *mean = sum / static_cast<double>(a.data.size());
  return map;
}

}  // namespace

TEST_CASE("SSIM of two constant images has the known mean with zero padding") {
  // float32 holds 0.6 only to 2e-8.
  REQUIRE(tg::ssim(Image(32, 32, 1, 0.5f), Image(32, 32, 1, 0.6f)) == Approx(0.9762630995).margin(5e-9));
  REQUIRE(tg::ssim(Image(32, 32, 3, 0.5f), Image(32, 32, 3, 0.6f)) == Approx(0.9762630995).margin(5e-9));
}

TEST_CASE("the definition these tests compare with has the known values in the centre and in a corner") {
  const Image map = ssimByDefinition(Image(32, 32, 1, 0.5f), Image(32, 32, 1, 0.6f));
  REQUIRE(map.at(16, 16, 0) == Approx(0.9836092444).margin(1e-7));  // float32 map
  for (int corner : {0, 31}) REQUIRE(map.at(corner, corner, 0) == Approx(0.9675967734).margin(1e-7));
}

TEST_CASE("SSIM equals its definition without separation, also for images smaller than the window") {
  for (const auto& [w, h, c] : {std::tuple{1, 1, 1}, {3, 2, 3}, {11, 11, 1}, {40, 37, 3}, {5, 70, 4}}) {
    const Image a = noise(w, h, 1, c), b = noise(w, h, 2, c);
    double expected = 0.0;
    ssimByDefinition(a, b, &expected);
    REQUIRE(tg::ssim(a, b) == Approx(expected).margin(1e-12));
  }
}

TEST_CASE("SSIM of an image with itself is one") {
  REQUIRE(tg::ssim(noise(20, 20, 3), noise(20, 20, 3)) == Approx(1.0));
}

TEST_CASE("metrics do not depend on the thread count, to the last bit") {
  const Image a = noise(61, 130, 4), b = noise(61, 130, 5);
  tg::setThreadCount(1);
  const double ssim = tg::ssim(a, b), psnr = tg::psnr(a, b);
  for (int threads : {2, 3, 7}) {
    tg::setThreadCount(threads);
    REQUIRE(tg::ssim(a, b) == ssim);
    REQUIRE(tg::psnr(a, b) == psnr);
  }
  tg::setThreadCount(0);
}

TEST_CASE("PSNR has its closed form, clamps to [0, 1] and is infinite for equal images") {
  REQUIRE(tg::psnr(Image(8, 8, 3, 0.5f), Image(8, 8, 3, 0.6f)) == Approx(20.0).margin(1e-5));
  REQUIRE(std::isinf(tg::psnr(Image(4, 4, 3, 0.25f), Image(4, 4, 3, 0.25f))));
  REQUIRE(std::isinf(tg::psnr(Image(4, 4, 3, 1.0f), Image(4, 4, 3, 7.0f))));
}

TEST_CASE("8-bit PSNR compares rounded values") {
  REQUIRE(std::isinf(tg::psnr8Bit(Image(4, 4, 1, 0.5f), Image(4, 4, 1, 0.5005f))));
  // 127.5 rounds up to 128; 0.6 is 153: a difference of 25 / 255.
  REQUIRE(tg::psnr8Bit(Image(4, 4, 1, 0.5f), Image(4, 4, 1, 0.6f)) == Approx(-20.0 * std::log10(25.0 / 255.0)));
}

TEST_CASE("a mask leaves pixels out of PSNR, for SSIM they are as beyond the border") {
  // A mask that leaves a rectangle is the same as cutting it out: the rest is zero padding.
  const int left = 7, top = 3, w = 20, h = 15;
  Image a = noise(40, 30, 6), b = noise(40, 30, 7);
  std::vector<std::uint8_t> mask(40 * 30, 0);
  Image cut_a(w, h, 3), cut_b(w, h, 3);
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      mask[static_cast<std::size_t>(y + top) * 40 + x + left] = 1;
      for (int c = 0; c < 3; ++c) {
        cut_a.at(x, y, c) = a.at(x + left, y + top, c);
        cut_b.at(x, y, c) = b.at(x + left, y + top, c);
      }
    }
  }
  REQUIRE(tg::psnr(a, b, mask) == Approx(tg::psnr(cut_a, cut_b)).epsilon(1e-14));
  REQUIRE(tg::psnr8Bit(a, b, mask) == Approx(tg::psnr8Bit(cut_a, cut_b)).epsilon(1e-14));
  REQUIRE(tg::ssim(a, b, mask) == Approx(tg::ssim(cut_a, cut_b)).epsilon(1e-12));
  REQUIRE(tg::ssim(a, b, std::vector<std::uint8_t>(40 * 30, 255)) == tg::ssim(a, b));
  REQUIRE_THROWS_AS(tg::psnr(a, b, std::vector<std::uint8_t>(40 * 30, 0)), tg::Error);
  REQUIRE_THROWS_AS(tg::ssim(a, b, std::vector<std::uint8_t>(40, 255)), tg::Error);
}

TEST_CASE("metrics refuse images of different sizes") {
  REQUIRE_THROWS_AS(tg::psnr(Image(4, 4, 3), Image(4, 5, 3)), tg::Error);
  REQUIRE_THROWS_AS(tg::ssim(Image(4, 4, 3), Image(4, 4, 1)), tg::Error);
  REQUIRE_THROWS_AS(tg::psnr8Bit(Image(), Image()), tg::Error);
}
