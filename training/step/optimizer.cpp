// SPDX-License-Identifier: Apache-2.0
// Adam over flat float blocks in fixed chunks, and the bookkeeping that keeps moments beside their parameters.
#include "training/step/optimizer.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "training/step/simd.h"

namespace tg {
namespace {

constexpr std::int64_t kChunk = 4096;     // rows of kLane floats a task
constexpr std::size_t kUniformLane = 16;  // row length for blocks with one rate

// rates: [lane], the learning rate of each position in a row.
TG_SIMD_CLONES void adamRow(float* __restrict value, const float* __restrict gradient, float* __restrict first,
                            float* __restrict second, const float* __restrict rates, std::size_t lane,
                            AdamScales scales) {
  for (std::size_t i = 0; i < lane; i++) {
    adamUpdate(value[i], gradient[i], first[i], second[i], rates[i], scales);
  }
}

void adamBlock(std::span<float> value, std::span<const float> gradient, Moments& moments, std::span<const float> rates,
               AdamScales scales) {
  const std::size_t lane = rates.size();
  const auto rows = static_cast<std::int64_t>((value.size() + lane - 1) / lane);
  parallelFor((rows + kChunk - 1) / kChunk, 1, [&](std::int64_t chunk) {
    for (std::int64_t row = chunk * kChunk; row < std::min(rows, (chunk + 1) * kChunk); row++) {
      const std::size_t at = static_cast<std::size_t>(row) * lane;
      adamRow(value.data() + at, gradient.data() + at, moments.first.data() + at, moments.second.data() + at,
              rates.data(), std::min(lane, value.size() - at), scales);
    }
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

template <typename T>
void resetBlock(const std::vector<T>& parameter, Moments& moments) {
  moments.first.assign(floats(parameter).size(), 0.0f);
  moments.second.assign(floats(parameter).size(), 0.0f);
}

template <typename T>
std::vector<T> gatherRows(const std::vector<T>& rows, std::size_t row_length, std::span<const std::uint32_t> source,
                          std::size_t count) {
  std::vector<T> result(source.size() * row_length);
  for (std::size_t i = 0; i < count; i++) {
    std::copy_n(rows.data() + source[i] * row_length, row_length, result.data() + i * row_length);
  }
  return result;
}

template <typename T>
void selectBlock(std::vector<T>& parameter, Moments& moments, std::size_t per_gaussian,
                 std::span<const std::uint32_t> source, std::size_t kept) {
  parameter = gatherRows(parameter, per_gaussian, source, source.size());
  const std::size_t row_length = per_gaussian * (sizeof(T) / sizeof(float));
  moments.first = gatherRows(moments.first, row_length, source, kept);
  moments.second = gatherRows(moments.second, row_length, source, kept);
}

template <typename T>
std::vector<T> widenRows(const std::vector<T>& rows, std::size_t count, std::size_t from, std::size_t to) {
  std::vector<T> result(count * to, T{});
  for (std::size_t i = 0; i < count; i++) std::copy_n(rows.data() + i * from, from, result.data() + i * to);
  return result;
}

}  // namespace

double decayedRate(double first, double last, std::int64_t iteration, std::int64_t iterations) {
  const double progress =
      iterations > 0 ? std::clamp(static_cast<double>(iteration) / static_cast<double>(iterations), 0.0, 1.0) : 1.0;
  if (!(first > 0 && last > 0)) return std::lerp(first, last, progress);
  return std::exp(std::lerp(std::log(first), std::log(last), progress));
}

AdamScales adamScales(std::int64_t step) {
  TG_ASSERT(step >= 1, "steps count from 1");
  const auto t = static_cast<double>(step);
  return {static_cast<float>(1 / (1 - std::pow(double{kBeta1}, t))),
          static_cast<float>(1 / std::sqrt(1 - std::pow(double{kBeta2}, t)))};
}

void adamStep(TrainingState& state, const ModelGradient& gradient, const LearningRates& rates) {
  TG_ASSERT(momentsAgree(state), "moments have the model's size");
  TG_ASSERT(gradient.v_mean.size() == state.model.mean.size() && gradient.v_sh.size() == state.model.sh.size(),
            "the gradient has the model's size");
  TG_ASSERT(gradient.v_rotation.size() == state.model.rotation.size() &&
                gradient.v_log_scale.size() == state.model.log_scale.size(),
            "the gradient has the model's size");
  TG_ASSERT(gradient.v_opacity_logit.size() == state.model.opacity_logit.size() &&
                gradient.v_texels.size() == state.model.atlas.texels.size(),
            "the gradient has the model's size");
  GaussianModel& model = state.model;
  state.step++;
  const AdamScales scales = adamScales(state.step);
  const auto uniform = [&](auto& value, const auto& v_value, Moments& moments, float rate) {
    std::array<float, kUniformLane> lane;
    lane.fill(rate);
    adamBlock(floats(value), floats(v_value), moments, lane, scales);
  };
  uniform(model.mean, gradient.v_mean, state.mean, rates.mean);
  uniform(model.rotation, gradient.v_rotation, state.rotation, rates.rotation);
  uniform(model.log_scale, gradient.v_log_scale, state.log_scale, rates.log_scale);
  uniform(model.opacity_logit, gradient.v_opacity_logit, state.opacity_logit, rates.opacity_logit);
  std::vector<float> sh_rates(static_cast<std::size_t>(model.shCount()) * 3, rates.sh_rest);
  std::fill_n(sh_rates.begin(), 3, rates.sh_dc);
  adamBlock(floats(model.sh), floats(gradient.v_sh), state.sh, sh_rates, scales);
  if (model.texture_mode == TextureMode::none) return;
  uniform(model.atlas.texels, gradient.v_texels, state.texels, rates.texels);
  for (glm::vec4& texel : model.atlas.texels) texel.a = std::clamp(texel.a, 0.0f, 1.0f);
}

bool momentsAgree(const TrainingState& state) {
  const auto agree = [](const Moments& moments, std::size_t floats) {
    return moments.first.size() == floats && moments.second.size() == floats;
  };
  const GaussianModel& model = state.model;
  const std::size_t n = model.size();
  return lengthsAgree(model) && agree(state.mean, 3 * n) && agree(state.rotation, 4 * n) &&
         agree(state.log_scale, 3 * n) && agree(state.opacity_logit, n) && agree(state.sh, 3 * model.sh.size()) &&
         agree(state.texels, 4 * model.atlas.texels.size());
}

void resetMoments(TrainingState& state) {
  resetBlock(state.model.mean, state.mean);
  resetBlock(state.model.rotation, state.rotation);
  resetBlock(state.model.log_scale, state.log_scale);
  resetBlock(state.model.opacity_logit, state.opacity_logit);
  resetBlock(state.model.sh, state.sh);
  resetBlock(state.model.atlas.texels, state.texels);
  state.step = 0;
}

void clearMoments(TrainingState& state, std::size_t gaussian) {
  TG_ASSERT(gaussian < state.model.size(), "the model has this Gaussian");
  const auto clear = [gaussian](Moments& moments, std::size_t length) {
    std::fill_n(moments.first.begin() + static_cast<std::ptrdiff_t>(gaussian * length), length, 0.0f);
    std::fill_n(moments.second.begin() + static_cast<std::ptrdiff_t>(gaussian * length), length, 0.0f);
  };
  clear(state.mean, 3);
  clear(state.rotation, 4);
  clear(state.log_scale, 3);
  clear(state.opacity_logit, 1);
  clear(state.sh, static_cast<std::size_t>(state.model.shCount()) * 3);
}

void growShDegree(GaussianModel& model, int degree) {
  TG_ASSERT(degree >= model.sh_degree && degree <= 3, "an SH degree grows, up to 3");
  if (degree <= model.sh_degree) return;
  const auto from = static_cast<std::size_t>(model.shCount());
  model.sh_degree = degree;
  model.sh = widenRows(model.sh, model.size(), from, static_cast<std::size_t>(model.shCount()));
}

void growShDegree(TrainingState& state, int degree) {
  const std::size_t from = 3 * static_cast<std::size_t>(state.model.shCount());
  growShDegree(state.model, degree);
  const std::size_t to = 3 * static_cast<std::size_t>(state.model.shCount());
  if (to == from) return;
  state.sh.first = widenRows(state.sh.first, state.model.size(), from, to);
  state.sh.second = widenRows(state.sh.second, state.model.size(), from, to);
}

void selectGaussians(TrainingState& state, std::span<const std::uint32_t> source, std::size_t kept) {
  TG_ASSERT(kept <= source.size(), "no more keep their moments than there are");
  TG_ASSERT(state.model.atlas.rects.empty(), "a model without textures");
  TG_ASSERT(std::all_of(source.begin(), source.end(), [&](std::uint32_t i) { return i < state.model.size(); }),
            "the model has the sources");
  TG_ASSERT(momentsAgree(state), "moments have the model's size");
  GaussianModel& model = state.model;
  selectBlock(model.mean, state.mean, 1, source, kept);
  selectBlock(model.rotation, state.rotation, 1, source, kept);
  selectBlock(model.log_scale, state.log_scale, 1, source, kept);
  selectBlock(model.opacity_logit, state.opacity_logit, 1, source, kept);
  selectBlock(model.sh, state.sh, static_cast<std::size_t>(model.shCount()), source, kept);
}

}  // namespace tg
