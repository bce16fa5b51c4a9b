#version 300 es
// SPDX-License-Identifier: Apache-2.0
// Four vertices a Gaussian: its splat record and a quad over all it can draw. Formulas: shared/splat.h.
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
#include "shared/splat.h"
#include "shared/sh.h"

uniform usampler2D u_order;     // Gaussians, farthest first, those of an instance in a row
uniform int u_visible;          // how many there are in it
uniform sampler2D u_gaussians;  // 5 texels each: see uploadSteps()
uniform sampler2D u_sh;         // coefficients from 1 on, a texel each
uniform usampler2D u_rects;     // x, y, w, h in atlas texels
uniform sampler2D u_ranges;     // a row an atlas: scale, offset
uniform int u_per_row;          // Gaussians in a row of these textures
uniform int u_sh_coefficients;  // without the first one
uniform mat3 u_camera_from_world;
uniform vec3 u_eye;           // world space
uniform vec3 u_eye_rest;      // what u_eye lacks of the eye's place
uniform vec4 u_focal_center;  // fx, fy, cx, cy [px]
uniform vec2 u_size;          // [px]
uniform uint u_texture_mode;  // kMode*
uniform uint u_intersection;  // kIntersect*
uniform uint u_show;          // kOutput*
uniform vec2 u_depth;         // a normalised depth is x + y / camera z
uniform bool u_fallback;      // opacity and colour of KHR_gaussian_splatting alone

flat out vec4 v_wx_r;  // as struct Splat
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

// The outline's ellipse has the half widths sqrt(n^T S n) along any direction n. Of S [px^2] splatBox tells the
// diagonal; the bounds along (1, 1) hold the rest. Its eigenvectors turn the box with the ellipse: a slanted needle's
// quad is a fraction of its screen box. Returns false where the box itself is as good or S is not known well.
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
  // Of quads that reach further than some 1e7 px clipping loses whole columns, and from 4e9 px on the squares here
  // overflow: beyond 1e6 px the box, which is clipped, does.
  if (!(middle < 1e12) || spread < 0.1 * middle) return false;
  vec2 e = normalize(difference > 0.0 ? vec2(difference + spread, xy) : vec2(xy, spread - difference));
  // A pixel and a thousandth more: the smaller eigenvalue is a difference of large numbers.
  float longer = sqrt(middle + spread);
  float shorter = sqrt(max(middle - spread, 0.0)) + 1.0 + 1e-3 * longer;
  half_axes = mat2(e * (longer + 1.0), vec2(-e.y, e.x) * shorter);
  return true;
}

void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);  // outside: nothing is drawn
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
  // Turned after the difference is taken: of a scene far from the origin a translation would cancel.
  vec3 from_eye = mean_opacity.xyz - u_eye - u_eye_rest;
  vec3 mean_c = u_camera_from_world * from_eye;
  if (radius <= 0.0 || mean_c.z <= kNear) return;

  // Files with textures have their axes in order (T21); where the normal is longer than another axis, as in files
  // without, the rule of docs/math.md 2.2 finds it.
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
  // In units of the longest axis, so that squares stay within float: hits are quotients of W and D alone.
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
