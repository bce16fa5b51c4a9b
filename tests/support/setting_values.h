// SPDX-License-Identifier: Apache-2.0
// Every render setting away from its default, a value of each, and every output: whether a renderer takes it up.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "render/settings.h"
#include "support/scenes.h"

namespace tg::test {

// A value that is not the default, as text. Throws Error for a new setting: its value is missing in setting_values.cpp.
const std::string& otherValue(const RenderSetting& setting);

// The pictures of an output with these settings, by each way that a renderer has to draw it.
using DrawPictures = std::function<std::vector<Image>(const TestScene&, const RenderSettings&, Output)>;
// A line for each setting whose value does not make of the pictures what it makes of the reference's, in the first
// output that its row names; "" where there is none.
std::string ignoredSettings(const DrawPictures& draw);
// A line for each output that is 0 all over, or whose pictures are unlike the reference's; "" where there is none.
std::string undrawnOutputs(const DrawPictures& draw);

}  // namespace tg::test
