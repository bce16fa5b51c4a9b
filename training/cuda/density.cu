// SPDX-License-Identifier: Apache-2.0
// One thread a Gaussian decides; exclusive sums of the flags are the new places; then rows move. Each array is
// made anew, one after the other: it is as large as it must be, and a round holds one of them twice. The order of
// Gaussians, and which number of the random sequence is whose, are the CPU's.
#include "training/cuda/density.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/model/wide_splats.h"
#include "training/cuda/geometry.h"

namespace tg::cuda {
namespace {

// Of numbers from 0 on, in their order.
TG_DEVICE std::uint32_t orderedBits(float value) {
  std::uint32_t bits;
  memcpy(&bits, &value, sizeof(bits));
  return bits;
}
TG_DEVICE float fromOrderedBits(std::uint32_t bits) {
  float value;
  memcpy(&value, &bits, sizeof(value));
  return value;
}

TG_KERNEL numberKernel(std::uint32_t* indices, std::size_t count) {
  const std::size_t i = itemIndex();
  if (i < count) indices[i] = static_cast<std::uint32_t>(i);
}

// ---- Rows

struct RowsArguments {
  const float* from;
  float* to;
  const std::uint32_t* source;  // null: row j comes from row j
  std::size_t floats;           // of `to`
  std::size_t kept;             // rows from here on are 0
  unsigned from_row, to_row;    // floats; what a row of `to` has more is 0
};
TG_KERNEL rowsKernel(RowsArguments a) {
  const std::size_t i = itemIndex();
  if (i >= a.floats) return;
  const std::size_t j = i / a.to_row;
  const auto k = static_cast<unsigned>(i % a.to_row);
  const std::size_t row = a.source != nullptr && j < a.kept ? a.source[j] : j;
  a.to[i] = j < a.kept && k < a.from_row ? a.from[row * a.from_row + k] : 0.0f;
}

// `rows` become `count` rows of others or of zeros.
struct RowChange {
  const std::uint32_t* source;
  std::size_t kept, count;
  unsigned from_row, to_row;
};
void changeRows(Buffer<float>& rows, const RowChange& change) {
  const std::size_t floats = change.count * change.to_row;
  Buffer<float> changed;
  changed.resize(floats);
  launch(
      "rows", rowsKernel, blocksFor(floats),
      RowsArguments{rows.data(), changed.data(), change.source, floats, change.kept, change.from_row, change.to_row});
  std::swap(rows, changed);
}

// The twin of optimizer.h's.
void selectGaussians(DeviceState& state, const std::uint32_t* source, std::size_t kept, std::size_t count) {
  forEachField(
      [&](const Field& field, Buffer<float>& value, DeviceMoments& moments) {
        const auto row = static_cast<unsigned>(field.row(state.model.sh_count));
        changeRows(value, {source, count, count, row, row});
        changeRows(moments.first, {source, kept, count, row, row});
        changeRows(moments.second, {source, kept, count, row, row});
      },
      state.model, state.moments);
  state.model.count = count;
}

struct MomentRows {
  FieldRows first, second;
};
MomentRows rowsOf(const DeviceState& state) {
  const int k = state.model.sh_count;
  return {cuda::rowsOf(state.moments, k, [](const DeviceMoments& moments) { return moments.first.data(); }),
          cuda::rowsOf(state.moments, k, [](const DeviceMoments& moments) { return moments.second.data(); })};
}
TG_DEVICE void clearMoments(const MomentRows& moments, std::size_t i) {
  clearRows(moments.first, i);
  clearRows(moments.second, i);
}

void resetStatistics(DeviceStatistics& statistics, std::size_t count) {
  for (Buffer<float>* floats : {&statistics.score_sum, &statistics.magnitude_sum, &statistics.max_radius}) {
    floats->resize(count);
    floats->zero();
  }
  statistics.view_count.resize(count);
  statistics.view_count.zero();
}

// ---- ADC

struct ScoreArguments {
  std::size_t count;
  float threshold;
  const float* score_sum;
  const float* magnitude_sum;
  const std::uint32_t* view_count;
  float* scores;
  float* magnitudes;
  std::uint32_t* magnitude_keys;
  std::uint32_t* passing;  // how many scores reach 1
};
TG_KERNEL scoreKernel(ScoreArguments a) {
  const std::size_t i = itemIndex();
  bool passes = false;
  if (i < a.count) {
    a.scores[i] = meanOverViews(a.score_sum[i], a.view_count[i]) / a.threshold;
    a.magnitudes[i] = meanOverViews(a.magnitude_sum[i], a.view_count[i]);
    a.magnitude_keys[i] = orderedBits(a.magnitudes[i]);
    passes = a.scores[i] >= 1.0f;
  }
  const int block = __syncthreads_count(passes);
  if (threadIdx.x == 0) atomicAdd(a.passing, static_cast<std::uint32_t>(block));
}

struct DecideArguments {
  Parameters model;
  DensifySettings settings;
  const float* max_radius;
  const float* scores;
  const float* magnitudes;
  const std::uint32_t* sorted_magnitudes;  // null: they do not count
  const std::uint32_t* passing;
  std::uint32_t* keep;
  std::uint32_t* grow;
  std::uint32_t* keys;  // the highest score first, then who does not grow
};
TG_KERNEL decideKernel(DecideArguments a) {
  const std::size_t i = itemIndex();
  if (i > a.model.count) return;
  if (i == a.model.count) {
    a.keep[i] = a.grow[i] = 0;
    return;
  }
  const bool ranked = a.sorted_magnitudes != nullptr && *a.passing > 0;
  const float quantile = ranked ? fromOrderedBits(a.sorted_magnitudes[a.model.count - *a.passing]) : 0.0f;
  const float score = growthScore(a.scores[i], a.magnitudes[i], quantile, a.settings.score);
  const bool scored = score >= 1.0f;
  const bool keeps = !prunable(a.model.opacity_logit[i], readLogScale(a.model, i), a.max_radius[i], scored, a.settings);
  const bool grows = keeps && scored;
  a.keep[i] = keeps;
  a.grow[i] = grows;
  a.keys[i] = grows ? ~orderedBits(score) : 0xffffffffu;
}

// The first `room` of the order grow, the others do not.
TG_KERNEL roomKernel(const std::uint32_t* order, std::size_t count, std::size_t room, std::uint32_t* grow) {
  const std::size_t place = itemIndex();
  if (place < count) grow[order[place]] = place < room;
}

TG_KERNEL splitKernel(Parameters model, DensifySettings settings, const std::uint32_t* grow, std::uint32_t* split) {
  const std::size_t i = itemIndex();
  if (i > model.count) return;
  split[i] = i < model.count && grow[i] != 0 && !clonable(readLogScale(model, i), settings);
}

// flags and ranks as in DensityScratch.
struct Places {
  std::size_t count, kept;
  const std::uint32_t* keep;
  const std::uint32_t* grow;
  const std::uint32_t* split;
  const std::uint32_t* keep_rank;
  const std::uint32_t* grow_rank;
  const std::uint32_t* split_rank;
};
TG_KERNEL sourceKernel(Places a, std::uint32_t* source) {
  const std::size_t i = itemIndex();
  if (i >= a.count) return;
  if (a.keep[i] != 0) source[a.keep_rank[i]] = static_cast<std::uint32_t>(i);
  if (a.grow[i] != 0) source[a.kept + a.grow_rank[i]] = static_cast<std::uint32_t>(i);
}

// One thread an added Gaussian; those of splits write both children, whose rows are copies of their parent's.
TG_KERNEL childKernel(Places a, const std::uint32_t* source, std::size_t added, Parameters model,
                      MomentRows moments, float log_shrink, Random random) {
  const std::size_t k = itemIndex();
  if (k >= added) return;
  const std::uint32_t parent = source[a.kept + k];
  if (a.split[parent] == 0) return;
  const std::size_t places[2] = {a.keep_rank[parent], a.kept + k};
  const glm::vec3 mean = readVector(model.mean, places[1]);
  const glm::vec3 log_scale = readLogScale(model, places[1]);
  const glm::vec4 rotation(readRotation(model, places[1]));
  random.skip(std::uint64_t{kNumbersOfASplit} * a.split_rank[parent]);
  for (const std::size_t place : places) {
    writeVector(model.mean, place, sampleGaussian(mean, rotation, log_scale, random));
    writeVector(model.log_scale, place, log_scale - log_shrink);
  }
  clearMoments(moments, places[0]);
}

// ---- MCMC

struct WeightArguments {
  Parameters model;
  double dead_opacity;
  double units;            // of an opacity of 1
  std::uint64_t* weights;  // opacity, 0 of the dead
  std::uint32_t* dead;
};
TG_KERNEL weightKernel(WeightArguments a) {
  const std::size_t i = itemIndex();
  if (i > a.model.count) return;
  const double opacity = i < a.model.count ? sigmoid(a.model.opacity_logit[i]) : 0.0;
  const bool dead = opacity <= a.dead_opacity;
  a.weights[i] = dead || i == a.model.count ? 0 : static_cast<std::uint64_t>(opacity * a.units);
  a.dead[i] = dead && i < a.model.count;
}

struct DrawArguments {
  std::size_t count, target;
  const std::uint64_t* cumulative;  // [count + 1]
  const std::uint32_t* dead;
  const std::uint32_t* dead_rank;  // [count + 1]
  Random random;
  std::uint32_t* source;
  std::uint32_t* copies;
};
TG_KERNEL drawKernel(DrawArguments a) {
  const std::size_t i = itemIndex();
  if (i >= a.target) return;
  if (i < a.count && a.dead[i] == 0) {
    a.source[i] = static_cast<std::uint32_t>(i);
    return;
  }
  a.random.skip(i < a.count ? a.dead_rank[i] : a.dead_rank[a.count] + (i - a.count));
  const std::uint64_t total = a.cumulative[a.count];
  const auto drawn = static_cast<std::uint64_t>(a.random.uniform() * static_cast<double>(total));
  const std::uint64_t at = drawn < total ? drawn : total - 1;
  // The first whose sum, itself included, lies above.
  std::size_t low = 0, high = a.count - 1;
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (a.cumulative[middle + 1] > at) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  a.source[i] = static_cast<std::uint32_t>(low);
  atomicAdd(a.copies + low, 1u);
}

TG_KERNEL shareKernel(Parameters model, MomentRows moments, const std::uint32_t* source,
                      const std::uint32_t* copies, float dead_opacity) {
  const std::size_t i = itemIndex();
  if (i >= model.count || copies[source[i]] == 0) return;
  glm::vec3 log_scale = readLogScale(model, i);
  shareParameters(1 + static_cast<int>(copies[source[i]]), dead_opacity, model.opacity_logit[i], log_scale);
  writeVector(model.log_scale, i, log_scale);
  clearMoments(moments, i);
}

// ---- Opacity reset, 3D filter

TG_KERNEL limitKernel(float* values, std::size_t count, float limit) {
  const std::size_t i = itemIndex();
  if (i < count) values[i] = min(values[i], limit);
}

TG_KERNEL pixelSizeKernel(Parameters model, const Pinhole* cameras, std::size_t camera_count, float* sizes,
                          std::uint32_t* largest) {
  const std::size_t i = itemIndex();
  std::uint32_t bits = 0;
  if (i < model.count) {
    sizes[i] = pixelSizeAt(readVector(model.mean, i), cameras, camera_count);
    bits = orderedBits(sizes[i]);
  }
  for (unsigned offset = kWarp / 2; offset > 0; offset /= 2) {
    bits = max(bits, __shfl_xor_sync(kAllLanes, bits, static_cast<int>(offset)));
  }
  if (threadIdx.x % kWarp == 0) atomicMax(largest, bits);
}
TG_KERNEL minSigmaKernel(float* sizes, std::size_t count, const std::uint32_t* largest) {
  const std::size_t i = itemIndex();
  if (i >= count) return;
  const float size = sizes[i] == 0.0f ? fromOrderedBits(*largest) : sizes[i];
  sizes[i] = size * sqrt(kFilterVariance);
}

// ---- Wide Gaussians

TG_KERNEL wideKernel(Parameters model, const glm::dvec3* eyes, std::size_t eye_count, double bound,
                     std::uint32_t* found) {
  const std::size_t i = itemIndex();
  if (i >= model.count) return;
  const glm::vec3 log_scale = readLogScale(model, i);
  const double sigma = ::exp(static_cast<double>(max(max(log_scale.x, log_scale.y), log_scale.z)));
  if (sigma > bound * nearestDistance(readMean(model, i), eyes, eye_count)) atomicMax(found, 1u);
}

void sum(DensityScratch& scratch, const Buffer<std::uint32_t>& flags, Buffer<std::uint32_t>& ranks) {
  ranks.resize(flags.size());
  scratch.primitives.exclusiveSum(flags.data(), ranks.data(), flags.size());
}

void sortKeys(DensityScratch& scratch) {
  const std::size_t count = scratch.keys.size();
  scratch.indices.resize(count);
  scratch.order.resize(count);
  scratch.sorted_keys.resize(count);
  launch("number", numberKernel, blocksFor(count), scratch.indices.data(), count);
  scratch.primitives.sortPairs(scratch.keys.data(), scratch.sorted_keys.data(), scratch.indices.data(),
                               scratch.order.data(), count, 32);
}

}  // namespace

DensifyResult densify(DeviceState& state, const DensifySettings& settings, Random& random, DensityScratch& scratch) {
  const Parameters model = state.model.parameters();
  const std::size_t count = model.count;
  const std::size_t blocks = blocksFor(count + 1);
  scratch.scores.resize(count);
  scratch.magnitudes.resize(count);
  scratch.keys.resize(count);
  scratch.counter.resize(1);
  scratch.counter.zero();
  launch("scores", scoreKernel, blocksFor(count),
         ScoreArguments{count, settings.score_threshold, state.statistics.score_sum.data(),
                        state.statistics.magnitude_sum.data(), state.statistics.view_count.data(),
                        scratch.scores.data(), scratch.magnitudes.data(), scratch.keys.data(), scratch.counter.data()});
  const bool magnitudes = settings.score != DensifyScore::sum;
  if (magnitudes) sortKeys(scratch);

  for (Buffer<std::uint32_t>* flags : {&scratch.keep, &scratch.grow, &scratch.split}) flags->resize(count + 1);
  launch("decide", decideKernel, blocks,
         DecideArguments{model, settings, state.statistics.max_radius.data(), scratch.scores.data(),
                         scratch.magnitudes.data(), magnitudes ? scratch.sorted_keys.data() : nullptr,
                         scratch.counter.data(), scratch.keep.data(), scratch.grow.data(), scratch.keys.data()});
  sum(scratch, scratch.keep, scratch.keep_rank);
  sum(scratch, scratch.grow, scratch.grow_rank);
  const std::size_t kept = scratch.keep_rank.read(count);
  std::size_t added = scratch.grow_rank.read(count);
  if (settings.max_gaussians > 0) {
    const std::size_t room = settings.max_gaussians > kept ? settings.max_gaussians - kept : 0;
    if (added > room) {
      sortKeys(scratch);
      launch("room", roomKernel, blocksFor(count), scratch.order.data(), count, room, scratch.grow.data());
      sum(scratch, scratch.grow, scratch.grow_rank);
      added = room;
    }
  }
  launch("split", splitKernel, blocks, model, settings, scratch.grow.data(), scratch.split.data());
  sum(scratch, scratch.split, scratch.split_rank);
  const std::size_t splits = scratch.split_rank.read(count);

  const Places places{count,
                      kept,
                      scratch.keep.data(),
                      scratch.grow.data(),
                      scratch.split.data(),
                      scratch.keep_rank.data(),
                      scratch.grow_rank.data(),
                      scratch.split_rank.data()};
  scratch.source.resize(kept + added);
  launch("sources", sourceKernel, blocksFor(count), places, scratch.source.data());
  selectGaussians(state, scratch.source.data(), kept, kept + added);
  launch("children", childKernel, blocksFor(added), places, scratch.source.data(), added, state.model.parameters(),
         rowsOf(state), std::log(settings.split_shrink), random);
  random.skip(std::uint64_t{kNumbersOfASplit} * splits);
  resetStatistics(state.statistics, kept + added);
  return {count - kept, added - splits, splits};
}

McmcResult relocateAndGrow(DeviceState& state, const McmcSettings& settings, Random& random, DensityScratch& scratch) {
  const std::size_t count = state.model.count;
  resetStatistics(state.statistics, count);
  scratch.weights.resize(count + 1);
  scratch.cumulative.resize(count + 1);
  scratch.keep.resize(count + 1);
  const double units = std::ldexp(1.0, 63 - static_cast<int>(std::bit_width(count)));
  launch("weights", weightKernel, blocksFor(count + 1),
         WeightArguments{state.model.parameters(), settings.dead_opacity, units, scratch.weights.data(),
                         scratch.keep.data()});
  scratch.primitives.exclusiveSum(scratch.weights.data(), scratch.cumulative.data(), count + 1);
  sum(scratch, scratch.keep, scratch.keep_rank);
  if (scratch.cumulative.read(count) == 0) return {};

  const auto step = static_cast<std::size_t>(std::ceil(static_cast<double>(count) * double{settings.growth} - 1e-3));
  const std::size_t target = std::max(count, std::min(settings.max_gaussians, count + step));
  const McmcResult result{scratch.keep_rank.read(count), target - count};
  scratch.source.resize(target);
  scratch.copies.resize(count);
  scratch.copies.zero();
  launch("draw", drawKernel, blocksFor(target),
         DrawArguments{count, target, scratch.cumulative.data(), scratch.keep.data(), scratch.keep_rank.data(), random,
                       scratch.source.data(), scratch.copies.data()});
  random.skip(result.relocated + result.added);
  selectGaussians(state, scratch.source.data(), count, target);
  launch("share", shareKernel, blocksFor(target), state.model.parameters(), rowsOf(state), scratch.source.data(),
         scratch.copies.data(), settings.dead_opacity);
  resetStatistics(state.statistics, target);
  return result;
}

void resetOpacity(DeviceState& state) {
  launch("opacity reset", limitKernel, blocksFor(state.model.count), state.model.opacity_logit.data(),
         state.model.count, std::log(kResetOpacity / (1 - kResetOpacity)));
  state.moments.opacity_logit.first.zero();
  state.moments.opacity_logit.second.zero();
}

void growShDegree(DeviceState& state, int degree) {
  const auto coefficients = static_cast<int>(shCountOf(degree));
  if (coefficients <= state.model.sh_count) return;
  forEachField(
      [&](const Field& field, Buffer<float>& value, DeviceMoments& moments) {
        if (!field.harmonic) return;
        const RowChange change{nullptr, state.model.count, state.model.count,
                               static_cast<unsigned>(field.row(state.model.sh_count)),
                               static_cast<unsigned>(field.row(coefficients))};
        changeRows(value, change);
        changeRows(moments.first, change);
        changeRows(moments.second, change);
      },
      state.model, state.moments);
  state.model.sh_count = coefficients;
}

void updateFilter(DeviceState& state, const Buffer<Pinhole>& cameras, Buffer<std::uint32_t>& largest) {
  const std::size_t count = state.model.count;
  state.min_sigma.resize(count);
  largest.resize(1);
  largest.zero();
  launch("pixel sizes", pixelSizeKernel, blocksFor(count), state.model.parameters(), cameras.data(), cameras.size(),
         state.min_sigma.data(), largest.data());
  launch("3D filter sizes", minSigmaKernel, blocksFor(count), state.min_sigma.data(), count, largest.data());
}

bool mayHaveWide(const Parameters& model, const Buffer<glm::dvec3>& eyes, double bound, Buffer<std::uint32_t>& found) {
  found.resize(1);
  found.zero();
  launch("wide", wideKernel, blocksFor(model.count), model, eyes.data(), eyes.size(), bound * (1 - 1e-9), found.data());
  return found.read(0) != 0;
}

}  // namespace tg::cuda
