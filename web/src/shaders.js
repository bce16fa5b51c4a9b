// SPDX-License-Identifier: Apache-2.0
// Made from web/shaders and shaders/shared by web/shaders.cmake.

const LANG_H = `#ifndef TG_LANG_H
#define TG_LANG_H
#ifdef __cplusplus
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#ifdef __CUDACC__
#define TG_FN __host__ __device__ inline
#else
#define TG_FN inline
#endif
#define TG_OUT(T) T&
#define TG_INOUT(T) T&
#define TG_PRECISE
#define TG_CHECK_SIZE(T, bytes) static_assert(sizeof(T) == (bytes), #T " must match its std430 size");
namespace tg {
using glm::ivec2;
using glm::mat3;
using glm::mat4;
using glm::uvec2;
using glm::uvec4;
using glm::vec2;
using glm::vec3;
using glm::vec4;
using uint = std::uint32_t;
using glm::clamp;
using std::exp;
using std::floor;
using std::log;
using std::max;
using std::min;
using std::sqrt;
}
#define TG_NAMESPACE_BEGIN namespace tg {
#define TG_NAMESPACE_END }
#else
#define TG_FN
#define TG_OUT(T) out T
#define TG_INOUT(T) inout T
#define TG_PRECISE precise
#define TG_CHECK_SIZE(T, bytes)
#define TG_NAMESPACE_BEGIN
#define TG_NAMESPACE_END
#endif
#endif`;

const LAYOUT_H = `#ifndef TG_LAYOUT_H
#define TG_LAYOUT_H
${LANG_H}
TG_NAMESPACE_BEGIN
struct ViewUniforms {
  mat4 camera_from_world;
  vec4 camera_position;
  vec4 focal_center;
  vec4 background;
  uint width;
  uint height;
  uint tiles_x;
  uint tiles_y;
  uint gaussian_count;
  uint sh_degree;
  uint texture_mode;
  uint intersection;
  vec4 crop_min;
  vec4 crop_max;
  float opacity_scale;
  float splat_scale;
  float near;
  float exposure;
  uint sh_used;
  uint antialiasing;
  uint range_least;
  uint range_most;
  vec4 position_rest;
  vec4 forward_rest;
};
TG_CHECK_SIZE(ViewUniforms, 240)
struct Splat {
  vec4 center_depth_opacity;
  vec4 wx_r;
  vec4 wy_g;
  vec4 dx_b;
  vec4 dy_offset;
  vec4 d0_size;
};
TG_CHECK_SIZE(Splat, 96)
struct SplatRecord {
  vec4 center_depth_opacity;
  vec4 w_r;
  vec4 d_g;
  vec4 e_b;
  vec4 u_offset;
  vec4 v_size;
  vec4 normal;
  vec4 outline;
};
TG_CHECK_SIZE(SplatRecord, 128)
const uint kRecordSize = 8u;
TG_NAMESPACE_END
#endif`;

const LIMITS_H = `#ifndef TG_LIMITS_H
#define TG_LIMITS_H
${LANG_H}
TG_NAMESPACE_BEGIN
const uint kTileSize = 16u;
const uint kBlockBits = 16u;
const uint kMaxTiles = 65536u;
const float kAlphaMax = 0.99f;
const float kAlphaMin = 1.0f / 255.0f;
const float kTransmittanceStop = 1e-4f;
const float kNear = 0.2f;
const float kTextureExtent = 3.0f;
const float kScreenVariance = 0.1f;
const float kEllipsoidAmbient = 0.25f;
const float kCenterRadius = 1.5f;
const float kShC0 = 0.28209479177387814f;
const float kThinnest = 2e-9f;
const float kScaleMin = 1e-18f;
const float kScaleMax = 1e18f;
const uint kModeNone = 0u;
const uint kModeAlpha = 1u;
const uint kModeRgb = 2u;
const uint kModeRgba = 3u;
const uint kIntersectPlane = 0u;
const uint kIntersectMaxResponse = 1u;
const uint kOutsideBase = 0u;
const uint kOutsideClip = 1u;
const uint kOutsideEdge = 2u;
const uint kShapeSplats = 0u;
const uint kShapeEllipsoids = 1u;
const uint kShapeCenters = 2u;
const uint kSampleNone = 0u;
const uint kSampleBilinear = 1u;
const uint kSampleFootprint = 2u;
const float kFarthestGrey = 0.15f;
const float kLowestDensity = 1.0f / 64.0f;
const float kHighestDensity = 4.0f;
const uint kOutputFinal = 0u;
const uint kOutputBase = 1u;
const uint kOutputTexture = 2u;
const uint kOutputAlpha = 3u;
const uint kOutputDepth = 4u;
const uint kOutputNormal = 5u;
const uint kOutputCount = 6u;
const uint kOutputDepthMedian = 7u;
const uint kOutputOverdraw = 8u;
const uint kOutputEllipsoids = 9u;
const uint kOutputCenters = 10u;
const uint kOutputTexelDensity = 11u;
TG_NAMESPACE_END
#endif`;

