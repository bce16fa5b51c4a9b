// SPDX-License-Identifier: Apache-2.0
// Moments are added, SH mixed, textures resampled.
#include "core/merge/merge_pair.h"

#include <algorithm>

#include "core/merge/merged_texture.h"
#include "core/model/verbs.h"
#include "core/system/error.h"

namespace tg {
namespace {

// Shape, opacity and texture of the merged one.
void mergeTextures(GaussianModel& model, const PairMember& a, const PairMember& b, const GaussianMoments& whole,
                   float part, AxisFits& fits) {
  const std::size_t offset = model.atlas.texels.size();
  const glm::ivec2 size = mergedSize(rectOf(model, a.gaussian), rectOf(model, b.gaussian));
  const std::uint64_t texels = offset + static_cast<std::uint64_t>(size.x) * static_cast<std::uint64_t>(size.y);
  if (texels > kMaxModelTexels) {
    throw Error(ErrorKind::badData, "too many texels to merge" + atMost(kMaxModelTexels, texels));
  }
  MergedShape shape;
  shape.mean = whole.mean;
  shape.sigma = sigmaOf(whole, shape.axes);
  if (glm::determinant(shape.axes) < 0.0) shape.axes[2] = -shape.axes[2];  // as setMoments has them
  shape.opacity = std::min(whole.mass / areaOf(shape.sigma), kMostMergedOpacity);
  const std::size_t count = model.shCount();
  shape.dc = glm::dvec3(glm::mix(model.sh[b.gaussian * count], model.sh[a.gaussian * count], part));
  shape.part_a = a.part;
  shape.part_b = b.part;
  const MergedTexture texture = mergedTexture(model, a.gaussian, b.gaussian, shape, fits);
  setMoments(model, a.gaussian, whole);
  model.opacity_logit[a.gaussian] = logitFromOpacity(texture.opacity);
  model.atlas.texels.insert(model.atlas.texels.end(), texture.texels.begin(), texture.texels.end());
  model.atlas.rects[a.gaussian] = {static_cast<std::uint32_t>(offset), static_cast<std::uint16_t>(texture.size.x),
                                   static_cast<std::uint16_t>(texture.size.y)};
}

}  // namespace

GaussianMoments mergePair(GaussianModel& model, const PairMember& a, const PairMember& b, AxisFits& fits) {
  const GaussianMoments whole = merged(a.moments, b.moments);
  const float part = static_cast<float>(a.moments.mass / whole.mass);
  if (rectOf(model, a.gaussian).texelCount() + rectOf(model, b.gaussian).texelCount() != 0) {
    mergeTextures(model, a, b, whole, part, fits);
  } else {
    setMoments(model, a.gaussian, whole);
  }
  const std::size_t count = model.shCount();
  for (std::size_t k = 0; k < count; ++k) {
    glm::vec3& to = model.sh[a.gaussian * count + k];
    to = glm::mix(model.sh[b.gaussian * count + k], to, part);
  }
  return whole;
}

}  // namespace tg
