// SPDX-License-Identifier: Apache-2.0
// The loss against a float64 version written from the definition, and its gradient against finite differences of that.
#include "training/step/loss.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/image/metrics.h"
#include "core/system/parallel.h"
#include "support/catch.h"
#include "support/ssim_reference.h"
#include "core/system/random.h"

namespace {

struct Case {
  int width, height;
  std::vector<glm::vec3> picture;
  std::vector<std::uint8_t> target;
  std::vector<std::uint8_t> mask;  // empty: none

  Case(int w, int h, std::uint64_t seed) : width(w), height(h) {
    tg::Random random(seed);
    for (int i = 0; i < w * h; ++i) {
      glm::vec3 color;
      for (int c = 0; c < 3; ++c) {
        target.push_back(static_cast<std::uint8_t>(random.below(256)));
        color[c] = target.back() / 255.0f * 0.7f + 0.4f * static_cast<float>(random.uniform());
      }
      picture.push_back(color);
    }
  }
  std::vector<double> plane(int channel) const {
    std::vector<double> values;
    for (const glm::vec3& color : picture) values.push_back(color[channel]);
    return values;
  }
  std::vector<double> targetPlane(int channel) const {
    std::vector<double> values;
    for (std::size_t i = 0; i < picture.size(); ++i) values.push_back(target[i * 3 + channel] / 255.0);
    return values;
  }
  double channelLoss(const std::vector<double>& values, int channel) const {
    const std::vector<double> wanted = targetPlane(channel);
    double l1 = 0;
    int counted = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!mask.empty() && mask[i] == 0) continue;
      l1 += std::abs(values[i] - wanted[i]);
      ++counted;
    }
    return (0.8 * l1 / counted + 0.2 * (1 - tg::test::referenceSsim(values, wanted, width, height, mask))) / 3;
  }
};

}  // namespace

TEST_CASE("the loss is 0.8 L1 + 0.2 (1 - SSIM)", "[loss]") {
  for (const auto& [width, height] : {std::pair{37, 29}, std::pair{3, 70}, std::pair{70, 3}, std::pair{1, 1}}) {
    const Case test(width, height, 5);
    std::vector<glm::vec3> gradient(test.picture.size());
    const tg::LossValue loss = tg::PhotometricLoss().evaluate(width, height, test.picture, test.target, gradient);
    double expected = 0;
    for (int c = 0; c < 3; ++c) expected += test.channelLoss(test.plane(c), c);
    CHECK(loss.total == Approx(expected).epsilon(1e-5));
  }
}

TEST_CASE("the published constants: x = 0.5, y = 0.6 on 32 x 32", "[loss]") {
  std::vector<glm::vec3> picture(32 * 32, glm::vec3(0.5f));
  std::vector<std::uint8_t> target(32 * 32 * 3, 153);  // 0.6
  std::vector<glm::vec3> gradient(picture.size());
  const tg::LossValue loss = tg::PhotometricLoss().evaluate(32, 32, picture, target, gradient);
  // float32: E[x^2] - E[x]^2 is off by 1e-7, against C2 = 9e-4.
  CHECK(loss.ssim == Approx(0.9762630995).epsilon(1e-4));
  CHECK(loss.l1 == Approx(0.1).epsilon(1e-5));
  CHECK(loss.mean_squared_error == Approx(0.01).epsilon(1e-5));
}

TEST_CASE("the loss gradient equals finite differences of the float64 definition", "[loss]") {
  const Case test(23, 41, 7);  // crosses a band of rows
  std::vector<glm::vec3> gradient(test.picture.size());
  tg::PhotometricLoss().evaluate(test.width, test.height, test.picture, test.target, gradient);
  tg::Random random(9);
  for (int trial = 0; trial < 60; ++trial) {
    const auto i = static_cast<std::size_t>(random.below(test.picture.size()));
    const int c = static_cast<int>(random.below(3));
    const double h = 1e-6;
    std::vector<double> plus = test.plane(c);
    if (std::abs(plus[i] - test.target[i * 3 + c] / 255.0) < 1e-4) continue;  // the kink of the absolute value
    std::vector<double> minus = plus;
    plus[i] += h;
    minus[i] -= h;
    const double expected = (test.channelLoss(plus, c) - test.channelLoss(minus, c)) / (2 * h);
    // float32 windows lose about 1e-7 / C2 of a gradient of size 1 / pixels.
    CHECK(gradient[i][c] == Approx(expected).epsilon(2e-4).margin(2e-8));
  }
}

