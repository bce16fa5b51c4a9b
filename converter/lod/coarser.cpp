// SPDX-License-Identifier: Apache-2.0
// Cells by median splits, and the Gaussians of each merged.
#include "converter/lod/coarser.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "converter/lod/merge_pair.h"
#include "converter/lod/split.h"
#include "core/model/fallback.h"
#include "core/model/texture_fit.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"

namespace tg {
namespace {

GaussianModel withHalfTextures(const GaussianModel& model) {
  if (!isTextured(model)) return withoutTextures(model);
  GaussianModel half = model;
  const GaussianModel means = bakeFallback(model);
  std::vector<glm::ivec2> sizes(model.size(), glm::ivec2(0));
  bool textured = false;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const TextureRect& rect = model.atlas.rects[i];
    if (std::max(rect.width, rect.height) >= 4) {
      sizes[i] = {std::max(rect.width / 2, 1), std::max(rect.height / 2, 1)};
      textured = true;
    } else {
      half.opacity_logit[i] = means.opacity_logit[i];
      half.sh[i * model.shCount()] = means.sh[i * model.shCount()];
    }
  }
  if (!textured) return withoutTextures(half);
  half.atlas = resizedAtlas(model.atlas, sizes);
  return half;
}

void splitInto(std::span<const glm::vec3> places, std::span<std::uint32_t> part, std::size_t cells,
               std::vector<std::span<std::uint32_t>>& found) {
  if (cells == 1) {
    found.push_back(part);
    return;
  }
  const std::size_t left = cells / 2;
  const std::size_t middle = part.size() * left / cells;
  splitAt(places, part, middle);
  splitInto(places, part.first(middle), left, found);
  splitInto(places, part.subspan(middle), cells - left, found);
}

}  // namespace

GaussianModel coarser(const GaussianModel& model, std::size_t count) {
  TG_ASSERT(lengthsAgree(model) && count >= 1, "a model, and a Gaussian at least");
  GaussianModel half = withHalfTextures(model);
  if (model.size() <= count) return half;
  std::vector<std::uint32_t> order(model.size());
  std::iota(order.begin(), order.end(), 0u);
  std::vector<std::span<std::uint32_t>> cells;
  splitInto(model.mean, order, count, cells);
  const std::vector<glm::vec4> means = textureMeans(half.atlas, half.size());
  AxisFits fits;
  std::vector<std::uint32_t> kept;
  for (const std::span<std::uint32_t> cell : cells) {
    std::ranges::sort(cell);
    const std::uint32_t first = cell.front();
    kept.push_back(first);
    Moments whole = momentsOf(half, first, static_cast<double>(means[first].a));
    for (const std::uint32_t i : cell.subspan(1)) {
      whole = mergePair(half, {first, whole}, {i, momentsOf(half, i, static_cast<double>(means[i].a))}, fits);
    }
  }
  return select(half, kept);
}

}  // namespace tg
