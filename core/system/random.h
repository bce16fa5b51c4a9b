// SPDX-License-Identifier: Apache-2.0
// A seeded generator whose sequence is ours: the standard's distributions differ between libraries.
#pragma once
#include <cmath>
#include <cstdint>
#include <numbers>

#include "core/system/assert.h"
#include "shared/lang.h"

namespace tg {

// SplitMix64 (Steele, Lea, Flood 2014): one 64-bit state, passes BigCrush.
class Random {
 public:
  TG_FN explicit Random(std::uint64_t seed) : state_(seed) {}
  // Random(state()) goes on with the same sequence.
  std::uint64_t state() const { return state_; }
  // As `count` calls of bits(), or of uniform(); a normal() is two.
  TG_FN void skip(std::uint64_t count) { state_ += count * 0x9e3779b97f4a7c15u; }
  TG_FN std::uint64_t bits() {
    state_ += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  // In [0, 1).
  TG_FN double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  // In [0, count), count > 0. The bias is below count / 2^64.
  std::uint64_t below(std::uint64_t count) {
    TG_ASSERT(count > 0, "a number below 0 does not exist");
    return bits() % count;
  }
  // Mean 0, variance 1 (Box-Muller, one of the pair).
  TG_FN double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }
  // Fisher-Yates.
  template <typename Container>
  void shuffle(Container& items) {
    for (std::size_t i = items.size(); i > 1; i--) std::swap(items[i - 1], items[below(i)]);
  }

 private:
  std::uint64_t state_;
};

}  // namespace tg