const SPLAT_H = `#ifndef TG_SPLAT_H
#define TG_SPLAT_H
${LAYOUT_H}
${LIMITS_H}
TG_NAMESPACE_BEGIN
TG_FN mat3 rotationFromQuaternion(vec4 q) {
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
TG_FN int shortestAxis(vec3 scale) {
  int c = 0;
  if (scale.y < scale.x) c = 1;
  if (scale.z < (c == 0 ? scale.x : scale.y)) c = 2;
  return c;
}
TG_FN int axisU(int c) { return c == 0 ? 1 : 0; }
TG_FN int axisV(int c) { return c == 2 ? 1 : 2; }
TG_FN vec3 drawnScale(vec3 scale) {
  float longest = min(max(scale.x, max(scale.y, scale.z)), kScaleMax);
  float shortest = kThinnest * longest;
  return vec3(clamp(scale.x, shortest, longest), clamp(scale.y, shortest, longest), clamp(scale.z, shortest, longest));
}
TG_FN float visibleRadius(float opacity) {
  float v = 2.0f * log(opacity / kAlphaMin);
  return v > 0.0f ? sqrt(v) * 1.0002f : 0.0f;
}
TG_FN bool tangentBounds(float m, float z, vec3 lm, vec3 lz, TG_OUT(vec2) bounds) {
  float c = m / z;
  float inv_z = 1.0f / z;
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
TG_FN Splat makeSplat(vec3 mean_c, mat3 axes_c, vec3 scale, vec4 focal_center, float opacity, vec3 base) {
  float inv_z = 1.0f / mean_c.z;
  float cx = mean_c.x * inv_z;
  float cy = mean_c.y * inv_z;
  vec3 inv_scale = vec3(1.0f / scale.x, 1.0f / scale.y, 1.0f / scale.z);
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
TG_FN mat3 ellipsoidRows(mat3 axes_c, vec3 scale, float radius, bool flat_c) {
  vec3 r = radius * scale;
  if (flat_c) r.z = 0.0f;
  return mat3(r * vec3(axes_c[0].x, axes_c[1].x, axes_c[2].x), r * vec3(axes_c[0].y, axes_c[1].y, axes_c[2].y),
              r * vec3(axes_c[0].z, axes_c[1].z, axes_c[2].z));
}
TG_FN bool rowsBox(vec3 mean_c, mat3 rows, vec4 focal_center, TG_OUT(vec2) bx, TG_OUT(vec2) by, TG_OUT(vec4) box) {
  bool ok_x = tangentBounds(mean_c.x, mean_c.z, rows[0], rows[2], bx);
  bool ok_y = tangentBounds(mean_c.y, mean_c.z, rows[1], rows[2], by);
  box = vec4(bx.x * focal_center.x + focal_center.z, by.x * focal_center.y + focal_center.w,
             bx.y * focal_center.x + focal_center.z, by.y * focal_center.y + focal_center.w);
  return ok_x && ok_y;
}
TG_FN bool splatBox(vec3 mean_c, mat3 axes_c, vec3 scale, float radius, bool flat_c, vec4 focal_center,
                    TG_OUT(vec4) box) {
  vec2 bx;
  vec2 by;
  return rowsBox(mean_c, ellipsoidRows(axes_c, scale, radius, flat_c), focal_center, bx, by, box);
}
TG_FN vec3 antialiasedScale(vec3 scale, float z, float focal) {
  float pixel = z / focal;
  float add = kScreenVariance * pixel * pixel;
  return vec3(sqrt(scale.x * scale.x + add), sqrt(scale.y * scale.y + add), sqrt(scale.z * scale.z + add));
}
TG_FN float antialiasedOpacity(vec3 scale, vec3 wider, float length_before, float length_after, bool flat_c) {
  float flat_part = (scale.x / wider.x) * (scale.y / wider.y);
  return flat_c ? flat_part : flat_part * (scale.z / wider.z) * (length_before / length_after);
}
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
TG_FN float footprintShare(float texel_density) {
  return texel_density <= 1.0f ? 0.0f : min(log(texel_density) * 1.4426950408889634f, 1.0f);
}
struct Hit {
  vec2 uv;
  float power;
  float t;
};
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
#endif`;

