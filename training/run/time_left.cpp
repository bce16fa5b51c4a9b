// SPDX-License-Identifier: Apache-2.0
// A line over the count, fitted while the stage runs, and the count's own growth.
#include "training/run/time_left.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tg {
namespace {

constexpr double kMemory = 0.995;  // of the mean cost, from step to step
constexpr int kBlock = 50;         // steps of a point of the fit
// Before steps have said more, a pixel costs as much as so many Gaussians of constant colour; each parameter of an SH
// adds its share to a Gaussian's cost.
constexpr double kPixel = 0.5, kParameter = 0.01;
constexpr double kGrowingWeight = 3;  // that this counts: as much as blocks whose loads spread so far, squared
constexpr double kLeastGrowing = 0.2;
// Each round of densification adds more or less than the one before; that ratio, first seen in two thirds of the last
// rounds, comes closer to a steady one from round to round.
constexpr std::size_t kRounds = 12;
constexpr double kSteady = 0.95, kFromSteady = 0.7;
constexpr double kSlowest = 0.5, kFastest = 1.8;
constexpr double kSettled = 0.8;    // of a step's cost while Gaussians are replaced, once they are not
constexpr double kViewSteps = 0.6;  // what scoring a view costs, in steps
// docs/lab/training-speed.md: textures' optimiser goes through all texels as it goes through the Gaussians' own
// parameters, and they are looked up and learn at every pixel of a splat.
constexpr double kTexel = 0.016;                  // a channel of a texel, in Gaussians of constant colour
constexpr double kLookedUp = 2.5, kAllLook = 16;  // of what pixels cost, from so many texels a Gaussian on
constexpr double kFewerLook = 0.2;                // exponent: with less, not every Gaussian has a texture
constexpr double kLongestStep = 4;                // in mean ones: what takes longer is no step alone

double nextRatio(double ratio) { return kSteady + kFromSteady * (ratio - kSteady); }

int channels(TextureMode mode) { return mode == TextureMode::alpha ? 1 : mode == TextureMode::rgb ? 3 : 4; }

}  // namespace

double TimeLeft::textureFactor(double texels, double gaussians) const {
  const double own = load(gaussians), pixels = kPixel * pixels_;
  const double looked = 1 + kLookedUp * std::pow(std::clamp(texels / kAllLook, 0.0, 1.0), kFewerLook);
  const double with = own + gaussians * kTexel * channels(settings_.texture_mode) * texels + looked * pixels;
  return with / std::max(own + pixels, 1.0);
}

double TimeLeft::load(double gaussians) const {
  const int degree = settings_.sh_degree;
  return gaussians * (1 + kParameter * 3 * ((degree + 1) * (degree + 1) - 1));
}

double TimeLeft::load(double gaussians, int iteration) const {
  if (!grows_sh_ || schedule_.sh_every <= 0) return load(gaussians);
  const int degree = std::min(iteration / schedule_.sh_every, settings_.sh_degree);
  return gaussians * (1 + kParameter * 3 * ((degree + 1) * (degree + 1) - 1));
}

void TimeLeft::beginStage(const RunPlan& plan) {
  const double factor = plan.textured ? textureFactor(plan.texels, static_cast<double>(plan.gaussians)) : 1;
  changeFactor(factor);
  textured_ = plan.textured;
  grows_sh_ = plan.grows_sh;
  swaps_ = plan.swaps;
  steps_ = block_steps_ = 0;
  block_cost_ = block_load_ = n_ = x_ = y_ = xx_ = xy_ = 0;
  before_ = 0;
  growths_.clear();
}

void TimeLeft::resume(int iterations, double seconds, std::size_t gaussians) {
  steps_ = iterations;
  if (iterations == 0 || gaussians == 0) return;
  weight_ = std::min(iterations, 50);
  cost_ = weight_ * seconds / iterations;
  load_ = weight_ * load(static_cast<double>(gaussians), iterations);
}

void TimeLeft::rescale(double texels, std::size_t gaussians) {
  changeFactor(textureFactor(texels, static_cast<double>(gaussians)));
}

// A little of what is known stays until the new steps outweigh it.
void TimeLeft::changeFactor(double factor) {
  cost_ *= factor / factor_;
  const double kept = weight_ > 0 ? std::min(10 / weight_, 1.0) : 0;
  for (double* sum : {&weight_, &cost_, &load_}) *sum *= kept;
  factor_ = factor;
}

void TimeLeft::add(double seconds, std::size_t gaussians) {
  const auto count = static_cast<double>(std::max<std::size_t>(gaussians, 1));
  const double now = load(count, steps_);
  if (weight_ > 5) seconds = std::min(seconds, kLongestStep * cost_ / weight_);
  ++steps_;
  weight_ = kMemory * weight_ + 1;
  cost_ = kMemory * cost_ + seconds;
  load_ = kMemory * load_ + now;
  if (swaps_ && steps_ == schedule_.densify_until) {
    cost_ *= kSettled;
    changeFactor(factor_);
  }
  // The first Gaussians are larger than those that they become, and cost more each.
  if (steps_ > schedule_.densify_from) {
    block_cost_ += seconds;
    block_load_ += now;
    ++block_steps_;
  }
  if (block_steps_ == kBlock) {
    const double x = block_load_ / kBlock, y = block_cost_ / kBlock;
    n_ += 1;
    x_ += x;
    y_ += y;
    xx_ += x * x;
    xy_ += x * y;
    block_cost_ = block_load_ = 0;
    block_steps_ = 0;
  }
  if (!textured_ && schedule_.densifies(steps_) && before_ > 0) {
    growths_.push_back(count - before_);
    if (growths_.size() > kRounds) growths_.erase(growths_.begin());
  }
  before_ = count;
}

