// SPDX-License-Identifier: Apache-2.0
// Ten independent chains of FMAs: enough to hide their latency on two pipes, few enough for sixteen registers.
#include "fma_peak.h"

#include <algorithm>
#include <chrono>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fma_peak.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tg::bench::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = HWY_CAPPED(float, 16);
constexpr Floats df;

// Seconds for `rounds` times ten FMAs.
double run(long rounds) {
  const auto factor = hn::Set(df, 0.999f);
  const auto term = hn::Set(df, 0.1f);
  auto a = hn::Iota(df, 0.0f), b = hn::Iota(df, 1.0f), c = hn::Iota(df, 2.0f), d = hn::Iota(df, 3.0f);
  auto e = hn::Iota(df, 4.0f), f = hn::Iota(df, 5.0f), g = hn::Iota(df, 6.0f), h = hn::Iota(df, 7.0f);
  auto i = hn::Iota(df, 8.0f), j = hn::Iota(df, 9.0f);
  const auto start = std::chrono::steady_clock::now();
  for (long round = 0; round < rounds; ++round) {
    a = hn::MulAdd(a, factor, term);
    b = hn::MulAdd(b, factor, term);
    c = hn::MulAdd(c, factor, term);
    d = hn::MulAdd(d, factor, term);
    e = hn::MulAdd(e, factor, term);
    f = hn::MulAdd(f, factor, term);
    g = hn::MulAdd(g, factor, term);
    h = hn::MulAdd(h, factor, term);
    i = hn::MulAdd(i, factor, term);
    j = hn::MulAdd(j, factor, term);
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  const auto sum =
      hn::Add(hn::Add(hn::Add(a, b), hn::Add(c, d)), hn::Add(hn::Add(e, f), hn::Add(hn::Add(g, h), hn::Add(i, j))));
  volatile float sink = hn::GetLane(sum);  // the chains must not be dropped
  static_cast<void>(sink);
  return elapsed.count();
}

int lanes() { return static_cast<int>(hn::Lanes(df)); }

}  // namespace tg::bench::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::bench {
HWY_EXPORT(run);
HWY_EXPORT(lanes);

int vectorLanes() { return HWY_DYNAMIC_DISPATCH(lanes)(); }

double fmaPeak() {
  constexpr long kRounds = 1000000;
  double best = 1e9;
  for (int i = 0; i < 20; ++i) best = std::min(best, HWY_DYNAMIC_DISPATCH(run)(kRounds));
  return 20.0 * vectorLanes() * kRounds / best;
}

}  // namespace tg::bench
#endif
