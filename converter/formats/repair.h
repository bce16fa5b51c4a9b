// SPDX-License-Identifier: Apache-2.0
// What splat files hold that no model does: scales without a logarithm, numbers that are not finite, quaternions of
// length 0.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/glm.hpp>
#include <limits>
#include <string>
#include <vector>

#include "core/model/model.h"

namespace tg {

constexpr float kZeroScaleFraction =
    1e-4f;                             // a scale of 0 has no logarithm: this part of the smallest other one instead
constexpr float kPointScale = 1e-10f;  // [world units] when all three are 0

// scale >= 0.
inline glm::vec3 logFromScale(glm::vec3 scale) {
  float smallest = 0.0f;
  for (int k = 0; k < 3; ++k) {
    if (scale[k] > 0.0f && (smallest == 0.0f || scale[k] < smallest)) smallest = scale[k];
  }
  const float zero = std::max(smallest * kZeroScaleFraction, kPointScale);
  glm::vec3 log_scale;
  for (int k = 0; k < 3; ++k) {
    log_scale[k] = static_cast<float>(std::log(static_cast<double>(scale[k] > 0.0f ? scale[k] : zero)));
  }
  return log_scale;
}

constexpr double kMostScale = std::numeric_limits<float>::max();

// Clipped to what a float holds in full: readers take a scale of 0 for one that has no logarithm.
inline float scaleFromLog(float log_scale) {
  constexpr double kLeastScale = std::numeric_limits<float>::min();
  return static_cast<float>(std::clamp(std::exp(static_cast<double>(log_scale)), kLeastScale, kMostScale));
}
inline bool clipsScale(glm::vec3 log_scale) {
  return std::exp(static_cast<double>(std::max({log_scale.x, log_scale.y, log_scale.z}))) > kMostScale;
}

inline bool allFinite(glm::vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

// What a file of scales, not of their logarithms, says of where a splat lies.
struct LinearSplat {
  glm::vec3 mean{0.0f}, scale{0.0f};
  glm::vec4 rotation{0.0f};  // w, x, y, z, of any length
};

// The same where a file has logarithms: those of minus infinity are scales of 0.
inline glm::vec3 withoutZeroScales(glm::vec3 log_scale) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  float smallest = kInfinity;
  for (int k = 0; k < 3; ++k) {
    if (log_scale[k] > -kInfinity) smallest = std::min(smallest, log_scale[k]);
  }
  const float point = std::log(kPointScale);
  const float zero = smallest < kInfinity ? std::max(smallest + std::log(kZeroScaleFraction), point) : point;
  for (int k = 0; k < 3; ++k) {
    if (log_scale[k] == -kInfinity) log_scale[k] = zero;
  }
  return log_scale;
}

// A line where `count` splats were put right or clipped; `what` begins with "with".
inline void addSplatCount(std::vector<std::string>& lines, std::size_t count, const std::string& what) {
  if (count != 0) lines.push_back(std::to_string(count) + " splats " + what);
}

constexpr const char* kDroppedSplat = "with values that are not finite: dropped";
constexpr const char* kDirectionlessSplat = "with a quaternion of length 0: not turned";

// Puts such splats right, and counts what it did.
class LinearRepair {
 public:
  // False, and nothing done, for a splat to be dropped: a number, here or elsewhere, is not finite.
  bool mend(LinearSplat& splat, bool others_are_finite = true) {
    const glm::vec4& q = splat.rotation;
    if (!others_are_finite || !allFinite(splat.mean) || !allFinite(splat.scale) || !allFinite(glm::vec3(q)) ||
        !std::isfinite(q.w)) {
      ++dropped_;
      return false;
    }
    if (splat.scale.x < 0.0f || splat.scale.y < 0.0f || splat.scale.z < 0.0f) ++negative_;
    splat.scale = glm::abs(splat.scale);
    if (q == glm::vec4(0.0f)) {
      ++directionless_;
      splat.rotation.x = 1.0f;
    }
    return true;
  }
  void report(std::vector<std::string>& repairs) const {
    addSplatCount(repairs, dropped_, kDroppedSplat);
    addSplatCount(repairs, negative_, "with a negative scale: sign dropped");
    addSplatCount(repairs, directionless_, kDirectionlessSplat);
  }

 private:
  std::size_t dropped_ = 0, negative_ = 0, directionless_ = 0;
};

// Puts right what readSplatPly() calls broken. Infinite logits are opacities of 0 and 1 (kLogitLimit), log scales of
// minus infinity scales of 0, and a quaternion whose square no float holds keeps its direction; what has other numbers
// that are not finite is dropped. Throws Error(badData, path) where nothing is left.
void mendSplats(GaussianModel& model, const std::string& path, std::vector<std::string>& repairs);

}  // namespace tg