const SH_H = `#ifndef TG_SH_H
#define TG_SH_H
${LANG_H}
TG_NAMESPACE_BEGIN
TG_FN uint shCoefficientCount(uint degree) { return (degree + 1u) * (degree + 1u); }
TG_FN void shBasis(vec3 dir, TG_OUT(vec4) b0, TG_OUT(vec4) b1, TG_OUT(vec4) b2, TG_OUT(vec4) b3) {
  float x = dir.x;
  float y = dir.y;
  float z = dir.z;
  float xx = x * x;
  float yy = y * y;
  float zz = z * z;
  b0 = vec4(0.28209479177387814f, -0.4886025119029199f * y, 0.4886025119029199f * z, -0.4886025119029199f * x);
  b1 = vec4(1.0925484305920792f * x * y, -1.0925484305920792f * y * z, 0.31539156525252005f * (2.0f * zz - xx - yy),
            -1.0925484305920792f * x * z);
  b2 = vec4(0.5462742152960396f * (xx - yy), -0.5900435899266435f * y * (3.0f * xx - yy),
            2.890611442640554f * x * y * z, -0.4570457994644658f * y * (4.0f * zz - xx - yy));
  b3 = vec4(0.3731763325901154f * z * (2.0f * zz - 3.0f * xx - 3.0f * yy),
            -0.4570457994644658f * x * (4.0f * zz - xx - yy), 1.445305721320277f * z * (xx - yy),
            -0.5900435899266435f * x * (xx - 3.0f * yy));
}
TG_FN vec3 shBasisGradient(vec3 dir, uint k) {
  float x = dir.x;
  float y = dir.y;
  float z = dir.z;
  float xx = x * x;
  float yy = y * y;
  float zz = z * z;
  const float c1 = 0.4886025119029199f;
  const float c2 = 1.0925484305920792f;
  const float c20 = 0.31539156525252005f;
  const float c22 = 0.5462742152960396f;
  const float c33 = 0.5900435899266435f;
  const float c32 = 2.890611442640554f;
  const float c31 = 0.4570457994644658f;
  const float c30 = 0.3731763325901154f;
  const float c34 = 1.445305721320277f;
  if (k == 1u) return vec3(0.0f, -c1, 0.0f);
  if (k == 2u) return vec3(0.0f, 0.0f, c1);
  if (k == 3u) return vec3(-c1, 0.0f, 0.0f);
  if (k == 4u) return vec3(c2 * y, c2 * x, 0.0f);
  if (k == 5u) return vec3(0.0f, -c2 * z, -c2 * y);
  if (k == 6u) return vec3(-2.0f * c20 * x, -2.0f * c20 * y, 4.0f * c20 * z);
  if (k == 7u) return vec3(-c2 * z, 0.0f, -c2 * x);
  if (k == 8u) return vec3(2.0f * c22 * x, -2.0f * c22 * y, 0.0f);
  if (k == 9u) return vec3(-6.0f * c33 * x * y, -3.0f * c33 * (xx - yy), 0.0f);
  if (k == 10u) return vec3(c32 * y * z, c32 * x * z, c32 * x * y);
  if (k == 11u) return vec3(2.0f * c31 * x * y, -c31 * (4.0f * zz - xx - 3.0f * yy), -8.0f * c31 * y * z);
  if (k == 12u) return vec3(-6.0f * c30 * x * z, -6.0f * c30 * y * z, c30 * (6.0f * zz - 3.0f * xx - 3.0f * yy));
  if (k == 13u) return vec3(-c31 * (4.0f * zz - 3.0f * xx - yy), 2.0f * c31 * x * y, -8.0f * c31 * x * z);
  if (k == 14u) return vec3(2.0f * c34 * x * z, -2.0f * c34 * y * z, c34 * (xx - yy));
  if (k == 15u) return vec3(-3.0f * c33 * (xx - yy), 6.0f * c33 * x * y, 0.0f);
  return vec3(0.0f, 0.0f, 0.0f);
}
TG_NAMESPACE_END
#endif`;

