// SPDX-License-Identifier: Apache-2.0
// Numbers as indices into few values, and rows of numbers as indices into few rows.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace tg {

// At most `size` values, ascending, that stand for `numbers` (finite, at least one) with the least mean squared error:
// optimal one-dimensional k-means (Wang and Song 2011, equation 1) over a histogram. All different numbers, if they are
// few enough.
std::vector<float> makeCodebook(std::span<const float> numbers, std::size_t size);
// Index of the nearest value.
std::size_t nearestIn(std::span<const float> codebook, float number);

// Rows of `length` numbers, one after the other.
struct Palette {
  std::vector<float> rows;            // at most as many as asked for
  std::vector<std::uint32_t> labels;  // of each row that was given, into `rows`
};
// At most `size` rows that stand for `rows`: k-means in two levels, so that its time grows with the root of `size` (the
// inverted file of Jegou, Douze and Schmid 2011, section IV, whose cells get palettes of their own by their error).
// Same rows in, same palette out, on any number of threads.
Palette makePalette(std::span<const float> rows, std::size_t length, std::size_t size);

}  // namespace tg
