// SPDX-License-Identifier: Apache-2.0
// A line over the count, fitted while the stage runs, and the count's own growth.
#include "training/run/time_left.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tg {
namespace {

constexpr double kMemory = 0.995;       // of the mean cost, from step to step
constexpr int kBlock = 50;              // steps of a point of the fit
constexpr double kGrowingShare = 0.58;  // of a step's cost that grows with the count, before steps have said more
constexpr double kGrowingWeight = 3;    // that this counts: as much as blocks whose counts spread so far, squared
constexpr double kLeastGrowing = 0.2;
constexpr std::size_t kRounds = 2;  // of densification, whose mean growth goes on
constexpr double kSlower = 0.82;    // growth from round to round, before rounds have said more
constexpr double kSlowest = 0.7, kFastest = 0.88;
constexpr double kViewSteps = 0.6;  // what scoring a view costs, in steps
// docs/lab/training-speed.md: textures are looked up and learn at every splat, and their optimiser goes through all
// texels as it goes through the Gaussians' own parameters.
constexpr double kTexturedFactor = 2.2, kTexelFactor = 0.25;

int channels(TextureMode mode) { return mode == TextureMode::alpha ? 1 : mode == TextureMode::rgb ? 3 : 4; }

}  // namespace

double TimeLeft::textureFactor(double texels) const {
  const double parameters = 11 + 3 * (settings_.sh_degree + 1) * (settings_.sh_degree + 1);
  return kTexturedFactor + kTexelFactor * channels(settings_.texture_mode) * texels / parameters;
}

void TimeLeft::beginStage(bool textured, double texels) {
  const double factor = textured ? textureFactor(texels) : 1;
  cost_ *= factor / factor_;
  // A little of what is known stays until the new stage's own steps outweigh it.
  const double kept = weight_ > 0 ? 10 / weight_ : 0;
  for (double* sum : {&weight_, &cost_, &count_}) *sum *= std::min(kept, 1.0);
  textured_ = textured;
  factor_ = factor;
  steps_ = block_steps_ = 0;
  block_cost_ = block_count_ = n_ = x_ = y_ = xx_ = xy_ = 0;
  before_ = 0;
  growths_.clear();
}

void TimeLeft::resume(int iterations, double seconds, std::size_t gaussians) {
  steps_ = iterations;
  if (iterations == 0 || gaussians == 0) return;
  weight_ = std::min(iterations, 50);
  cost_ = weight_ * seconds / iterations;
  count_ = weight_ * static_cast<double>(gaussians);
}

void TimeLeft::rescale(double texels) {
  const double factor = textureFactor(texels);
  cost_ *= factor / factor_;
  factor_ = factor;
}

void TimeLeft::add(double seconds, std::size_t gaussians) {
  const auto count = static_cast<double>(std::max<std::size_t>(gaussians, 1));
  ++steps_;
  weight_ = kMemory * weight_ + 1;
  cost_ = kMemory * cost_ + seconds;
  count_ = kMemory * count_ + count;
  block_cost_ += seconds;
  block_count_ += count;
  if (++block_steps_ == kBlock) {
    const double x = block_count_ / kBlock, y = block_cost_ / kBlock;
    n_ += 1;
    x_ += x;
    y_ += y;
    xx_ += x * x;
    xy_ += x * y;
    block_cost_ = block_count_ = 0;
    block_steps_ = 0;
  }
  if (!textured_ && schedule_.densifies(steps_) && before_ > 0) {
    growths_.push_back(std::log(count / before_));
    if (growths_.size() > 2 * kRounds) growths_.erase(growths_.begin());
  }
  before_ = count;
}

std::pair<double, double> TimeLeft::growth() const {
  if (growths_.empty()) return {0, kSlower};
  const auto mean = [&](std::size_t first, std::size_t last) {
    return std::accumulate(growths_.begin() + static_cast<std::ptrdiff_t>(first),
                           growths_.begin() + static_cast<std::ptrdiff_t>(last), 0.0) /
           static_cast<double>(last - first);
  };
  const std::size_t count = growths_.size(), recent = std::min(count, kRounds);
  const double now = std::max(mean(count - recent, count), 0.0);
  if (count < 2 * kRounds) return {now, kSlower};
  const double before = std::max(mean(0, kRounds), 1e-6);
  const double seen = std::clamp(std::pow(std::max(now, 1e-6) / before, 1.0 / kRounds), kSlowest, kFastest);
  // From the middle of the last rounds to the next one.
  return {now * std::pow(seen, 0.5 * (kRounds + 1)), std::sqrt(seen * kSlower)};
}

double TimeLeft::stepCost(double gaussians) const {
  if (weight_ <= 0) return 0;
  const double mean = std::max(count_ / weight_, 1.0), cost = std::max(cost_ / weight_, 1e-12);
  double share = kGrowingShare;
  if (n_ > 1) {
    const double spread = (xx_ - x_ * x_ / n_) / (mean * mean), common = (xy_ - x_ * y_ / n_) / (mean * cost);
    share = std::clamp((common + kGrowingWeight * kGrowingShare) / (spread + kGrowingWeight), kLeastGrowing, 1.0);
  }
  return cost * std::max(1 + share * (gaussians / mean - 1), 0.05);
}

template <typename Use>
double TimeLeft::forEachPiece(const RunPlan& plan, Use use) const {
  double count = static_cast<double>(plan.gaussians);
  if (!plan.densifies) {
    use(plan.left, count);
    return count;
  }
  auto [more, slower] = growth();
  const int last = plan.iteration + plan.left;
  int at = plan.iteration;
  while (at < last) {
    const int every = std::max(schedule_.densify_every, 1);
    const int next = std::min((at / every + 1) * every, last);
    use(next - at, count);
    at = next;
    if (!schedule_.densifies(at)) continue;
    count *= plan.growth >= 0 ? 1 + plan.growth : std::exp(more);
    more *= slower;
    if (plan.limit > 0) count = std::min(count, static_cast<double>(plan.limit));
    count = std::max(count, 1.0);
  }
  return count;
}

double TimeLeft::seconds(const RunPlan& plan) const {
  if (weight_ <= 0) return 0;
  double sum = 0, plain_cost = 0;
  double count = forEachPiece(plan, [&](int steps, double gaussians) { sum += steps * stepCost(gaussians); });
  if (textured_ && plan.cut_left > 0 && plan.texels_cut > 0) {
    sum -= plan.cut_left * stepCost(count) * (1 - textureFactor(plan.texels_cut) / factor_);
  }
  if (plan.first_left > 0) {
    count = std::max(count * plan.first_share, 1.0);
    sum += plan.first_left * stepCost(count);
  }
  plain_cost = stepCost(count) / factor_;
  const double factor = textureFactor(plan.texels);
  sum += plan.textured_left * plain_cost * factor;
  if (!textured_ && plan.cut_left > 0 && plan.texels_cut > 0) {
    sum -= plan.cut_left * plain_cost * (factor - textureFactor(plan.texels_cut));
  }
  sum += plan.untextured_left * plain_cost;
  const double last = plan.texels_cut > 0 ? textureFactor(plan.texels_cut) : textured_ ? factor_ : factor;
  sum += plan.quantized_left * plain_cost * (textured_ || plan.textured_left > 0 ? last : 1);
  return sum + plan.scorings * static_cast<double>(plan.test_views) * kViewSteps * plain_cost;
}

}  // namespace tg