const TEXTURE_H = `#ifndef TG_TEXTURE_H
#define TG_TEXTURE_H
${LIMITS_H}
TG_NAMESPACE_BEGIN
struct TextureTap {
  uint i0;
  uint i1;
  float fraction;
};
TG_FN float texelsPerSigma(uint size) { return float(size - 1u) / (2.0f * kTextureExtent); }
TG_FN TextureTap textureTap(float u, uint size) {
  float x = (u + kTextureExtent) * texelsPerSigma(size);
  uint last = size >= 2u ? size - 2u : 0u;
  float cell = clamp(floor(x), 0.0f, float(last));
  TextureTap tap;
  tap.i0 = uint(cell);
  tap.i1 = min(tap.i0 + 1u, size - 1u);
  tap.fraction = x - cell;
  return tap;
}
TG_FN bool insideTexture(vec2 uv) {
  return uv.x >= -kTextureExtent && uv.x <= kTextureExtent && uv.y >= -kTextureExtent && uv.y <= kTextureExtent;
}
TG_FN bool samplesTexture(uint outside, TG_INOUT(vec2) uv) {
  if (outside == kOutsideEdge) {
    uv = vec2(clamp(uv.x, -kTextureExtent, kTextureExtent), clamp(uv.y, -kTextureExtent, kTextureExtent));
  }
  return insideTexture(uv);
}
TG_NAMESPACE_END
#endif`;

