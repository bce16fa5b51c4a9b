// SPDX-License-Identifier: Apache-2.0
// Adam over flat float blocks in fixed chunks, and the bookkeeping that keeps moments beside their parameters.
#include "training/step/optimizer.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/model/texture_dictionary.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "training/step/simd.h"

namespace tg {
namespace {

constexpr std::int64_t kChunk = 4096;     // rows or texels a task
constexpr std::size_t kUniformLane = 16;  // row length for blocks with one rate
constexpr std::int64_t kGaussians = 256;  // a task

// rates: [lane], the learning rate of each position in a row.
TG_SIMD_CLONES void adamRow(float* __restrict value, const float* __restrict gradient, float* __restrict first,
                            float* __restrict second, const float* __restrict rates, std::size_t lane,
                            AdamScales scales) {
  for (std::size_t i = 0; i < lane; ++i) {
    adamUpdate(value[i], gradient[i], first[i], second[i], rates[i], scales);
  }
}

// Values [begin, end), row by row.
void adamRange(std::span<float> value, std::span<const float> gradient, Moments& moments, std::span<const float> rates,
               AdamScales scales, std::size_t begin, std::size_t end) {
  for (std::size_t at = begin; at < end; at += rates.size()) {
    adamRow(value.data() + at, gradient.data() + at, moments.first.data() + at, moments.second.data() + at,
            rates.data(), std::min(rates.size(), end - at), scales);
  }
}

void adamBlock(std::span<float> value, std::span<const float> gradient, Moments& moments, std::span<const float> rates,
               AdamScales scales) {
  const std::size_t chunk_values = kChunk * rates.size();
  parallelFor(static_cast<std::int64_t>((value.size() + chunk_values - 1) / chunk_values), 1, [&](std::int64_t chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * chunk_values;
    adamRange(value, gradient, moments, rates, scales, begin, std::min(value.size(), begin + chunk_values));
  });
}

template <typename T>
std::span<float> floats(std::vector<T>& values) {
  return {reinterpret_cast<float*>(values.data()), values.size() * (sizeof(T) / sizeof(float))};
}
template <typename T>
std::span<const float> floats(const std::vector<T>& values) {
  return {reinterpret_cast<const float*>(values.data()), values.size() * (sizeof(T) / sizeof(float))};
}

struct TexelStep {
  std::vector<glm::vec4>& texels;
  const std::vector<glm::vec4>& gradient;
  Moments& moments;
  const LearningRates& rates;
  AdamScales scales;
};

void moveTexels(const TexelStep& step, std::int64_t begin, std::int64_t end) {
  std::array<float, kUniformLane> rates;
  rates.fill(step.rates.texels);
  adamRange(floats(step.texels), floats(step.gradient), step.moments, rates, step.scales,
            static_cast<std::size_t>(4 * begin), static_cast<std::size_t>(4 * end));
  const float decay = step.rates.texels * step.rates.texel_decay;
  for (std::int64_t i = begin; i < end; ++i) {
    glm::vec4& texel = step.texels[i];
    if (decay > 0) {
      for (int ch = 0; ch < 4; ++ch) texel[ch] = decayedTexel(texel[ch], static_cast<unsigned>(ch), decay);
    }
    texel.a = std::clamp(texel.a, 0.0f, 1.0f);
  }
}

}  // namespace

double decayedRate(double first, double last, std::int64_t iteration, std::int64_t iterations) {
  if (first == 0) return 0;
  const double progress =
      iterations > 0 ? std::clamp(static_cast<double>(iteration) / static_cast<double>(iterations), 0.0, 1.0) : 1.0;
  if (!(last > 0)) return std::lerp(first, last, progress);
  return std::exp(std::lerp(std::log(first), std::log(last), progress));
}

AdamScales adamScales(std::int64_t step) {
  TG_ASSERT(step >= 1, "steps count from 1");
  const auto t = static_cast<double>(step);
  return {static_cast<float>(1 / (1 - std::pow(double{kBeta1}, t))),
          static_cast<float>(1 / std::sqrt(1 - std::pow(double{kBeta2}, t)))};
}

void adamStep(TrainingState& state, const ModelGradient& gradient, const LearningRates& rates,
              std::span<const std::uint32_t> texture_groups) {
  TG_ASSERT(momentsAgree(state), "moments have the model's size");
  forEachParameter(
      [](const Field&, const auto& values, const auto& slopes) {
        TG_ASSERT(slopes.size() == values.size(), "the gradient has the model's shape");
      },
      state.model, gradient);
  GaussianModel& model = state.model;
  ++state.step;
  const AdamScales scales = adamScales(state.step);
  const auto move = [&](const Field& field, auto& value, const auto& v_value, Moments& moments, Rate rate) {
    std::vector<float> lane(field.harmonic ? field.row(model.shCount()) : kUniformLane, rate.rest);
    std::fill_n(lane.begin(), field.floats, rate.first);
    adamBlock(floats(value), floats(v_value), moments, lane, scales);
  };
  forEachField(move, model, gradient, state.moments, rates);
  if (model.texture_mode == TextureMode::none) return;
  const TexelStep step{model.atlas.texels, gradient.texels, state.moments.texels, rates, scales};
  if (texture_groups.empty()) {
    const auto count = static_cast<std::int64_t>(model.atlas.texels.size());
    parallelFor((count + kChunk - 1) / kChunk, 1,
                [&](std::int64_t chunk) { moveTexels(step, chunk * kChunk, std::min(count, (chunk + 1) * kChunk)); });
    return;
  }
  const std::vector<std::uint32_t> first = firstOfGroups(texture_groups);
  const std::vector<TextureRect>& rects = model.atlas.rects;
  parallelFor(static_cast<std::int64_t>(first.size()), 1, [&](std::int64_t group) {
    const TextureRect& rect = rects[first[group]];
    moveTexels(step, rect.offset, std::int64_t{rect.offset} + rect.texelCount());
  });
  glm::vec4* texels = model.atlas.texels.data();
  parallelFor(static_cast<std::int64_t>(rects.size()), kGaussians, [&](std::int64_t i) {
    const std::uint32_t owner = first[texture_groups[i]];
    if (owner != i) std::copy_n(texels + rects[owner].offset, rects[i].texelCount(), texels + rects[i].offset);
  });
}

bool momentsAgree(const TrainingState& state) {
  bool agree = lengthsAgree(state.model);
  forEachParameter(
      [&](const Field&, const auto& values, const Moments& moments) {
        const std::size_t n = floats(values).size();
        agree = agree && moments.first.size() == n && moments.second.size() == n;
      },
      state.model, state.moments);
  return agree;
}

void resetMoments(TrainingState& state) {
  forEachParameter(
      [](const Field&, const auto& values, Moments& moments) {
        moments.first.assign(floats(values).size(), 0.0f);
        moments.second.assign(floats(values).size(), 0.0f);
      },
      state.model, state.moments);
  state.step = 0;
}

void clearMoments(TrainingState& state, std::size_t gaussian) {
  TG_ASSERT(gaussian < state.model.size(), "the model has this Gaussian");
  forEachField(
      [&](const Field& field, Moments& moments) {
        const std::size_t row = field.row(state.model.shCount());
        std::fill_n(moments.first.data() + gaussian * row, row, 0.0f);
        std::fill_n(moments.second.data() + gaussian * row, row, 0.0f);
      },
      state.moments);
}

void growShDegree(TrainingState& state, int degree) {
  if (degree <= state.model.sh_degree) return;
  const std::size_t before = state.model.shCount();
  setShDegree(state.model, degree);
  forEachField(
      [&](const Field& field, Moments& moments) {
        const std::size_t from = field.row(before), to = field.row(state.model.shCount());
        if (from == to) return;
        moments.first = withRowLength(moments.first, from, to);
        moments.second = withRowLength(moments.second, from, to);
      },
      state.moments);
}

void selectGaussians(TrainingState& state, std::span<const std::uint32_t> source, std::size_t kept) {
  TG_ASSERT(kept <= source.size(), "no more keep their moments than there are");
  TG_ASSERT(state.model.atlas.rects.empty(), "a model without textures");
  TG_ASSERT(std::all_of(source.begin(), source.end(), [&](std::uint32_t i) { return i < state.model.size(); }),
            "the model has the sources");
  TG_ASSERT(momentsAgree(state), "moments have the model's size");
  const std::size_t k = state.model.shCount();
  forEachField(
      [&](const Field& field, auto& values, Moments& moments) {
        values = gathered(values, field.values(k), source, source.size());
        moments.first = gathered(moments.first, field.row(k), source, kept);
        moments.second = gathered(moments.second, field.row(k), source, kept);
      },
      state.model, state.moments);
}

}  // namespace tg
