// SPDX-License-Identifier: Apache-2.0
// The trained scene: Gaussians as structure of arrays, with their textures.
#pragma once
#include <cmath>
#include <cstddef>
#include <glm/glm.hpp>
#include <string>

#include "core/model/atlas.h"
#include "core/model/fields.h"
#include "core/system/names.h"

namespace tg {

// Which texture terms apply. Bit sets: rgba = alpha | rgb. Values equal kMode* of shaders/shared/limits.h.
enum class TextureMode : unsigned { none = 0, alpha = 1, rgb = 2, rgba = 3 };
constexpr auto namesOf(TextureMode) { return enumNames("none", "alpha", "rgb", "rgba"); }
// What holds both.
constexpr TextureMode operator|(TextureMode a, TextureMode b) {
  return static_cast<TextureMode>(static_cast<unsigned>(a) | static_cast<unsigned>(b));
}
// Where a ray meets a Gaussian (docs/math.md 2). Values equal kIntersect*.
enum class IntersectionModel : unsigned { plane = 0, maxResponse = 1 };
constexpr auto namesOf(IntersectionModel) { return enumNames("plane", "maxResponse"); }
// What is drawn of a Gaussian with a texture beyond +-3 sigma: its base alone, nothing, or the texels of the border
// (docs/math.md 3). Values equal kOutside*.
enum class TextureOutside : unsigned { base = 0, clip = 1, edge = 2 };
constexpr auto namesOf(TextureOutside) { return enumNames("base", "clip", "edge"); }

constexpr std::size_t shCountOf(int degree) { return static_cast<std::size_t>((degree + 1) * (degree + 1)); }

// World space: as the data set's, COLMAP axes (x right, y down, z forward for an identity camera).
struct GaussianModel : GaussianFields<Values> {
  int sh_degree = 0;  // 0..3
  TextureMode texture_mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  TextureOutside outside = TextureOutside::base;
  TextureAtlas atlas;  // atlas.rects empty or [N]

  std::size_t size() const { return mean.size(); }
  std::size_t shCount() const { return shCountOf(sh_degree); }  // K of GaussianFields
  bool operator==(const GaussianModel&) const = default;
};

// Whether a quaternion has a length that floats can divide by.
inline bool hasLength(const glm::vec4& quaternion) {
  const float squared = glm::dot(quaternion, quaternion);
  return squared > 0.0f && std::isfinite(squared);
}
// Whether every array is as long as size(), shCount() and the atlas say: what functions that take a model assert.
bool lengthsAgree(const GaussianModel& model);

// Throws Error(badData, path, ...) naming the first Gaussian and member that breaks a promise above: lengths, finite
// values, quaternion length > 0, rectangles inside texels. What every reader calls before it returns.
void checkModel(const GaussianModel& model, const std::string& path);

}  // namespace tg
