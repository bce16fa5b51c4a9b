// SPDX-License-Identifier: Apache-2.0
// Settings that were chosen and that no stage uses.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "core/model/model.h"
#include "training/settings/settings.h"

namespace tg {

using ChosenSetting = std::function<bool(const SettingEntry& entry)>;

// A line for each reason why chosen settings do nothing: "--texture-size, --rate-texels: does nothing with
// --texture-mode none". `by_size`: the size of a file chooses counts that nobody named.
std::vector<std::string> idleSettings(const TrainSettings& settings, const ChosenSetting& chosen, bool start_model,
                                      bool by_size);
// The same of a start model that has textures, which is past stage 1 and keeps them.
std::vector<std::string> idlePastStage1(const TrainSettings& settings, const ChosenSetting& chosen,
                                        const GaussianModel& start, bool by_size);

}  // namespace tg
