// SPDX-License-Identifier: Apache-2.0
// SPZ comes back within its bits, and says what they could not hold.
#include "converter/formats/spz.h"

#include <cmath>

#include "converter/scenes.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;

TEST_CASE("a model comes back from SPZ within the steps of its numbers, at every degree") {
  for (int degree = 0; degree <= 3; ++degree) {
    const GaussianModel in = randomSplats(degree, 50, 20.0, degree + 70);
    SpzReport report;
    const GaussianModel out = parseSpz(formatSpz(in, "a.spz", report), "a.spz").model;
    REQUIRE(out.size() == in.size());
    REQUIRE(out.sh_degree == degree);
    CHECK(report.fractional_bits == 12);
    CHECK(report.clipped_scales + report.clipped_colors + report.clipped_sh == 0);
    const std::size_t k = in.shCount();
    for (std::size_t i = 0; i < in.size(); ++i) {
      CAPTURE(degree, i);
      CHECK(largest(in.mean[i] - out.mean[i]) <= 0.5 / 4096 + 2e-6);
      CHECK(largest(in.log_scale[i] - out.log_scale[i]) <= 1.0 / 32 + 1e-6);
      CHECK(std::abs(opacityOf(in, i) - opacityOf(out, i)) <= 0.5 / 255 + 1e-6);
      const glm::dvec4 a = glm::normalize(glm::dvec4(in.rotation[i])), b = glm::normalize(glm::dvec4(out.rotation[i]));
      CHECK(std::abs(glm::dot(a, b)) > 1.0 - 3e-6);
      CHECK(largest(in.sh[i * k] - out.sh[i * k]) <= 0.5 / 255 / 0.15 + 1e-5);
      for (std::size_t c = 1; c < k; ++c) {
        CHECK(largest(in.sh[i * k + c] - out.sh[i * k + c]) <= (c < 4 ? 4.5 : 8.5) / 128);
      }
    }
  }
}

TEST_CASE("SPZ: the same model gives the same bytes") {
  const GaussianModel model = randomSplats(2, 30, 5.0, 2 + 70);
  SpzReport report;
  CHECK(formatSpz(model, "a.spz", report) == formatSpz(model, "b.spz", report));
}

TEST_CASE("SPZ: positions get the bits that the scene's size asks for") {
  const auto bits = [](double extent) {
    GaussianModel model = randomSplats(0, 2, 1.0, 0 + 70);
    model.mean = {glm::vec3(static_cast<float>(extent), 0, 0), glm::vec3(0.0f)};
    SpzReport report;
    const GaussianModel out = parseSpz(formatSpz(model, "a.spz", report), "a.spz").model;
    CHECK(out.mean[0].x == Approx(extent).epsilon(1e-4));
    return report.fractional_bits;
  };
  CHECK(bits(10.0) == 12);
  CHECK(bits(2000.0) == 12);
  CHECK(bits(3000.0) == 11);
  CHECK(bits(0.1) == 19);  // 2^-19 is 1/52429 of it
  CHECK(bits(8e6) == 0);
  GaussianModel model = randomSplats(0, 1, 1.0, 0 + 70);
  model.mean[0].y = -9e6f;
  SpzReport report;
  CHECK_THROWS_AS(formatSpz(model, "a.spz", report), Error);
}

TEST_CASE("SPZ: what the bytes cannot hold is clipped and counted") {
  GaussianModel model = randomSplats(1, 4, 1.0, 1 + 70);
  model.log_scale[0].y = -12.0f;
  model.log_scale[1].x = 7.0f;
  model.sh[2 * 4].z = 4.0f;
  model.sh[3 * 4 + 2].x = -1.5f;
  SpzReport report;
  const GaussianModel out = parseSpz(formatSpz(model, "a.spz", report), "a.spz").model;
  CHECK(report.clipped_scales == 2);
  CHECK(report.clipped_colors == 1);
  CHECK(report.clipped_sh == 1);
  CHECK(out.log_scale[0].y == -10.0f);
  CHECK(out.log_scale[1].x == 5.9375f);
  CHECK(out.sh[3 * 4 + 2].x == -1.0f);
}
