// SPDX-License-Identifier: Apache-2.0
// A Gaussian of the model as the camera sees it, with the viewer's settings applied; for passes that bind the model.
#include "fetch.glsl"
#include "shared/splat.h"

FETCHED_VEC4S(0, MeanLogit, mean_logit);       // [N] mean, opacity logit
FETCHED_VEC4S(1, Rotation, rotation);          // [N] w, x, y, z
FETCHED_UVEC4S(2, ScaleOffset, scale_offset);  // [N] ln(sigma), texel offset

struct Gaussian {
  vec3 mean;    // world space
  vec3 mean_c;  // camera space
  mat3 axes_c;  // columns: local axes in camera space, ordered (a, b, c)
  vec3 scale;   // [world units] ordered alike
  float opacity;
};

// a + b and a * b and what rounding took from them (Dekker 1971), if nothing overflows.
float exactSum(float a, float b, out float rest) {
  precise float sum = a + b;
  precise float of_b = sum - a;
  precise float lost = (a - (sum - of_b)) + (b - of_b);
  rest = lost;
  return sum;
}
float exactProduct(float a, float b, out float rest) {
  precise float wide_a = 4097.0 * a;
  precise float high_a = wide_a - (wide_a - a);
  precise float low_a = a - high_a;
  precise float wide_b = 4097.0 * b;
  precise float high_b = wide_b - (wide_b - b);
  precise float low_b = b - high_b;
  precise float product = a * b;
  precise float lost = ((high_a * high_b - product) + high_a * low_b + low_a * high_b) + low_a * low_b;
  rest = lost;
  return product;
}

// The camera's z of a point, rounded once: splats are sorted by it, and those that lie close behind one another must
// not change places with the driver's way of rounding.
float cameraDepth(vec3 point) {
  precise float depth = 0.0;
  precise float rest = 0.0;
  for (int k = 0; k < 3; ++k) {
    float forward = view.camera_from_world[k].z;
    float offset_rest, product_rest, sum_rest;
    float offset = exactSum(point[k], -view.camera_position[k], offset_rest);
    float product = exactProduct(offset, forward, product_rest);
    depth = exactSum(depth, product, sum_rest);
    rest += sum_rest + product_rest + (offset_rest - view.position_rest[k]) * forward + offset * view.forward_rest[k];
  }
  return depth + rest;
}

// In world axes. The difference comes before any turn: far from the origin a matrix's translation would cancel.
vec3 fromCamera(vec3 point) { return point - view.camera_position.xyz - view.position_rest.xyz; }

// False: it cannot be seen.
bool loadGaussian(uint i, out Gaussian g) {
  vec4 mean = FETCH(mean_logit, i);
  g.mean = mean.xyz;
  g.mean_c = mat3(view.camera_from_world) * fromCamera(g.mean);
  g.mean_c.z = cameraDepth(g.mean);
  g.opacity = min(1.0, view.opacity_scale / (1.0 + exp(-mean.w)));
  vec3 log_scale = uintBitsToFloat(FETCH(scale_offset, i).xyz);
  vec3 scale = exp(log_scale);
  int c = shortestAxis(log_scale);  // exp() may turn two around
  int a = axisU(c);
  int b = axisV(c);
  mat3 axes = mat3(view.camera_from_world) * rotationFromQuaternion(FETCH(rotation, i));
  g.axes_c = mat3(axes[a], axes[b], axes[c]);
  g.scale = drawnScale(view.splat_scale * vec3(scale[a], scale[b], scale[c]));
  if (decider(view.antialiasing) != 0u) {
    vec3 narrow = max(g.scale, vec3(1e-35));
    float least = min(narrow.x, min(narrow.y, narrow.z));
    g.scale = antialiasedScale(narrow, g.mean_c.z, max(view.focal_center.x, view.focal_center.y));
    vec3 direction = transpose(g.axes_c) * (g.mean_c / g.mean_c.z);
    // In units of the least scale, so that nothing overflows.
    g.opacity *= antialiasedOpacity(narrow, g.scale, length(direction * (least / narrow)) / least,
                                    length(direction / g.scale), decider(view.intersection) == kIntersectPlane);
  }
  bool in_crop = decider(floatBitsToUint(view.crop_min.w)) == 0u || (all(greaterThanEqual(g.mean, view.crop_min.xyz)) &&
                                            all(lessThanEqual(g.mean, view.crop_max.xyz)));
  float longest = max(g.scale.x, max(g.scale.y, g.scale.z));
  // Antialiasing makes longer ones yet of what lies farther away than squares in float reach.
  return g.mean_c.z > view.near && in_crop && longest > kScaleMin && longest < 2.0 * kScaleMax;
}