export const SHADERS = {
  'splat.vert': `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
${SPLAT_H}
${SH_H}
uniform usampler2D u_order;
uniform int u_visible;
uniform sampler2D u_gaussians;
uniform sampler2D u_sh;
uniform usampler2D u_rects;
uniform sampler2D u_ranges;
uniform int u_per_row;
uniform int u_sh_coefficients;
uniform mat3 u_camera_from_world;
uniform vec3 u_eye;
uniform vec3 u_eye_rest;
uniform vec4 u_focal_center;
uniform vec2 u_size;
uniform uint u_texture_mode;
uniform uint u_intersection;
uniform uint u_show;
uniform vec2 u_depth;
uniform bool u_fallback;
flat out vec4 v_wx_r;
flat out vec4 v_wy_g;
flat out vec4 v_dx_b;
flat out vec4 v_dy_layer;
flat out vec4 v_d0_opacity;
flat out vec3 v_center_depth;
flat out vec4 v_rect;
flat out vec4 v_scale;
flat out vec4 v_offset;
vec4 gaussianTexel(int column, int row, int k) { return texelFetch(u_gaussians, ivec2(column * 5 + k, row), 0); }
vec3 baseColor(int column, int row, vec3 dir, vec3 first) {
  vec4 basis[4];
  shBasis(dir, basis[0], basis[1], basis[2], basis[3]);
  vec3 color = vec3(0.5) + basis[0].x * first;
  for (int k = 1; k <= u_sh_coefficients; ++k) {
    color += basis[k >> 2][k & 3] * texelFetch(u_sh, ivec2(column * u_sh_coefficients + k - 1, row), 0).rgb;
  }
  return max(color, vec3(0.0));
}
bool turnedBox(vec3 mean_c, mat3 axes, vec3 r, vec4 box, out mat2 half_axes) {
  vec3 fx_fy = vec3(u_focal_center.xy, 0.0);
  vec3 lx = r * vec3(axes[0].x, axes[1].x, axes[2].x);
  vec3 ly = r * vec3(axes[0].y, axes[1].y, axes[2].y);
  vec3 lz = r * vec3(axes[0].z, axes[1].z, axes[2].z);
  vec2 bounds;
  if (!tangentBounds(dot(fx_fy, mean_c), mean_c.z, fx_fy.x * lx + fx_fy.y * ly, lz, bounds)) return false;
  vec2 h = 0.5 * (box.zw - box.xy);
  float along = 0.5 * (bounds.y - bounds.x);
  float xy = 0.5 * (along * along - dot(h, h));
  float difference = 0.5 * (h.x * h.x - h.y * h.y);
  float spread = sqrt(difference * difference + xy * xy);
  float middle = 0.5 * dot(h, h);
  if (!(middle < 1e12) || spread < 0.1 * middle) return false;
  vec2 e = normalize(difference > 0.0 ? vec2(difference + spread, xy) : vec2(xy, spread - difference));
  float longer = sqrt(middle + spread);
  float shorter = sqrt(max(middle - spread, 0.0)) + 1.0 + 1e-3 * longer;
  half_axes = mat2(e * (longer + 1.0), vec2(-e.y, e.x) * shorter);
  return true;
}
void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  int place = gl_VertexID >> 2;
  if (gl_InstanceID * textureSize(u_order, 0).x + place >= u_visible) return;
  int gaussian = int(texelFetch(u_order, ivec2(place, gl_InstanceID), 0).x);
  int row = gaussian / u_per_row;
  int column = gaussian - row * u_per_row;
  vec4 mean_opacity = gaussianTexel(column, row, 0);
  vec4 xyzw = gaussianTexel(column, row, 1);
  vec4 scale_layer = gaussianTexel(column, row, 2);
  vec4 fallback = gaussianTexel(column, row, 4);
  float opacity = u_fallback ? fallback.w : mean_opacity.w;
  float radius = visibleRadius(opacity);
  vec3 from_eye = mean_opacity.xyz - u_eye - u_eye_rest;
  vec3 mean_c = u_camera_from_world * from_eye;
  if (radius <= 0.0 || mean_c.z <= kNear) return;
  vec3 scale = scale_layer.xyz;
  int c = scale.z > min(scale.x, scale.y) ? shortestAxis(scale) : 2;
  int a = axisU(c), b = axisV(c);
  mat3 axes = u_camera_from_world * rotationFromQuaternion(vec4(xyzw.w, xyzw.x, xyzw.y, xyzw.z));
  axes = mat3(axes[a], axes[b], axes[c]);
  scale = drawnScale(vec3(scale[a], scale[b], scale[c]));
  float longest = max(scale.x, max(scale.y, scale.z));
  if (longest <= kScaleMin) return;
  vec4 box;
  bool flat_c = u_intersection == kIntersectPlane;
  bool bounded = splatBox(mean_c, axes, scale, radius, flat_c, u_focal_center, box);
  if (!bounded) box = vec4(0.0, 0.0, u_size);
  vec4 seen = vec4(max(box.xy, vec2(0.0)), min(box.zw, u_size));
  if (seen.z <= seen.x || seen.w <= seen.y) return;
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1 & 1);
  mat2 half_axes;
  vec2 at = bounded && turnedBox(mean_c, axes, radius * vec3(scale.xy, flat_c ? 0.0 : scale.z), box, half_axes)
                ? 0.5 * (box.xy + box.zw) + half_axes * (2.0 * corner - 1.0)
                : mix(seen.xy, seen.zw, corner);
  gl_Position = vec4(2.0 * at.x / u_size.x - 1.0, 1.0 - 2.0 * at.y / u_size.y,
                     clamp(u_depth.x + u_depth.y / mean_c.z, -1.0, 1.0), 1.0);
  vec3 color;
  if (u_show == kOutputNormal) {
    color = dot(axes[2], mean_c) > 0.0 ? -axes[2] : axes[2];
  } else {
    vec3 first = u_fallback ? fallback.xyz : gaussianTexel(column, row, 3).xyz;
    color = baseColor(column, row, normalize(from_eye), first);
  }
  Splat s = makeSplat(mean_c, axes, scale / longest, u_focal_center, opacity, color);
  v_wx_r = vec4(s.wx_r.xyz / longest, s.wx_r.w);
  v_wy_g = vec4(s.wy_g.xyz / longest, s.wy_g.w);
  v_dx_b = s.dx_b;
  v_dy_layer = vec4(s.dy_offset.xyz, scale_layer.w);
  v_d0_opacity = vec4(s.d0_size.xyz, opacity);
  v_center_depth = s.center_depth_opacity.xyz;
  v_rect = u_texture_mode == kModeNone ? vec4(0.0) : vec4(texelFetch(u_rects, ivec2(column, row), 0));
  v_scale = texelFetch(u_ranges, ivec2(0, int(scale_layer.w)), 0);
  v_offset = texelFetch(u_ranges, ivec2(1, int(scale_layer.w)), 0);
}
`,
  'splat.frag': `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2DArray;
${SPLAT_H}
${TEXTURE_H}
uniform sampler2DArray u_atlas;
uniform vec2 u_size;
uniform vec2 u_origin;
uniform uint u_texture_mode;
uniform uint u_intersection;
uniform uint u_outside;
uniform uint u_show;
flat in vec4 v_wx_r;
flat in vec4 v_wy_g;
flat in vec4 v_dx_b;
flat in vec4 v_dy_layer;
flat in vec4 v_d0_opacity;
flat in vec3 v_center_depth;
flat in vec4 v_rect;
flat in vec4 v_scale;
flat in vec4 v_offset;
out vec4 o_color;
void main() {
  vec2 delta = vec2(gl_FragCoord.x - u_origin.x, u_size.y - (gl_FragCoord.y - u_origin.y)) - v_center_depth.xy;
  Hit hit;
  if (!intersectSplat(v_wx_r.xyz, v_wy_g.xyz, v_dx_b.xyz, v_dy_layer.xyz, v_d0_opacity.xyz, v_center_depth.z,
                      u_intersection, delta, kNear, hit)) {
    discard;
  }
  vec3 texture_color = vec3(0.0);
  float texture_alpha = 1.0;
  bool textured = v_rect.z > 0.0 && v_rect.w > 0.0;
  vec2 uv = hit.uv;
  bool samples = samplesTexture(u_outside, uv);
  if (textured && !samples && u_outside == kOutsideClip) discard;
  if (textured && samples) {
    vec2 t = (uv + kTextureExtent) / (2.0 * kTextureExtent);
    vec2 at = (v_rect.xy + 0.5 + t * (v_rect.zw - 1.0)) / vec2(textureSize(u_atlas, 0).xy);
    vec4 value = textureLod(u_atlas, vec3(at, v_dy_layer.w), 0.0) * v_scale + v_offset;
    if ((u_texture_mode & kModeRgb) != 0u) texture_color = value.rgb;
    if ((u_texture_mode & kModeAlpha) != 0u) texture_alpha = clamp(value.a, 0.0, 1.0);
  }
  float alpha = min(kAlphaMax, v_d0_opacity.w * exp(-0.5 * hit.power) * texture_alpha);
  if (alpha < kAlphaMin) discard;
  vec3 base = vec3(v_wx_r.w, v_wy_g.w, v_dx_b.w);
  vec3 color = base + texture_color;
  if (u_show == kOutputBase || u_show == kOutputNormal) color = base;
  if (u_show == kOutputTexture) color = texture_color;
  if (u_show == kOutputDepth) color = vec3(hit.t);
  o_color = u_show == kOutputOverdraw ? vec4(1.0) : vec4(color * alpha, alpha);
}
`,
  'resolve.vert': `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
`,
  'resolve.frag': `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
${LIMITS_H}
uniform sampler2D u_sum;
uniform vec2 u_sum_per_pixel;
uniform vec3 u_background;
uniform vec2 u_depth_range;
uniform uint u_show;
uniform bool u_over;
uniform bool u_linear;
out vec4 o_color;
const float kWhiteCount = 64.0;
vec3 heat(float x) { return clamp(vec3(3.0 * x, 3.0 * x - 1.0, 3.0 * x - 2.0), 0.0, 1.0); }
vec3 linear(vec3 s) { return mix(s / 12.92, pow((s + 0.055) / 1.055, vec3(2.4)), greaterThan(s, vec3(0.04045))); }
void main() {
  vec4 sum = texelFetch(u_sum, ivec2(gl_FragCoord.xy * u_sum_per_pixel), 0);
  if (u_over) {
    vec3 straight = clamp(sum.rgb / max(sum.a, 1e-6), 0.0, 1.0);
    o_color = vec4(u_linear ? linear(straight) * sum.a : sum.rgb, sum.a);
    return;
  }
  vec3 color = sum.rgb + (1.0 - sum.a) * u_background;
  if (u_show == kOutputTexture) color = 0.5 + 0.5 * sum.rgb;
  if (u_show == kOutputAlpha) color = vec3(sum.a);
  if (u_show == kOutputNormal) color = 0.5 + 0.5 * vec3(1.0, -1.0, -1.0) * sum.rgb;
  if (u_show == kOutputOverdraw) color = heat(sum.r / kWhiteCount);
  if (u_show == kOutputDepth) {
    float far = clamp((sum.r / max(sum.a, 1e-6) - u_depth_range.x) / (u_depth_range.y - u_depth_range.x), 0.0, 1.0);
    color = vec3(sum.a > 0.0 ? 1.0 - (1.0 - kFarthestGrey) * far : 0.0);
  }
  o_color = vec4(color, 1.0);
}
`,
};
