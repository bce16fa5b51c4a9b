// SPDX-License-Identifier: Apache-2.0
// What nobody chose of a recipe, from the start model and from what is asked of the output.
#pragma once
#include <cstdint>
#include <string>

#include "core/model/model.h"
#include "training/settings/settings.h"
#include "training/train_flags.h"

namespace tg {

// Into `settings`, which are settingsOf(options). training_pixels: of the training views, all together; 0: not known
// yet. start: the start model, or null. shares: whether textures that Gaussians share can be trained. Returns what to
// say of it, or "". Throws Error(usage).
std::string planRecipe(const TrainFlags& options, std::uint64_t training_pixels, const GaussianModel* start,
                       bool shares, TrainSettings& settings);

// Whether the count of Gaussians in `settings`, which planRecipe() has been through, is planned for a size.
bool plansCount(const TrainFlags& options, const TrainSettings& settings);

}  // namespace tg
