// SPDX-License-Identifier: Apache-2.0
// Codebooks are the best there are, palettes not far from it.
#include "converter/sog/codebook.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;

namespace {

double errorOf(const std::vector<float>& numbers, const std::vector<float>& codebook) {
  double error = 0;
  for (const float x : numbers) {
    const auto d = static_cast<double>(x - codebook[nearestIn(codebook, x)]);
    error += d * d;
  }
  return error;
}

// The least error of sorted numbers in `size` runs, by trying every place where a run can begin.
double leastError(const std::vector<float>& sorted, std::size_t size) {
  const auto run = [&](std::size_t begin, std::size_t end) {
    double mean = 0, error = 0;
    for (std::size_t i = begin; i < end; ++i) mean += static_cast<double>(sorted[i]) / static_cast<double>(end - begin);
    for (std::size_t i = begin; i < end; ++i) error += std::pow(static_cast<double>(sorted[i]) - mean, 2);
    return error;
  };
  std::vector<double> best(sorted.size() + 1, std::numeric_limits<double>::infinity());
  best[0] = 0;
  for (std::size_t k = 0; k < size; ++k) {
    std::vector<double> next(sorted.size() + 1, std::numeric_limits<double>::infinity());
    for (std::size_t end = 1; end <= sorted.size(); ++end) {
      for (std::size_t begin = 0; begin < end; ++begin) next[end] = std::min(next[end], best[begin] + run(begin, end));
    }
    best = next;
  }
  return best.back();
}

}  // namespace

TEST_CASE("a codebook has the least error that so many values can have") {
  test::Random random(5);
  for (const std::size_t size : {std::size_t{1}, std::size_t{2}, std::size_t{7}}) {
    std::vector<float> numbers;
    for (int i = 0; i < 60; ++i) numbers.push_back(static_cast<float>(std::pow(random.uniform(-2.0, 2.0), 3)));
    const std::vector<float> codebook = makeCodebook(numbers, size);
    CHECK(codebook.size() == size);
    CHECK(std::is_sorted(codebook.begin(), codebook.end()));
    std::vector<float> sorted = numbers;
    std::sort(sorted.begin(), sorted.end());
    CHECK(errorOf(numbers, codebook) == Approx(leastError(sorted, size)).epsilon(1e-4));
  }
}

TEST_CASE("few different numbers are a codebook of their own") {
  CHECK(makeCodebook(std::vector<float>{3, 1, 3, 2, 1}, 4) == std::vector<float>{1, 2, 3});
  CHECK(makeCodebook(std::vector<float>(1000, 0.5f), 256) == std::vector<float>{0.5f});
}

TEST_CASE("the nearest value of a codebook") {
  const std::vector<float> codebook = {-1, 0, 4};
  CHECK(nearestIn(codebook, -5) == 0);
  CHECK(nearestIn(codebook, -0.4f) == 1);
  CHECK(nearestIn(codebook, 1.9f) == 1);
  CHECK(nearestIn(codebook, 2.1f) == 2);
  CHECK(nearestIn(codebook, 9) == 2);
}

TEST_CASE("a palette finds the clusters that are there") {
  test::Random random(6);
  constexpr std::size_t kLength = 9, kClusters = 40, kRows = 2000;
  std::vector<float> centers(kClusters * kLength), rows(kRows * kLength);
  for (float& x : centers) x = static_cast<float>(random.uniform(-1.0, 1.0));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::size_t cluster = i / kLength * 7 % kClusters;
    rows[i] = centers[cluster * kLength + i % kLength] + static_cast<float>(random.uniform(-0.01, 0.01));
  }
  const Palette palette = makePalette(rows, kLength, 4 * kClusters);
  REQUIRE(palette.labels.size() == kRows);
  REQUIRE(palette.rows.size() <= 4 * kClusters * kLength);
  double error = 0, energy = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    REQUIRE((palette.labels[i / kLength] + 1) * kLength <= palette.rows.size());
    const float found = palette.rows[palette.labels[i / kLength] * kLength + i % kLength];
    error += std::pow(static_cast<double>(rows[i] - found), 2);
    energy += std::pow(static_cast<double>(rows[i]), 2);
  }
  CHECK(error < 0.005 * energy);
}

TEST_CASE("a palette with room for every row is the rows") {
  const std::vector<float> rows = {1, 2, 3, 4, 5, 6};
  const Palette palette = makePalette(rows, 2, 3);
  CHECK(palette.rows == rows);
  CHECK(palette.labels == std::vector<std::uint32_t>{0, 1, 2});
}

TEST_CASE("rows that are all alike fill a palette") {
  const Palette palette = makePalette(std::vector<float>(300, 2.5f), 3, 64);
  for (const std::uint32_t label : palette.labels) CHECK(palette.rows.at(std::size_t{3} * label) == 2.5f);
}
