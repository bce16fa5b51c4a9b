// SPDX-License-Identifier: Apache-2.0
// Rectangles first, then their texels.
#include "training/step/textures.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "shared/limits.h"
#include "shared/sh.h"
#include "shared/splat.h"

namespace tg {
namespace {

constexpr int kMostFootprintTexels = 64;  // a side
constexpr float kPaperColor = 25.0f / 255.0f;

TextureRect footprintRect(const GaussianModel& model, std::size_t i, float pixel_size, double pitch) {
  const int c = shortestAxis(model.log_scale[i]);
  const auto side = [&](int axis) {
    const double pixels = 2.0 * kTextureExtent * std::exp(model.log_scale[i][axis]) / std::max(pixel_size, 1e-30f);
    return static_cast<std::uint16_t>(std::clamp(std::round(pixels / pitch), 1.0, double{kMostFootprintTexels}));
  };
  return {0, side(axisU(c)), side(axisV(c))};
}

std::size_t texelCount(const std::vector<TextureRect>& rects) {
  std::size_t count = 0;
  for (const TextureRect& rect : rects) count += rect.texelCount();
  return count;
}

}  // namespace

std::vector<TextureRect> uniformRects(std::size_t count, int size, std::size_t texel_budget) {
  if (texel_budget > 0) {
    const double texels = static_cast<double>(texel_budget) / static_cast<double>(std::max<std::size_t>(count, 1));
    size = static_cast<int>(std::clamp(std::floor(std::sqrt(texels)), 1.0, 256.0));
  }
  const auto side = static_cast<std::uint16_t>(size);
  return std::vector<TextureRect>(count, TextureRect{0, side, side});
}

std::vector<TextureRect> footprintRects(const GaussianModel& model, std::span<const float> pixel_sizes,
                                        std::size_t texel_budget) {
  TG_ASSERT(pixel_sizes.size() == model.size(), "a size a Gaussian");
  const auto rects = [&](double pitch) {
    std::vector<TextureRect> result(model.size());
    for (std::size_t i = 0; i < model.size(); ++i) result[i] = footprintRect(model, i, pixel_sizes[i], pitch);
    return result;
  };
  // Fewer texels the larger the pitch: bisection in its logarithm.
  double low = std::log(1e-3), high = std::log(1e6);
  for (int step = 0; step < 40; ++step) {
    const double middle = (low + high) / 2;
    (texelCount(rects(std::exp(middle))) > texel_budget ? low : high) = middle;
  }
  return rects(std::exp(high));
}

void addTextures(TrainingState& state, std::vector<TextureRect> rects, TextureMode mode, TextureInit init) {
  TG_ASSERT(rects.size() == state.model.size(), "a rectangle a Gaussian");
  TG_ASSERT(mode != TextureMode::none, "textures have a mode");
  GaussianModel& model = state.model;
  const std::size_t texels = texelCount(rects);
  if (texels > kMaxModelTexels) throw Error(ErrorKind::usage, "too many texels" + atMost(kMaxModelTexels, texels));
  std::uint32_t offset = 0;
  for (TextureRect& rect : rects) {
    rect.offset = offset;
    offset += rect.texelCount();
  }
  const bool color = init == TextureInit::paper && hasColor(mode);
  model.texture_mode = mode;
  model.atlas.rects = std::move(rects);
  model.atlas.texels.assign(texels, glm::vec4(glm::vec3(color ? kPaperColor : 0.0f), 1.0f));
  if (color) {
    for (std::size_t i = 0; i < model.size(); ++i) model.sh[i * model.shCount()] -= kPaperColor / kShC0;
  }
  resetMoments(state);
}

void sumOverGroups(const TextureAtlas& atlas, std::span<const std::uint32_t> groups, std::vector<glm::vec4>& gradient) {
  TG_ASSERT(groups.size() == atlas.rects.size() && gradient.size() == atlas.texels.size(), "a group a Gaussian");
  if (groups.empty()) return;
  std::vector<std::uint32_t> begin(*std::ranges::max_element(groups) + 2, 0), members(groups.size());
  for (const std::uint32_t group : groups) ++begin[group + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::uint32_t> at(begin.begin(), begin.end() - 1);
  for (std::uint32_t i = 0; i < groups.size(); ++i) members[at[groups[i]]++] = i;
  parallelFor(static_cast<std::int64_t>(begin.size()) - 1, 1, [&](std::int64_t group) {
    const auto own = std::span(members).subspan(begin[group], begin[group + 1] - begin[group]);
    const std::uint32_t count = atlas.rects[own[0]].texelCount();
    glm::vec4* sum = gradient.data() + atlas.rects[own[0]].offset;
    for (const std::uint32_t i : own.subspan(1)) {
      const glm::vec4* from = gradient.data() + atlas.rects[i].offset;
      for (std::uint32_t t = 0; t < count; ++t) sum[t] += from[t];
    }
  });
}

}  // namespace tg
