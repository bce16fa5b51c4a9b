// SPDX-License-Identifier: Apache-2.0
// What every room does with models.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <span>
#include <vector>

#include "core/model/model.h"
#include "core/system/assert.h"
#include "shared/lang.h"

namespace tg {

// times / (1 + exp(-x)), rounded as that quotient is.
TG_FN double sigmoid(double x, double times = 1.0) { return times / (1.0 + exp(-x)); }
// In float, for what is drawn: its last bits differ from the other's.
TG_FN float sigmoidf(float x) { return 1.0f / (1.0f + exp(-x)); }

constexpr double kLogitLimit = 20.0;  // opacities 0 and 1 have no logit; 2e-9 from them, below a float's step at 1
// opacity in [0, 1].
inline float logitFromOpacity(double opacity) {
  return static_cast<float>(std::clamp(std::log(opacity) - std::log1p(-opacity), -kLogitLimit, kLogitLimit));
}

inline double opacityOf(const GaussianModel& model, std::size_t i) { return sigmoid(model.opacity_logit[i]); }
// Columns: the directions of the local axes.
inline glm::dmat3 axesOf(const GaussianModel& model, std::size_t i) {
  const glm::vec4 q = model.rotation[i];
  return glm::mat3_cast(glm::normalize(glm::dquat(q.x, q.y, q.z, q.w)));
}
// [world units] along them.
inline glm::dvec3 sigmaOf(const GaussianModel& model, std::size_t i) {
  return glm::exp(glm::dvec3(model.log_scale[i]));
}
// Empty where Gaussian i has no texture.
inline TextureRect rectOf(const GaussianModel& model, std::size_t i) {
  return model.atlas.rects.empty() ? TextureRect{} : model.atlas.rects[i];
}
inline bool hasColor(TextureMode mode) { return mode == TextureMode::rgb || mode == TextureMode::rgba; }
inline bool hasAlpha(TextureMode mode) { return mode == TextureMode::alpha || mode == TextureMode::rgba; }
// Whether pictures may show texels.
inline bool isTextured(const GaussianModel& model) {
  return model.texture_mode != TextureMode::none && !model.atlas.rects.empty();
}

// Terms that the mode lacks become numbers without effect.
void neutralize(std::span<glm::vec4> texels, TextureMode mode);

// Numbers that training chose: of texels those that the mode uses, of textures that Gaussians share each once.
std::size_t parameterCount(const GaussianModel& model);
// Of the arrays of numbers.
std::uint64_t bytesOf(const GaussianModel& model);

// Gaussians [0, n), new ones all zeros; textures stay as they are. The degree of a model with Gaussians must stay.
void resizeGaussians(GaussianModel& model, std::size_t n, int sh_degree);
// Coefficients that come are zero. Throws Error(usage) for a degree outside [0, 3].
void setShDegree(GaussianModel& model, int degree);
// Gaussian j of the result is Gaussian source[j] with its texture; the texels, not more than offsets reach, lie in that
// order.
GaussianModel select(const GaussianModel& model, std::span<const std::uint32_t> source);
// Puts the Gaussians of another model of the same SH degree behind those of `model`, with the textures of both.
void append(GaussianModel& model, const GaussianModel& other);
GaussianModel withoutTextures(const GaussianModel& model);
// For whoever waits for a model: at most `most` >= 1 of the first `ready` Gaussians, spread evenly, wide enough to
// stand for all of them, without textures.
GaussianModel thinned(const GaussianModel& model, std::size_t ready, std::size_t most);

// Rows of `length` values: row j is row source[j] of `rows`, from row `kept` on zeros.
template <typename T>
std::vector<T> gathered(const std::vector<T>& rows, std::size_t length, std::span<const std::uint32_t> source,
                        std::size_t kept) {
  TG_ASSERT(kept <= source.size(), "no more rows are kept than there are");
  std::vector<T> result(source.size() * length);
  for (std::size_t j = 0; j < kept; ++j) {
    std::copy_n(rows.data() + source[j] * length, length, result.data() + j * length);
  }
  return result;
}
// Rows of `from` values become rows of `to`, cut or with zeros behind.
template <typename T>
std::vector<T> withRowLength(const std::vector<T>& rows, std::size_t from, std::size_t to) {
  TG_ASSERT(from > 0, "a row has values");
  const std::size_t count = rows.size() / from;
  std::vector<T> result(count * to, T{});
  for (std::size_t i = 0; i < count; ++i) {
    std::copy_n(rows.data() + i * from, std::min(from, to), result.data() + i * to);
  }
  return result;
}

}  // namespace tg
