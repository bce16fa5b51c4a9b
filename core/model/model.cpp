// SPDX-License-Identifier: Apache-2.0
// The promises a model keeps.
#include "core/model/model.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "core/system/error.h"
#include "core/system/parallel.h"
#include "shared/limits.h"

namespace tg {
namespace {

static_assert(static_cast<unsigned>(TextureMode::alpha) == kModeAlpha);
static_assert(static_cast<unsigned>(TextureMode::rgb) == kModeRgb);
static_assert(static_cast<unsigned>(TextureMode::rgba) == kModeRgba);
static_assert(static_cast<unsigned>(IntersectionModel::plane) == kIntersectPlane);
static_assert(static_cast<unsigned>(IntersectionModel::maxResponse) == kIntersectMaxResponse);
static_assert(static_cast<unsigned>(TextureOutside::base) == kOutsideBase);
static_assert(static_cast<unsigned>(TextureOutside::clip) == kOutsideClip);
static_assert(static_cast<unsigned>(TextureOutside::edge) == kOutsideEdge);

bool isFinite(float v) { return std::isfinite(v); }
bool isFinite(const glm::vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }
bool isFinite(const glm::vec4& v) { return isFinite(glm::vec3(v)) && std::isfinite(v.w); }

void checkLength(std::size_t found, std::size_t expected, const char* member, const std::string& path) {
  if (found == expected) return;
  throw Error(ErrorKind::badData, path, std::string("wrong length of ") + member + expectedFound(expected, found));
}

// The first promise Gaussian i breaks; "" when it keeps them all.
std::string brokenPromise(const GaussianModel& model, std::size_t i, bool with_texels = true) {
  std::string broken;
  forEachField(
      [&]<typename T>(const Field& field, const std::vector<T>& all) {
        const std::size_t count = field.values(model.shCount());
        for (std::size_t k = 0; k < count && broken.empty(); ++k) {
          const T& value = all[i * count + k];
          if (!isFinite(value)) {
            broken = field.name + (field.harmonic ? " coefficient " + std::to_string(k) : "") + " is not finite";
          } else if constexpr (std::is_same_v<T, glm::vec4>) {
            if (field.quaternion && !hasLength(value)) {
              broken = std::string(field.name) +
                       " has no usable length (expected a quaternion of a length from 1e-22 to 1e19)";
            }
          }
        }
      },
      model);
  if (!broken.empty()) return broken;
  if (model.atlas.rects.empty()) return "";
  const TextureRect& rect = model.atlas.rects[i];
  if ((rect.width == 0) != (rect.height == 0)) {
    return "texture rectangle has one empty side (found " + std::to_string(rect.width) + " x " +
           std::to_string(rect.height) + ")";
  }
  const std::uint64_t end = std::uint64_t{rect.offset} + rect.texelCount();
  if (rect.texelCount() > 0 && end > model.atlas.texels.size()) {
    return "texture rectangle leaves the atlas (ends at texel " + std::to_string(end) + " of " +
           std::to_string(model.atlas.texels.size()) + ")";
  }
  for (std::uint32_t t = 0; with_texels && t < rect.texelCount(); ++t) {
    const glm::vec4& texel = model.atlas.texels[rect.offset + t];
    if (!isFinite(texel)) return "texel " + std::to_string(t) + " is not finite";
    if (texel.a < 0.0f || texel.a > 1.0f) {
      return "texel " + std::to_string(t) + " has an alpha outside [0, 1] (found " + std::to_string(texel.a) + ")";
    }
  }
  return "";
}

}  // namespace

bool lengthsAgree(const GaussianModel& model) {
  bool agree = model.sh_degree >= 0 && model.sh_degree <= 3 &&
               (model.atlas.rects.empty() || model.atlas.rects.size() == model.size());
  const auto check = [&](const Field& field, const auto& values) {
    agree = agree && values.size() == model.size() * field.values(model.shCount());
  };
  forEachField(check, model);
  return agree;
}

void checkModel(const GaussianModel& model, const std::string& path) {
  if (model.sh_degree < 0 || model.sh_degree > 3) {
    throw Error(ErrorKind::badData, path,
                "wrong SH degree (expected 0 to 3, found " + std::to_string(model.sh_degree) + ")");
  }
  const std::size_t n = model.size();
  forEachField(
      [&](const Field& field, const auto& values) {
        checkLength(values.size(), n * field.values(model.shCount()), field.name, path);
      },
      model);
  if (!model.atlas.rects.empty()) checkLength(model.atlas.rects.size(), n, "atlas.rects", path);

  // Several Gaussians may have one texture: where all texels are sound none is looked at again.
  std::atomic<bool> sound{true};
  constexpr std::size_t many = 1 << 16;
  const std::vector<glm::vec4>& texels = model.atlas.texels;
  parallelFor(static_cast<std::int64_t>((texels.size() + many - 1) / many), 1, [&](std::int64_t b) {
    const std::size_t begin = static_cast<std::size_t>(b) * many;
    for (std::size_t i = begin; i < std::min(texels.size(), begin + many); ++i) {
      if (isFinite(texels[i]) && texels[i].a >= 0.0f && texels[i].a <= 1.0f) continue;
      sound = false;
      return;
    }
  });
  // Blocks report the first offender each, so the message does not depend on the thread count.
  constexpr std::size_t block = 4096;
  constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> offender((n + block - 1) / block, none);
  parallelFor(static_cast<std::int64_t>(offender.size()), 1, [&](std::int64_t b) {
    const std::size_t begin = static_cast<std::size_t>(b) * block;
    for (std::size_t i = begin; i < std::min(n, begin + block); ++i) {
      if (brokenPromise(model, i, !sound).empty()) continue;
      offender[static_cast<std::size_t>(b)] = i;
      return;
    }
  });
  for (std::size_t i : offender) {
    if (i != none) {
      throw Error(ErrorKind::badData, path, "Gaussian " + std::to_string(i) + ": " + brokenPromise(model, i));
    }
  }
}

}  // namespace tg
