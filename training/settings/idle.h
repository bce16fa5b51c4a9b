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
// --texture-mode none". `start`: the start model, if any; one with textures is past stage 1 and keeps them. `by_size`:
// the size of a file chooses counts that nobody named.
std::vector<std::string> idleSettings(const TrainSettings& settings, const ChosenSetting& chosen,
                                      const GaussianModel* start, bool by_size);

}  // namespace tg
