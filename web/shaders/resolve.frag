#version 300 es
// SPDX-License-Identifier: Apache-2.0
// The blended sums as a picture, as render/frame.cpp's visualize() shows each output.
precision highp float;
precision highp int;
precision highp sampler2D;
#include "shared/limits.h"

uniform sampler2D u_sum;       // sum of w c, 1 - transmittance
uniform vec2 u_sum_per_pixel;  // size of u_sum over the canvas's
uniform vec3 u_background;
uniform vec2 u_depth_range;    // camera z: bright, dark
uniform uint u_show;           // kOutput*
uniform bool u_over;           // premultiplied, to be blended over what is there, instead of the background
uniform bool u_linear;         // over linear light

out vec4 o_color;

const float kWhiteCount = 64.0;     // splats a pixel that show as white

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
