// SPDX-License-Identifier: Apache-2.0
// What the colours of a picture stand for.
#pragma once
#include <array>
#include <functional>
#include <glm/glm.hpp>
#include <optional>
#include <string>

#include "core/image/image.h"
#include "render/renderer.h"
#include "viewer/view/compare.h"

namespace tg {

struct Legend {
  std::string title;
  std::array<std::string, 3> numbers;     // at the bar's left end, in its middle, at its right end
  std::function<glm::vec3(float)> color;  // of a place in [0, 1] along the bar
};
// Of a picture of that output; `scale` as visualize() gives it. None where colours are no numbers.
std::optional<Legend> legendOf(Output output, const RenderSettings& settings, const ValueScale& scale);
// Of what a difference or a FLIP map shows; none of the other modes.
std::optional<Legend> legendOf(const Comparison& how);
// Whether there is one.
inline bool hasLegend(Output output) { return kNumberOutputs.has(output) || output == Output::texture; }
inline bool hasLegend(CompareMode mode) { return mode == CompareMode::difference || mode == CompareMode::flip; }

// The picture with the legend over its lower left corner. Throws Error(usage) where there is no room for it.
Image withLegend(Image picture, const Legend& legend);

}  // namespace tg
