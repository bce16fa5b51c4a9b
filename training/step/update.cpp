// SPDX-License-Identifier: Apache-2.0
// From a gradient to the next parameters.
#include "training/step/update.h"

#include <algorithm>
#include <vector>

#include "core/system/parallel.h"
#include "training/step/textures.h"

namespace tg {
namespace {

void clampColors(std::vector<glm::vec4>& texels) {
  constexpr std::int64_t kChunk = 1 << 16;
  const auto count = static_cast<std::int64_t>(texels.size());
  parallelFor((count + kChunk - 1) / kChunk, 1, [&](std::int64_t chunk) {
    for (std::int64_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
      texels[i] = glm::clamp(texels[i], glm::vec4(0.0f), glm::vec4(1.0f));
    }
  });
}

}  // namespace

void updateParameters(TrainingState& training, std::span<const float> min_sigma, DensityStatistics& statistics,
                      const StepInput& input, const ModelPart& part, ModelGradient& gradient) {
  GaussianModel& model = training.model;
  if (!min_sigma.empty()) filterGradient(model, min_sigma, gradient);
  if (input.mcmc) addRegularizerGradient(model, input.opacity_weight, input.scale_weight, part.count, gradient);
  if (!input.texture_groups.empty()) sumOverGroups(model.atlas, input.texture_groups, gradient.texels);
  adamStep(training, gradient, input.rates, input.texture_groups);
  if (input.clamp_colors) clampColors(model.atlas.texels);
  if (input.mcmc) addExplorationNoise(model, input.noise, input.noise_seed, input.iteration, part.first);
  if (input.gather_statistics) statistics.add(gradient);
}

}  // namespace tg
