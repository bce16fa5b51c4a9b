// SPDX-License-Identifier: Apache-2.0
// A Gaussian meets a camera: the splat record, its exact screen box, and the ray-Gaussian intersection.
//
// A ray through pixel (x, y) has the camera-space direction d_c = ((x-cx)/fx, (y-cy)/fy, 1), so its parameter t is the
// camera z. In the Gaussian's local frame, in units of sigma, it reads o + t d (docs/math.md 2). With the pixel offset
// (dx, dy) from the projected mean,
//     D(dx, dy) = d0 + dx_ * dx + dy_ * dy          the local direction d, d0 = -o / z
//     W(dx, dy) = o x d = wx * dx + wy * dy         (the mean's own ray passes through the mean: no constant term)
// Both intersection models follow from W and D without the cancellation of o + t d:
//     max response: p = (D x W) / |D|^2,  |p|^2 = |W|^2 / |D|^2,  t = z (d0 . D) / |D|^2
//     plane c = 0:  p = (-W_b, W_a, 0) / D_c,                      t = z d0_c / D_c
#ifndef TG_SPLAT_H
#define TG_SPLAT_H
#include "shared/layout.h"
#include "shared/limits.h"
TG_NAMESPACE_BEGIN

// Columns are the Gaussian's local axes in world space. q = (w, x, y, z), any length > 0.
TG_FN mat3 rotationFromQuaternion(vec4 q) {
  // A power of two, so that no bit changes: devices may take squares of short ones for 0.
  q = q * (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w < 1e-20f ? 18446744073709551616.0f : 1.0f);
  float s = 1.0f / sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  float w = q.x * s;
  float x = q.y * s;
  float y = q.z * s;
  float z = q.w * s;
  return mat3(vec3(1.0f - 2.0f * (y * y + z * z), 2.0f * (x * y + w * z), 2.0f * (x * z - w * y)),
              vec3(2.0f * (x * y - w * z), 1.0f - 2.0f * (x * x + z * z), 2.0f * (y * z + w * x)),
              vec3(2.0f * (x * z + w * y), 2.0f * (y * z - w * x), 1.0f - 2.0f * (x * x + y * y)));
}

// The axis dropped from the texture plane: the smallest scale, the lowest index on ties. u and v are the other two in
// index order (docs/math.md 2.2).
TG_FN int shortestAxis(vec3 scale) {
  int c = 0;
  if (scale.y < scale.x) c = 1;
  if (scale.z < (c == 0 ? scale.x : scale.y)) c = 2;
  return c;
}
TG_FN int axisU(int c) { return c == 0 ? 1 : 0; }
TG_FN int axisV(int c) { return c == 2 ? 1 : 2; }

// Sigmas as they are drawn (docs/math.md 1.1).
TG_FN vec3 drawnScale(vec3 scale) {
  float longest = min(max(scale.x, max(scale.y, scale.z)), kScaleMax);
  float shortest = kThinnest * longest;
  return vec3(clamp(scale.x, shortest, longest), clamp(scale.y, shortest, longest), clamp(scale.z, shortest, longest));
}

// Radius [sigma] beyond which alpha = opacity * exp(-r^2/2) < kAlphaMin whatever the texture says (alpha texels are at
// most 1). Not positive: the splat can never be seen. The factor keeps pixels on the rim inside against rounding.
TG_FN float visibleRadius(float opacity) {
  float v = 2.0f * log(opacity / kAlphaMin);
  return v > 0.0f ? sqrt(v) * 1.0002f : 0.0f;
}

// Bounds of one normalised image coordinate (x/z or y/z) of an ellipsoid Sigma = L L^T around (m, z), seen from the
// origin: the exact tangent cone (docs/math.md 4). lm, lz: the rows of L for that coordinate and for z.
// Returns false when the ellipsoid touches the plane z = 0, where every coordinate is possible, and when it is too wide
// for squares in float.
TG_FN bool tangentBounds(float m, float z, vec3 lm, vec3 lz, TG_OUT(vec2) bounds) {
  float c = m / z;
  float inv_z = 1.0f / z;  // all in units of z: of products of four lengths float holds few
  vec3 slope = inv_z * lz;
  vec3 e = inv_z * lm - c * slope;
  float denominator = 1.0f - dot(slope, slope);
  bounds = vec2(c, c);
  float ee = dot(e, e);
  if (z <= 0.0f || denominator <= 1e-6f || !(ee < 1e30f)) return false;
  vec3 ez = cross(e, slope);
  float disc = ee - dot(ez, ez);
  float root = sqrt(max(disc, 0.0f));
  float mid = -dot(e, slope);
  bounds = vec2(c + (mid - root) / denominator, c + (mid + root) / denominator);
  return true;
}

