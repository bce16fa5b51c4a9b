#version 300 es
// SPDX-License-Identifier: Apache-2.0
// One pixel of one splat: hit, texture sample, alpha (docs/math.md 2, 3, 5a). Blended back to front, premultiplied.
precision highp float;
precision highp int;
precision highp sampler2DArray;
#include "shared/splat.h"
#include "shared/texture.h"

uniform sampler2DArray u_atlas;  // rgb: colour, a: alpha, as stored; a layer an atlas
uniform vec2 u_size;             // [px]
uniform vec2 u_origin;           // [px] of the picture in the framebuffer
uniform uint u_texture_mode;     // kMode*
uniform uint u_intersection;     // kIntersect*
uniform uint u_outside;          // kOutside*
uniform uint u_show;             // kOutput*

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
