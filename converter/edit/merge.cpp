// SPDX-License-Identifier: Apache-2.0
// Puts one model beside another.
#include "converter/edit/merge.h"

#include <algorithm>
#include <cstdint>

#include "converter/edit/reduce.h"
#include "core/bundle/ply.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxMergedTexels = std::uint64_t{1} << 30;  // offsets have 32 bits

bool isTextured(const GaussianModel& model) {
  return model.texture_mode != TextureMode::none && !model.atlas.rects.empty();
}

// Terms that the mode lacks as neutral numbers, for a model that gets a larger mode.
void neutralize(TextureAtlas& atlas, TextureMode mode) {
  const unsigned bits = static_cast<unsigned>(mode);
  for (glm::vec4& texel : atlas.texels) {
    if ((bits & static_cast<unsigned>(TextureMode::rgb)) == 0) texel = glm::vec4(0.0f, 0.0f, 0.0f, texel.a);
    if ((bits & static_cast<unsigned>(TextureMode::alpha)) == 0) texel.a = 1.0f;
  }
}

template <typename T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

void mergeModel(GaussianModel& model, const GaussianModel& added, const std::string& path) {
  TG_ASSERT(lengthsAgree(model) && lengthsAgree(added), "the model's arrays have their lengths");
  const std::size_t before = model.size();
  if (before + added.size() > kMaxGaussians) {
    throw Error(ErrorKind::badData, path,
                "too many Gaussians in all (expected at most " + std::to_string(kMaxGaussians) + ", found " +
                    std::to_string(before + added.size()) + ")");
  }
  if (isTextured(model) && isTextured(added) && model.intersection != added.intersection) {
    throw Error(ErrorKind::badData, path,
                "another intersection model (expected " + std::string(name(model.intersection)) + ", found " +
                    std::string(name(added.intersection)) + ")");
  }
  if (!isTextured(model) && isTextured(added)) model.intersection = added.intersection;

  GaussianModel other = added;
  const int degree = std::max(model.sh_degree, other.sh_degree);
  setShDegree(model, degree);
  setShDegree(other, degree);
  append(model.mean, other.mean);
  append(model.rotation, other.rotation);
  append(model.log_scale, other.log_scale);
  append(model.opacity_logit, other.opacity_logit);
  append(model.sh, other.sh);

  if (!isTextured(other)) {
    if (isTextured(model)) model.atlas.rects.resize(model.size());
    return;
  }
  if (!isTextured(model)) {
    model.atlas = {};
    model.atlas.rects.resize(before);
    model.texture_mode = other.texture_mode;
  }
  if (model.texture_mode != other.texture_mode) {
    neutralize(model.atlas, model.texture_mode);
    neutralize(other.atlas, other.texture_mode);
    model.texture_mode = TextureMode::rgba;  // of two different modes, always the union
  }
  const std::uint64_t texels = std::uint64_t{model.atlas.texels.size()} + other.atlas.texels.size();
  if (texels > kMaxMergedTexels) {
    throw Error(ErrorKind::badData, path,
                "too many texels in all (expected at most " + std::to_string(kMaxMergedTexels) + ", found " +
                    std::to_string(texels) + ")");
  }
  for (TextureRect& rect : other.atlas.rects) {
    if (rect.texelCount() != 0) rect.offset += static_cast<std::uint32_t>(model.atlas.texels.size());
  }
  append(model.atlas.rects, other.atlas.rects);
  append(model.atlas.texels, other.atlas.texels);
}

}  // namespace tg