// Builds the record of a Gaussian whose mean lies at camera-space `mean_c` with mean_c.z > kNear.
// axes_c: columns = local axes in camera space, already ordered (a, b, c); scale ordered alike, all > 0.
// Texture fields are left 0. focal_center: fx, fy, cx, cy [px].
TG_FN Splat makeSplat(vec3 mean_c, mat3 axes_c, vec3 scale, vec4 focal_center, float opacity, vec3 base) {
  float inv_z = 1.0f / mean_c.z;
  float cx = mean_c.x * inv_z;
  float cy = mean_c.y * inv_z;
  vec3 inv_scale = vec3(1.0f / scale.x, 1.0f / scale.y, 1.0f / scale.z);
  // Columns of M = diag(1/s) A^T: how each camera axis looks in the local frame.
  vec3 mx = inv_scale * vec3(axes_c[0].x, axes_c[1].x, axes_c[2].x);
  vec3 my = inv_scale * vec3(axes_c[0].y, axes_c[1].y, axes_c[2].y);
  vec3 mz = inv_scale * vec3(axes_c[0].z, axes_c[1].z, axes_c[2].z);
  vec3 d0 = cx * mx + cy * my + mz;
  vec3 dx = mx * (1.0f / focal_center.x);
  vec3 dy = my * (1.0f / focal_center.y);
  vec3 o = -mean_c.z * d0;
  vec3 wx = cross(o, dx);
  vec3 wy = cross(o, dy);
  Splat s;
  s.center_depth_opacity =
      vec4(cx * focal_center.x + focal_center.z, cy * focal_center.y + focal_center.w, mean_c.z, opacity);
  s.wx_r = vec4(wx, base.x);
  s.wy_g = vec4(wy, base.y);
  s.dx_b = vec4(dx, base.z);
  s.dy_offset = vec4(dy, 0.0f);
  s.d0_size = vec4(d0, 0.0f);
  return s;
}

// Columns: the rows x, y and z of L, Sigma = L L^T, of the ellipsoid at `radius` [sigma]; flat_c: without its extent
// along c.
TG_FN mat3 ellipsoidRows(mat3 axes_c, vec3 scale, float radius, bool flat_c) {
  vec3 r = radius * scale;
  if (flat_c) r.z = 0.0f;
  return mat3(r * vec3(axes_c[0].x, axes_c[1].x, axes_c[2].x), r * vec3(axes_c[0].y, axes_c[1].y, axes_c[2].y),
              r * vec3(axes_c[0].z, axes_c[1].z, axes_c[2].z));
}

// splatBox() of given rows; bx and by are its bounds as tangentBounds() has them.
TG_FN bool rowsBox(vec3 mean_c, mat3 rows, vec4 focal_center, TG_OUT(vec2) bx, TG_OUT(vec2) by, TG_OUT(vec4) box) {
  bool ok_x = tangentBounds(mean_c.x, mean_c.z, rows[0], rows[2], bx);
  bool ok_y = tangentBounds(mean_c.y, mean_c.z, rows[1], rows[2], by);
  box = vec4(bx.x * focal_center.x + focal_center.z, by.x * focal_center.y + focal_center.w,
             bx.y * focal_center.x + focal_center.z, by.y * focal_center.y + focal_center.w);
  return ok_x && ok_y;
}

