// SPDX-License-Identifier: Apache-2.0
// The model being trained with its Adam moments, the step that moves both, and every change of their size.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/model/model.h"
#include "training/step/gradient.h"
#include "training/step/step_math.h"

namespace tg {

// Adam's running means of gradient and squared gradient, one float per float of the parameter.
struct Moments {
  std::vector<float> first;
  std::vector<float> second;
  bool operator==(const Moments&) const = default;
};

template <typename>
using MomentsOf = Moments;
using ModelMoments = ModelFields<MomentsOf>;

struct TrainingState {
  GaussianModel model;
  ModelMoments moments;
  std::int64_t step = 0;  // Adam steps done since the moments were reset
};

// Of a Gaussian's first value of a parameter, and of the others that `sh` has.
struct Rate {
  float first, rest;
  Rate(float all) : first(all), rest(all) {}
  Rate(float first_value, float others) : first(first_value), rest(others) {}
};
// Learning rates of 3DGS; texel rate of the paper's appendix. The mean's rate is in world units.
struct LearningRates {
  float mean = 0;
  float rotation = 1e-3f;
  float log_scale = 5e-3f;
  float opacity_logit = 5e-2f;
  Rate sh{2.5e-3f, 2.5e-3f / 20};
  float texels = 1e-3f;
  float texel_decay = 0;  // of the texels' rate a step, towards colour 0 and alpha 1
};

// Log-linear from `first` to `last` over `iterations`, linear to a `last` of 0. Of a `first` of 0, what is to stay as
// it is, 0 throughout.
double decayedRate(double first, double last, std::int64_t iteration, std::int64_t iterations);

// Of step `step`, counted from 1.
AdamScales adamScales(std::int64_t step);

// Adam, beta 0.9 / 0.999, epsilon 1e-15, bias-corrected, on every parameter; texels then decay, and their alpha is
// clamped to [0, 1]. texture_groups: StepInput's; the texels of a group's first Gaussian are moved, by their gradient
// and with their moments, and all of the group get them.
// Moments must have the model's size (see resetMoments). Any thread count, same bytes.
void adamStep(TrainingState& state, const ModelGradient& gradient, const LearningRates& rates,
              std::span<const std::uint32_t> texture_groups = {});

// Whether the moments have the model's size.
bool momentsAgree(const TrainingState& state);

// Moments of the model's size, all zero; step 0.
void resetMoments(TrainingState& state);

// The moments of one Gaussian to zero, texels apart.
void clearMoments(TrainingState& state, std::size_t gaussian);

// New SH coefficients are zero, with zero moments: the picture does not change.
void growShDegree(TrainingState& state, int degree);

// Gaussian i becomes a copy of the old Gaussian source[i]. The first `kept` take their moments along, the others start
// from zero. For models without textures.
void selectGaussians(TrainingState& state, std::span<const std::uint32_t> source, std::size_t kept);

}  // namespace tg