std::pair<double, double> TimeLeft::growth() const {
  if (growths_.empty()) return {0, kSteady};
  const auto mean = [&](std::size_t first, std::size_t last) {
    return std::accumulate(growths_.begin() + static_cast<std::ptrdiff_t>(first),
                           growths_.begin() + static_cast<std::ptrdiff_t>(last), 0.0) /
           static_cast<double>(last - first);
  };
  const std::size_t count = growths_.size(), some = std::max<std::size_t>(count / 3, 1);
  const double now = std::max(mean(count - some, count), 0.0);
  if (count < 2 * some || now <= 0) return {now, kSteady};
  const double before = std::max(mean(count - 2 * some, count - some), 1e-6);
  const double seen = std::pow(now / before, 1.0 / static_cast<double>(some));
  // From the middle of the last rounds to the last one.
  const double ratio = nextRatio(std::clamp(seen, kSlowest, kFastest));
  return {now * std::pow(ratio, 0.5 * static_cast<double>(some - 1)), ratio};
}

double TimeLeft::stepCost(double load) const {
  if (weight_ <= 0) return 0;
  const double mean = std::max(load_ / weight_, 1.0), cost = std::max(cost_ / weight_, 1e-12);
  double share = mean / (mean + kPixel * pixels_);
  if (n_ > 1) {
    const double spread = (xx_ - x_ * x_ / n_) / (mean * mean), common = (xy_ - x_ * y_ / n_) / (mean * cost);
    share = std::clamp((common + kGrowingWeight * share) / (spread + kGrowingWeight), kLeastGrowing, 1.0);
  }
  return cost * std::max(1 + share * (load / mean - 1), 0.05);
}

template <typename Use>
double TimeLeft::forEachPiece(const RunPlan& plan, Use use) const {
  double count = static_cast<double>(plan.gaussians);
  auto [more, ratio] = growth();
  const int last = plan.iteration + plan.left;
  int at = plan.iteration;
  const int every = std::max(schedule_.densify_every, 1);
  while (at < last) {
    const int next = std::min((at / every + 1) * every, last);
    use(next - at, count, at);
    at = next;
    if (plan.merge_after > 0 && at >= plan.merge_after) count = std::min(count, static_cast<double>(plan.merged));
    if (!plan.densifies || !schedule_.densifies(at)) continue;
    more *= ratio;
    ratio = nextRatio(ratio);
    count += plan.growth >= 0 ? count * plan.growth : more;
    if (plan.limit > 0) count = std::min(count, static_cast<double>(plan.limit));
    count = std::max(count, 1.0);
  }
  return count;
}

double TimeLeft::seconds(const RunPlan& plan) const {
  if (weight_ <= 0) return 0;
  double sum = 0, plain_cost = 0;
  const double settled = plan.swaps && plan.iteration < schedule_.densify_until ? kSettled : 1;
  double count = forEachPiece(plan, [&](int steps, double gaussians, int at) {
    sum += steps * stepCost(load(gaussians, at)) * (at < schedule_.densify_until ? 1 : settled);
  });
  if (textured_ && plan.cut_left > 0 && plan.texels_cut > 0) {
    sum -= plan.cut_left * stepCost(load(count)) * (1 - textureFactor(plan.texels_cut, count) / factor_);
  }
  if (plan.first_left > 0) {
    count = std::max(count * plan.first_share, 1.0);
    const auto grown = static_cast<double>(grownLimit(static_cast<std::size_t>(count), plan.first_pixels));
    const int before = std::min(schedule_.merge_after, plan.first_left);
    sum += (before * stepCost(load(grown)) + (plan.first_left - before) * stepCost(load(count))) * settled;
  }
  plain_cost = stepCost(load(count)) / factor_ * settled;
  const double factor = textureFactor(plan.texels, count);
  sum += plan.textured_left * plain_cost * factor;
  if (!textured_ && plan.cut_left > 0 && plan.texels_cut > 0) {
    sum -= plan.cut_left * plain_cost * (factor - textureFactor(plan.texels_cut, count));
  }
  sum += plan.untextured_left * plain_cost;
  const double last = plan.texels_cut > 0 ? textureFactor(plan.texels_cut, count) : textured_ ? factor_ : factor;
  sum += plan.quantized_left * plain_cost * (textured_ || plan.textured_left > 0 ? last : 1);
  return sum + plan.scorings * static_cast<double>(plan.test_views) * kViewSteps * plain_cost;
}

}  // namespace tg
