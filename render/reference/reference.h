// SPDX-License-Identifier: Apache-2.0
// The oracle: float64, every Gaussian against every pixel, one formula a line. Every other renderer is tested against
// it, and it against the published numbers. Slow by intent; independent of shaders/shared by intent.
#pragma once
#include <span>
#include <vector>

#include "render/renderer.h"

namespace tg {

// GaussianModel in double precision: finite differences need parameters finer than float.
struct ReferenceModel : ModelFields<DoubleValues> {
  int sh_degree = 0;
  TextureMode texture_mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  TextureOutside outside = TextureOutside::base;
  std::vector<TextureRect> rects;  // empty or [N]

  ReferenceModel() = default;
  explicit ReferenceModel(const GaussianModel& model);
  std::size_t size() const { return mean.size(); }
  std::size_t shCount() const { return shCountOf(sh_degree); }
};

// One blended contribution at one pixel, front to back.
struct ReferenceHit {
  std::uint32_t gaussian = 0;
  double t = 0, u = 0, v = 0, value = 0;  // camera z, sigma, sigma, G in (0, 1]
  double texel_u = 0, texel_v = 0;        // texel coordinates (ut, vt); 0 where no texel is sampled
  double texture_alpha = 1;               // a_tex
  glm::dvec3 base{0.0}, texture{0.0};
  double texel_density = 0;             // [texels / px] of the splat, at its mean
  double alpha = 0, transmittance = 1;  // transmittance before this hit
};

// `cutoffs` off replaces the alpha cut at 1/255 and the transmittance stop by nothing, for finite differences of a
// smooth function; both are on in every image.
struct ReferenceOptions {
  bool cutoffs = true;
  // GradientOptions' ablations; off, the gradient is no longer that of the picture.
  bool texture_to_geometry = true;
  bool texture_in_suffix = true;
};

FrameT<double> renderReference(const ReferenceModel& model, const Camera& camera, const RenderSettings& settings,
                               const ReferenceOptions& options = {});
std::vector<ReferenceHit> traceReference(const ReferenceModel& model, const Camera& camera,
                                         const RenderSettings& settings, double pixel_x, double pixel_y,
                                         const ReferenceOptions& options = {});

// dL/d(parameter) of every parameter as stored (raw quaternion, log scale, logit), same shapes as the model.
struct ReferenceGradient : ModelFields<DoubleValues> {
  std::vector<glm::dvec2> screen;  // [N] sum over pixels of e_j, dL / d(mean in NDC) (docs/math.md 6.9)
  std::vector<double> screen_abs;  // [N] sum over pixels of |e_j|
};
// v_color: dL/d(picture), [height * width]. Analytic, by docs/math.md 6.
ReferenceGradient backwardReference(const ReferenceModel& model, const Camera& camera, const RenderSettings& settings,
                                    std::span<const glm::dvec3> v_color, const ReferenceOptions& options = {});

}  // namespace tg
