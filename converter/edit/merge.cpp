// SPDX-License-Identifier: Apache-2.0
// Puts one model beside another.
#include "converter/edit/merge.h"

#include <algorithm>
#include <cstdint>

#include "core/bundle/ply.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {

void mergeModel(GaussianModel& model, const GaussianModel& added, const std::string& path) {
  TG_ASSERT(lengthsAgree(model) && lengthsAgree(added), "the model's arrays have their lengths");
  const std::size_t before = model.size();
  if (before + added.size() > kMaxGaussians) {
    throw Error(ErrorKind::badData, path, "too many Gaussians in all" + atMost(kMaxGaussians, before + added.size()));
  }
  const bool textured = isTextured(model), adds_textures = isTextured(added);
  if (model.intersection != added.intersection) {
    throw Error(ErrorKind::badData, path,
                "another intersection model" +
                    expectedFound(std::string(name(model.intersection)), std::string(name(added.intersection))));
  }
  if (textured && adds_textures && model.outside != added.outside) {
    throw Error(ErrorKind::badData, path,
                "its textures end in another way" +
                    expectedFound(std::string(name(model.outside)), std::string(name(added.outside))));
  }
  if (!textured && adds_textures) model.outside = added.outside;

  GaussianModel other = added;
  const int degree = std::max(model.sh_degree, other.sh_degree);
  setShDegree(model, degree);
  setShDegree(other, degree);
  if (!textured) model.atlas = {};
  if (!adds_textures) other.atlas = {};
  if (adds_textures && !textured) model.texture_mode = other.texture_mode;
  if (adds_textures && model.texture_mode != other.texture_mode) {
    neutralize(model.atlas.texels, model.texture_mode);
    neutralize(other.atlas.texels, other.texture_mode);
    model.texture_mode = TextureMode::rgba;  // of two different modes, always the union
  }
  const std::uint64_t texels = std::uint64_t{model.atlas.texels.size()} + other.atlas.texels.size();
  if (texels > kMaxModelTexels) {
    throw Error(ErrorKind::badData, path, "too many texels in all" + atMost(kMaxModelTexels, texels));
  }
  append(model, other);
}

}  // namespace tg