// Screen box [px] (x0, y0, x1, y1) of everything a splat can draw, not clipped to the image. flat_c: the plane model,
// where the extent along c does not count. Returns false when the box is unbounded (cover the whole screen).
TG_FN bool splatBox(vec3 mean_c, mat3 axes_c, vec3 scale, float radius, bool flat_c, vec4 focal_center,
                    TG_OUT(vec4) box) {
  vec2 bx;
  vec2 by;
  return rowsBox(mean_c, ellipsoidRows(axes_c, scale, radius, flat_c), focal_center, bx, by, box);
}

// Screen-space low-pass (docs/math.md 1.4): the wider sigmas of a Gaussian whose mean lies at camera z `z`. focal: the
// larger of fx and fy [px].
TG_FN vec3 antialiasedScale(vec3 scale, float z, float focal) {
  float pixel = z / focal;
  float add = kScreenVariance * pixel * pixel;
  return vec3(sqrt(scale.x * scale.x + add), sqrt(scale.y * scale.y + add), sqrt(scale.z * scale.z + add));
}
// The factor on the opacity that goes with it. Scales ordered (a, b, c); length_before, length_after: |d0| of the two.
TG_FN float antialiasedOpacity(vec3 scale, vec3 wider, float length_before, float length_after, bool flat_c) {
  float flat_part = (scale.x / wider.x) * (scale.y / wider.y);
  return flat_c ? flat_part : flat_part * (scale.z / wider.z) * (length_before / length_after);
}

// [texels / px] of a texture of size_u x size_v texels at the splat's mean (docs/math.md 3.1).
TG_FN float texelDensity(vec3 wx, vec3 wy, vec3 d0, uint size_u, uint size_v, uint model) {
  vec2 across;
  vec2 down;
  if (model == kIntersectPlane) {
    if (d0.z == 0.0f) return 0.0f;
    float inv = 1.0f / d0.z;
    across = vec2(-wx.y * inv, wx.x * inv);
    down = vec2(-wy.y * inv, wy.x * inv);
  } else {
    float inv = 1.0f / dot(d0, d0);
    across = vec2((d0.y * wx.z - d0.z * wx.y) * inv, (d0.z * wx.x - d0.x * wx.z) * inv);
    down = vec2((d0.y * wy.z - d0.z * wy.y) * inv, (d0.z * wy.x - d0.x * wy.z) * inv);
  }
  float area = across.x * down.y - across.y * down.x;
  float texels = float(size_u - 1u) * float(size_v - 1u) / (4.0f * kTextureExtent * kTextureExtent);
  return sqrt(texels * max(area, -area));
}
// The share of the texture's mean in every sample of a splat under the footprint filter.
TG_FN float footprintShare(float texel_density) {
  return texel_density <= 1.0f ? 0.0f : min(log(texel_density) * 1.4426950408889634f, 1.0f);
}

// Where a pixel's ray meets a splat.
struct Hit {
  vec2 uv;     // [sigma] along a and b
  float power; // Mahalanobis distance squared; the Gaussian's value is exp(-power / 2)
  float t;     // camera z of the hit
};

// False: no hit (behind the near plane, or the ray lies in the plane). delta: pixel minus projected mean [px].
TG_FN bool intersectSplat(vec3 wx, vec3 wy, vec3 dx, vec3 dy, vec3 d0, float depth, uint model, vec2 delta,
                          float near, TG_OUT(Hit) hit) {
  vec3 w = wx * delta.x + wy * delta.y;
  vec3 d = d0 + dx * delta.x + dy * delta.y;
  hit.uv = vec2(0.0f, 0.0f);
  hit.power = 0.0f;
  hit.t = 0.0f;
  if (model == kIntersectPlane) {
    if (d.z == 0.0f) return false;
    float inv = 1.0f / d.z;
    hit.uv = vec2(-w.y * inv, w.x * inv);
    hit.power = hit.uv.x * hit.uv.x + hit.uv.y * hit.uv.y;
    hit.t = depth * d0.z * inv;
  } else {
    float inv = 1.0f / dot(d, d);
    hit.uv = vec2((d.y * w.z - d.z * w.y) * inv, (d.z * w.x - d.x * w.z) * inv);
    hit.power = dot(w, w) * inv;
    hit.t = depth * dot(d0, d) * inv;
  }
  return hit.t > near;
}

TG_NAMESPACE_END
#endif
