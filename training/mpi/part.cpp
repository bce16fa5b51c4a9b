// SPDX-License-Identifier: Apache-2.0
// The functions of training/step over all ranks: what looks at one Gaussian is done where it is; what looks at all is
// decided by the first rank, from the few numbers that decide it.
#include "training/mpi/part.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "training/mpi/messages.h"
#include "training/step/update.h"

namespace tg {
namespace {

constexpr std::size_t kTexelsInFlight = std::size_t{16} << 20;  // 256 MiB

}  // namespace

Part::Part(Channel& channel, const Dataset& dataset)
    : channel_(channel), dataset_(dataset), pass_(channel, kTexelsInFlight) {}

void Part::scatter(RunState* whole) {
  RunState none;
  tg::scatter(channel_, whole ? *whole : none, shards_, shard_);
}

void Part::gather(RunState* whole) {
  RunState none;
  tg::gather(channel_, shards_, shard_, whole ? *whole : none);
}

LossValue Part::step(const StepInput& input, float ssim_weight) {
  if (!loss_) loss_.emplace(ssim_weight);
  const int owner = photographOwner(input.view, channel_.size());
  std::shared_ptr<const ViewPixels> photograph;
  if (owner == channel_.rank()) {
    photograph = dataset_.composited(input.view, input.background);
    const glm::ivec2 found(photograph->width, photograph->height);
    if (found != input.camera.size) {
      const auto text = [](glm::ivec2 size) { return std::to_string(size.x) + " x " + std::to_string(size.y); };
      throw Error(ErrorKind::badData, dataset_.files[input.view],
                  "is of another size than where the training was started" +
                      expectedFound(text(input.camera.size), text(found)));
    }
  }
  if (input.following && photographOwner(*input.following, channel_.size()) == channel_.rank()) {
    dataset_.prefetch(*input.following);
  }
  TrainingState& training = shard_.training;
  LossValue loss;
  {
    const DrawnModel drawn(training.model, effective_, shard_.min_sigma);
    pass_.forward(training.model, input.camera, input.background);
    loss = pass_.compare(*loss_, owner, photograph.get());
    if (!std::isfinite(loss.total)) return loss;
    pass_.backward(input.gradient, gradient_);
  }
  updateParameters(training, shard_.min_sigma, shard_.statistics, input,
                   {shards_.first(channel_.rank()), shards_.total()}, gradient_);
  return loss;
}

void Part::draw(const Camera& camera, const glm::vec3& background, std::vector<glm::vec3>& picture) {
  const DrawnModel drawn(shard_.training.model, effective_, shard_.min_sigma);
  pass_.forward(shard_.training.model, camera, background);
  pass_.collect(picture);
}

std::optional<std::size_t> Part::own(std::size_t gaussian) const {
  const std::size_t first = shards_.first(channel_.rank());
  if (gaussian < first || gaussian >= first + shards_.count(channel_.rank())) return std::nullopt;
  return gaussian - first;
}

void Part::move(std::span<const std::uint32_t> source, std::size_t kept) {
  selectGaussians(channel_, source, kept, shards_, shard_);
}

DensifyResult Part::densify(const DensifySettings& settings, Random* random) {
  const GaussianModel& part = shard_.training.model;
  const DensityStatistics& statistics = shard_.statistics;
  GaussianModel whole;
  DensityStatistics all;
  const auto gatherAll = [&]<typename T>(const std::vector<T>& from, std::vector<T>& to) {
    gatherValues(channel_, shards_, std::span(from), to);
  };
  gatherAll(part.mean, whole.mean);
  gatherAll(part.rotation, whole.rotation);
  gatherAll(part.log_scale, whole.log_scale);
  gatherAll(part.opacity_logit, whole.opacity_logit);
  gatherAll(statistics.score_sum, all.score_sum);
  gatherAll(statistics.magnitude_sum, all.magnitude_sum);
  gatherAll(statistics.view_count, all.view_count);
  gatherAll(statistics.max_radius, all.max_radius);
  MessageWriter said;
  if (random) {
    const DensifyPlan plan = planDensification(whole, all, settings, *random);
    said.put(plan.result);
    said.put(plan.kept);
    said.put(plan.source.size());
    said.put(plan.source);
    said.put(plan.children.size());
    said.put(plan.children);
    said.put(plan.fresh.size());
    said.put(plan.fresh);
  }
  whole = {};
  all = {};
  const Message message = fromFirst(channel_, said.take());
  MessageReader reader(message);
  DensifyPlan plan;
  plan.result = reader.get<DensifyResult>();
  plan.kept = reader.get<std::size_t>();
  plan.source = reader.get<std::uint32_t>(reader.get<std::size_t>());
  plan.children = reader.get<DensifyPlan::Child>(reader.get<std::size_t>());
  plan.fresh = reader.get<std::size_t>(reader.get<std::size_t>());
  move(plan.source, plan.kept);
  for (const DensifyPlan::Child& child : plan.children) {
    const std::optional<std::size_t> i = own(child.index);
    if (!i) continue;
    shard_.training.model.mean[*i] = child.mean;
    shard_.training.model.log_scale[*i] = child.log_scale;
  }
  for (const std::size_t place : plan.fresh) {
    if (const std::optional<std::size_t> i = own(place)) clearMoments(shard_.training, *i);
  }
  return plan.result;
}

McmcResult Part::relocateAndGrow(const McmcSettings& settings, Random* random) {
  std::vector<float> opacity_logit;
  gatherValues(channel_, shards_, std::span(std::as_const(shard_.training.model.opacity_logit)), opacity_logit);
  MessageWriter said;
  if (random) {
    const McmcPlan plan = planRelocation(opacity_logit, settings, *random);
    said.put(plan.result);
    said.put(plan.source.size());
    said.put(plan.source);
    said.put(plan.copies.size());
    said.put(plan.copies);
  }
  const Message message = fromFirst(channel_, said.take());
  MessageReader reader(message);
  const auto result = reader.get<McmcResult>();
  const auto source = reader.get<std::uint32_t>(reader.get<std::size_t>());
  const auto copies = reader.get<int>(reader.get<std::size_t>());
  if (source.empty()) {
    shard_.statistics.reset(shard_.training.model.size());
    return result;
  }
  move(source, shards_.total());
  const std::size_t first = shards_.first(channel_.rank());
  for (std::size_t i = 0; i < shard_.training.model.size(); ++i) {
    shareGaussian(shard_.training, i, copies[source[first + i]], settings);
  }
  return result;
}

void Part::resetOpacity() { tg::resetOpacity(shard_.training); }
void Part::growShDegree(int degree) { tg::growShDegree(shard_.training, degree); }

void Part::updateFilter(std::span<const Pinhole> cameras) {
  std::vector<float> sizes = seenPixelSizes(cameras, shard_.training.model);
  const float own_largest = largestOf(sizes);
  float largest = 0;
  for (const Message& theirs : exchangeWithAll(channel_, std::as_bytes(std::span(&own_largest, 1)))) {
    largest = std::max(largest, MessageReader(theirs).get<float>());
  }
  makeMinSigmas(largest, sizes);
  shard_.min_sigma = std::move(sizes);
  shard_.filtered = true;
}

}  // namespace tg
