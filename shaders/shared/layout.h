// SPDX-License-Identifier: Apache-2.0
// Structs that cross host and device. Members are vec4, uvec4, mat4 or groups of four scalars only, so that std140,
// std430 and C++ agree byte for byte.
#ifndef TG_LAYOUT_H
#define TG_LAYOUT_H
#include "shared/lang.h"
TG_NAMESPACE_BEGIN

// The view of one frame. Camera space: OpenCV axes (x right, y down, z forward), pixel centres at +0.5.
struct ViewUniforms {
  mat4 camera_from_world;
  vec4 camera_position;  // xyz: world space
  vec4 focal_center;     // fx, fy, cx, cy [px]
  vec4 background;       // rgb as displayed, w unused
  uint width;            // [px]
  uint height;           // [px]
  uint tiles_x;          // ceil(width / kTileSize)
  uint tiles_y;
  uint gaussian_count;
  uint sh_degree;        // 0..3
  uint texture_mode;     // kMode*: what the model has AND what the user left switched on
  uint intersection;     // kIntersect*
  vec4 crop_min;         // world space; w: 1 when there is a crop box, else 0
  vec4 crop_max;
  float opacity_scale;
  float splat_scale;
  float near;            // [world units] camera z at and before which nothing is drawn
  float exposure;        // factor on the pictures of final, base and texture
  uint sh_used;          // highest SH degree that counts
  uint antialiasing;     // 1: screen
  uint range_least;      // Counters::output_range of what lies outside of this part of a picture
  uint range_most;
  vec4 position_rest;    // xyz: what camera_position lacks of the camera's place
  vec4 forward_rest;     // xyz: what the third row of camera_from_world lacks of the viewing direction
};
TG_CHECK_SIZE(ViewUniforms, 240)

// A Gaussian seen from a camera: all that blending needs. The local frame is ordered (a, b, c): a, b span the texture
// (u along a, v along b), c is the shortest axis. See shared/splat.h for the formulas that use it.
struct Splat {
  vec4 center_depth_opacity;  // projected mean x, y [px]; camera z of the mean; opacity after the sigmoid
  vec4 wx_r;                  // dW/dx [per px], base colour red
  vec4 wy_g;                  // dW/dy [per px], base colour green
  vec4 dx_b;                  // dD/dx [per px], base colour blue
  vec4 dy_offset;             // dD/dy [per px], texel offset (bits of a uint)
  vec4 d0_size;               // D at the projected mean, texture width | height << 16 (bits of a uint)
};
TG_CHECK_SIZE(Splat, 96)

// What of a Splat blending evaluates, reduced to as few operations per pixel as there are (shared/record.h). With the
// pixel offset (x, y) from the projected mean, for both intersection models alike:
//     |W|^2 = (w.x x + w.y y)^2 + (w.z y)^2
//     |D|^2 = (d.x x + d.y y + d.z)^2 + (e.x y + e.y)^2 + e.z^2
struct SplatRecord {
  vec4 center_depth_opacity;  // as in Splat
  vec4 w_r;                   // w, base colour red
  vec4 d_g;                   // d, base colour green
  vec4 e_b;                   // e, base colour blue
  vec4 u_offset;              // z d0, z dD/dx, z dD/dy along local axis a; texel offset (bits of a uint)
  vec4 v_size;                // the same along b; texture width | height << 16 (bits of a uint)
  vec4 normal;                // shortest axis in camera space, turned to the camera; texels a pixel
  // Offset y [px] of the outline's leftmost and of its rightmost point, the outline's Mahalanobis distance squared, and
  // whether it is an ellipse: 1, or 0 where the splat reaches beside the camera.
  vec4 outline;
};
TG_CHECK_SIZE(SplatRecord, 128)
const uint kRecordSize = 8u;  // [vec4]

TG_NAMESPACE_END
#endif
