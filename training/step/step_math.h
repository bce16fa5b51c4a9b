// SPDX-License-Identifier: Apache-2.0
// The arithmetic of a training step that the CPU and CUDA share, one Gaussian, float or pixel at a time.
#pragma once
#include <cstdint>

#include "core/model/verbs.h"
#include "shared/splat.h"
#include "core/system/random.h"

namespace tg {

constexpr std::int64_t kGaussiansPerTask = 1024;

// ---- Adam (Kingma and Ba 2015)
constexpr float kBeta1 = 0.9f;
constexpr float kBeta2 = 0.999f;
constexpr float kAdamEpsilon = 1e-15f;
// Moments of Gaussians that no view sees decay into denormals, which cost 100 times a normal operation: cut to zero.
constexpr float kTinyMoment = 1e-30f;
constexpr float kTinySquare = 1e-37f;  // lower: of gradients of 1e-15, and Adam's epsilon, it holds a thousandth

struct AdamScales {
  float correction1;  // 1 / (1 - beta1^t)
  float correction2;  // 1 / sqrt(1 - beta2^t)
};

TG_FN void adamUpdate(float& value, float g, float& first, float& second, float rate, AdamScales scales) {
  const float m = kBeta1 * first + (1 - kBeta1) * g;
  const float v = kBeta2 * second + (1 - kBeta2) * g * g;
  first = std::abs(m) < kTinyMoment ? 0.0f : m;
  second = v < kTinySquare ? 0.0f : v;
  value -= rate * (m * scales.correction1) / (sqrt(v) * scales.correction2 + kAdamEpsilon);
}

// ---- Texels (docs/math.md 9d)
// What `decay` leaves of the distance from no change: channels 0 to 2 are colour, 3 is alpha.
TG_FN float decayedTexel(float value, unsigned channel, float decay) {
  const float neutral = channel == 3 ? 1.0f : 0.0f;
  return value - decay * (value - neutral);
}

// ---- 3D filter (docs/math.md 8)
// Above it 1 - opacity is all rounding; below the least, the logit leaves float.
constexpr double kMostOpacity = 1 - 1e-6;
constexpr double kLeastOpacity = 1e-30;

struct FilterShare {
  glm::dvec3 kept;  // sigma^2 / sigma_eff^2 of each stored axis
  int shortest;
  double compensation;  // the effective opacity's factor
};
TG_FN FilterShare filterShare(glm::vec3 log_scale, double min_sigma) {
  FilterShare share;
  const glm::dvec3 variance = glm::exp(2.0 * glm::dvec3(log_scale));
  share.kept = variance / (variance + min_sigma * min_sigma);
  share.shortest = shortestAxis(log_scale);
  share.compensation = sqrt(share.kept[axisU(share.shortest)] * share.kept[axisV(share.shortest)]);
  return share;
}

// What is drawn (8a).
struct EffectiveGaussian {
  glm::vec3 log_scale;
  float opacity_logit;
};
TG_FN EffectiveGaussian effectiveGaussian(glm::vec3 log_scale, float opacity_logit, float min_sigma) {
  const FilterShare share = filterShare(log_scale, min_sigma);
  const double opacity = clamp(sigmoid(opacity_logit) * share.compensation, kLeastOpacity, kMostOpacity);
  return {glm::vec3(glm::dvec3(log_scale) - 0.5 * glm::log(share.kept)),
          static_cast<float>(log(opacity / (1 - opacity)))};
}

// From gradients with respect to the effective parameters to those of the stored ones (8b, 8c), in place.
TG_FN void filterGradientOf(glm::vec3 log_scale, float opacity_logit, float min_sigma, glm::vec3& v_log_scale,
                            float& v_opacity_logit) {
  const FilterShare share = filterShare(log_scale, min_sigma);
  const double opacity = min(sigmoid(opacity_logit), double{kMostOpacity});
  const double effective = opacity * share.compensation;
  // v_effective_logit / (1 - effective) = dL/d ln(effective opacity).
  const double v_log_opacity = v_opacity_logit / (1 - effective);
  for (int axis = 0; axis < 3; ++axis) {
    double v = v_log_scale[axis] * share.kept[axis];
    if (axis != share.shortest) v += v_log_opacity * (1 - share.kept[axis]);
    v_log_scale[axis] = static_cast<float>(v);
  }
  v_opacity_logit = static_cast<float>(v_log_opacity * (1 - opacity));
}

// ---- Markov chain Monte Carlo (docs/math.md 9)
// Adds the gradients of opacity_weight * opacity and scale_weight * mean sigma.
TG_FN void addRegularizerGradientOf(glm::vec3 log_scale, float opacity_logit, double opacity_weight,
                                    double scale_weight, glm::vec3& v_log_scale, float& v_opacity_logit) {
  const double opacity = sigmoid(opacity_logit);
  v_opacity_logit += static_cast<float>(opacity_weight * opacity * (1 - opacity));
  v_log_scale += static_cast<float>(scale_weight / 3) * glm::exp(log_scale);
}

// What (9c) adds to the mean of Gaussian `index`.
TG_FN glm::vec3 explorationNoise(glm::vec4 rotation_quaternion, glm::vec3 log_scale, float opacity_logit,
                                 float strength, std::uint64_t seed, int iteration, std::uint64_t index) {
  constexpr double kSteepness = 100;
  constexpr double kMiddle = 0.005;
  constexpr double kNegligible = 1e-7;  // of the noise of a Gaussian about to die
  const double gate = sigmoid(-kSteepness * (sigmoid(opacity_logit) - kMiddle));
  if (gate < kNegligible) return glm::vec3(0.0f);
  Random random(Random(seed + static_cast<std::uint64_t>(iteration) * 0x9e3779b97f4a7c15u).bits() ^
                index * 0xd1342543de82ef95u);
  const glm::mat3 rotation = rotationFromQuaternion(rotation_quaternion);
  const double x = random.normal();
  const double y = random.normal();
  const glm::vec3 local = glm::transpose(rotation) * glm::vec3(x, y, random.normal());
  const glm::vec3 variance = glm::exp(2.0f * log_scale);
  return static_cast<float>(strength * gate) * (rotation * (variance * local));
}

// ---- SSIM (docs/math.md 7)
constexpr int kSsimRadius = 5;
constexpr int kSsimTaps = 2 * kSsimRadius + 1;
constexpr float kSsimC1 = 1e-4f;  // (0.01 * peak)^2
constexpr float kSsimC2 = 9e-4f;  // (0.03 * peak)^2

struct SsimWindow {
  float weights[kSsimTaps];  // Gaussian of sigma 1.5, sum 1
};
SsimWindow makeSsimWindow();

// From blurred x, y, x^2, y^2 and xy: SSIM (7c) and its derivatives with respect to the first, third and fifth (7d).
struct SsimPixel {
  float value, v_mean, v_variance, v_covariance;
};
TG_FN SsimPixel ssimPixel(float m1, float m2, float e11, float e22, float e12) {
  const float s1 = e11 - m1 * m1;
  const float s2 = e22 - m2 * m2;
  const float s12 = e12 - m1 * m2;
  const float a1 = 2 * m1 * m2 + kSsimC1;
  const float a2 = 2 * s12 + kSsimC2;
  const float b1 = m1 * m1 + m2 * m2 + kSsimC1;
  const float b2 = s1 + s2 + kSsimC2;
  const float inv = 1 / (b1 * b2);
  const float value = a1 * a2 * inv;
  // The variance and covariance terms hold -m1^2 and -m1 m2: their share is in v_mean.
  return {value, 2 * inv * (m2 * (a2 - a1) - m1 * value * (b2 - b1)), -value / b2, 2 * a1 * inv};
}

// dL/dx of a pixel from the blurred derivatives (7e); the weights are over the number of values.
TG_FN float lossGradientOf(float x, float y, float g_mean, float g_variance, float g_covariance, float l1_weight,
                           float ssim_weight) {
  const float difference = x - y;
  const float sign = static_cast<float>(difference > 0) - static_cast<float>(difference < 0);
  return l1_weight * sign - ssim_weight * (g_mean + 2 * x * g_variance + y * g_covariance);
}

}  // namespace tg