TEST_CASE("the loss gradient has the same bytes at any thread count, and agrees with the metrics", "[loss]") {
  Case test(50, 100, 3);
  std::vector<glm::vec3> one(test.picture.size());
  std::vector<glm::vec3> two(test.picture.size());
  tg::setThreadCount(1);
  tg::PhotometricLoss loss;
  const tg::LossValue value = loss.evaluate(50, 100, test.picture, test.target, one);
  tg::setThreadCount(2);
  CHECK(loss.evaluate(50, 100, test.picture, test.target, two).total == value.total);
  tg::setThreadCount(0);
  CHECK(one == two);
  tg::Image a(50, 100, 3);
  tg::Image b(50, 100, 3);
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    a.data[i] = test.picture[i / 3][static_cast<int>(i % 3)];
    b.data[i] = test.target[i] / 255.0f;
  }
  CHECK(-10 * std::log10(value.mean_squared_error) == Approx(tg::psnr(a, b)).epsilon(1e-6));
  for (float& v : a.data) v = std::min(v, 1.0f);
  for (glm::vec3& color : test.picture) color = glm::min(color, 1.0f);
  CHECK(loss.evaluate(50, 100, test.picture, test.target, two).ssim == Approx(tg::ssim(a, b)).epsilon(1e-5));
}

TEST_CASE("rows with their surroundings have the sums and the gradient of the whole picture", "[loss]") {
  const int width = 21, height = 90;
  const Case test(width, height, 17);
  std::vector<glm::vec3> whole(test.picture.size());
  tg::PhotometricLoss loss;
  const tg::LossValue value = loss.evaluate(width, height, test.picture, test.target, whole);
  std::vector<tg::LossRowSums> all(3 * height);
  for (const tg::LossRows rows : {tg::LossRows{0, 3}, {3, 15}, {15, 48}, {48, 48}, {48, 90}}) {
    const tg::LossRows given = tg::lossSurroundings(rows, height);
    const auto part = [&](const auto& values, tg::LossRows of, int a_pixel) {
      return std::vector(values.begin() + of.first * width * a_pixel, values.begin() + of.end * width * a_pixel);
    };
    std::vector<glm::vec3> gradient(static_cast<std::size_t>(rows.end - rows.first) * width);
    std::vector<tg::LossRowSums> sums(3 * static_cast<std::size_t>(rows.end - rows.first));
    loss.evaluateRows(width, height, rows, 0, part(test.picture, given, 1), part(test.target, given, 3), gradient, {},
                      sums);
    CHECK(gradient == part(whole, rows, 1));
    for (int c = 0; c < 3; ++c) {
      const auto from = sums.begin() + c * (rows.end - rows.first);
      std::copy(from, from + (rows.end - rows.first), all.begin() + c * height + rows.first);
    }
  }
  CHECK(loss.total(width, height, 0, all).total == value.total);
  const tg::LossRows inside = tg::lossSurroundings({40, 50}, height);
  CHECK(inside.first == 30);
  CHECK(inside.end == 60);
}

TEST_CASE("masked pixels change neither the loss nor its gradient, which equals finite differences", "[loss]") {
  Case test(29, 37, 11);
  tg::Random random(13);
  // A half plane, and single pixels here and there: windows that overlap the mask by little and by much.
  for (int i = 0; i < test.width * test.height; ++i) {
    test.mask.push_back(i % test.width < 9 || random.below(20) == 0 ? 0 : 255);
  }
  std::vector<glm::vec3> gradient(test.picture.size());
  tg::PhotometricLoss loss;
  const tg::LossValue value = loss.evaluate(test.width, test.height, test.picture, test.target, gradient, test.mask);
  double expected = 0;
  for (int c = 0; c < 3; ++c) expected += test.channelLoss(test.plane(c), c);
  CHECK(value.total == Approx(expected).epsilon(1e-5));

  int compared = 0;
  for (int trial = 0; trial < 80; ++trial) {
    const auto i = static_cast<std::size_t>(random.below(test.picture.size()));
    const int c = static_cast<int>(random.below(3));
    if (test.mask[i] == 0) {
      CHECK(gradient[i] == glm::vec3(0.0f));
      continue;
    }
    const double h = 1e-6;
    std::vector<double> plus = test.plane(c);
    if (std::abs(plus[i] - test.target[i * 3 + c] / 255.0) < 1e-4) continue;
    std::vector<double> minus = plus;
    plus[i] += h;
    minus[i] -= h;
    const double difference = (test.channelLoss(plus, c) - test.channelLoss(minus, c)) / (2 * h);
    CHECK(gradient[i][c] == Approx(difference).epsilon(2e-4).margin(2e-8));
    ++compared;
  }
  CHECK(compared > 30);

  Case noise = test;  // whatever the masked pixels hold
  for (std::size_t i = 0; i < test.mask.size(); ++i) {
    if (test.mask[i] != 0) continue;
    noise.picture[i] = glm::vec3(static_cast<float>(random.uniform()));
    noise.target[i * 3 + 1] = static_cast<std::uint8_t>(random.below(256));
  }
  std::vector<glm::vec3> again(test.picture.size());
  const tg::LossValue same = loss.evaluate(test.width, test.height, noise.picture, noise.target, again, test.mask);
  CHECK(same.total == value.total);
  CHECK(same.mean_squared_error == value.mean_squared_error);
  CHECK(again == gradient);

  const std::vector<std::uint8_t> all(test.mask.size(), 1);
  const double unmasked = loss.evaluate(test.width, test.height, test.picture, test.target, gradient).total;
  CHECK(loss.evaluate(test.width, test.height, test.picture, test.target, again, all).total == unmasked);
  CHECK(again == gradient);
}
