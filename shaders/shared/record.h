// SPDX-License-Identifier: Apache-2.0
// A splat as blending reads it. |W|^2 and |D|^2 of shared/splat.h are quadratic in the pixel offset (x, y); the QR
// factors of (dW/dx, dW/dy) and (dD/dx, dD/dy, d0) give them as sums of few squares, without the cancellation that
// their plain coefficients suffer from. The factors come from cross products, whose components stay exact for scales of
// any ratio. In the plane model only W's components along a and b count and only D's along c: then
//     |p|^2 = |W|^2 / |D|^2   and   t = z (d0 . D) / |D|^2
// hold for both models.
#ifndef TG_RECORD_H
#define TG_RECORD_H
#include "shared/splat.h"
TG_NAMESPACE_BEGIN

// outline: as in the record.
TG_FN SplatRecord makeRecord(Splat s, uint model, vec3 normal, vec4 outline) {
  vec3 wx = vec3(s.wx_r.x, s.wx_r.y, s.wx_r.z);
  vec3 wy = vec3(s.wy_g.x, s.wy_g.y, s.wy_g.z);
  vec3 dx = vec3(s.dx_b.x, s.dx_b.y, s.dx_b.z);
  vec3 dy = vec3(s.dy_offset.x, s.dy_offset.y, s.dy_offset.z);
  vec3 d0 = vec3(s.d0_size.x, s.d0_size.y, s.d0_size.z);
  float depth = s.center_depth_opacity.z;
  float unit = 1.0f / length(d0);  // both squares may be scaled alike: keeps them in range
  SplatRecord record;
  record.center_depth_opacity = s.center_depth_opacity;
  record.u_offset = vec4(depth * d0.x, depth * dx.x, depth * dy.x, s.dy_offset.w);
  record.v_size = vec4(depth * d0.y, depth * dx.y, depth * dy.y, s.d0_size.w);
  record.normal = vec4(normal, 0.0f);
  record.outline = outline;

  wx = unit * wx;
  wy = unit * wy;
  if (model == kIntersectPlane) {
    wx.z = 0.0f;
    wy.z = 0.0f;
    record.d_g = vec4(unit * dx.z, unit * dy.z, unit * d0.z, s.wy_g.w);
    record.e_b = vec4(0.0f, 0.0f, 0.0f, s.dx_b.w);
  } else {
    dx = unit * dx;
    dy = unit * dy;
    d0 = unit * d0;
    // Of a disc seen squarely dx and dy are as small as it is thin; their product would be 0.
    float dx_length = length(dx);
    float dy_length = length(dy);
    vec3 x = dx / dx_length;
    vec3 n = cross(x, dy / dy_length);
    float n_length = length(n);
    record.d_g = vec4(dx_length, dot(x, dy), dot(x, d0), s.wy_g.w);
    record.e_b = vec4(dy_length * n_length, dot(n, cross(x, d0)) / n_length, dot(n, d0) / n_length, s.dx_b.w);
  }
  float wx_length = length(wx);
  if (wx_length > 0.0f) {
    record.w_r = vec4(wx_length, dot(wx, wy) / wx_length, length(cross(wx, wy)) / wx_length, s.wx_r.w);
  } else {
    record.w_r = vec4(0.0f, 0.0f, length(wy), s.wx_r.w);
  }
  return record;
}

// Where the vertical tangent plane x = bound z touches an ellipsoid around mean_c: its y / z. lx, ly, lz, bound as in
// tangentBounds().
TG_FN float touchedY(vec3 mean_c, float bound, vec3 lx, vec3 ly, vec3 lz) {
  vec3 e = lx - bound * lz;
  float k = (mean_c.x - bound * mean_c.z) / dot(e, e);
  return (mean_c.y - k * dot(ly, e)) / (mean_c.z - k * dot(lz, e));
}

// splatBox() with the outline of the record. size: of the image [px]. Without an outline the box is the image, or empty
// when the ellipsoid lies beyond one of the planes through the image's sides.
TG_FN void splatOutline(vec3 mean_c, mat3 axes_c, vec3 scale, float radius, bool flat_c, vec4 focal_center, vec2 size,
                        TG_OUT(vec4) box, TG_OUT(vec4) outline) {
  mat3 rows = ellipsoidRows(axes_c, scale, radius, flat_c);
  vec3 lx = rows[0];
  vec3 ly = rows[1];
  vec3 lz = rows[2];
  vec2 bx;
  vec2 by;
  outline = vec4(0.0f, 0.0f, radius * radius, 0.0f);
  if (rowsBox(mean_c, rows, focal_center, bx, by, box)) {
    float center_y = mean_c.y / mean_c.z;
    outline.x = (touchedY(mean_c, bx.x, lx, ly, lz) - center_y) * focal_center.y;
    outline.y = (touchedY(mean_c, bx.y, lx, ly, lz) - center_y) * focal_center.y;
    outline.w = 1.0f;
    return;
  }
  float left = -focal_center.z / focal_center.x;
  float top = -focal_center.w / focal_center.y;
  float right = (size.x - focal_center.z) / focal_center.x;
  float bottom = (size.y - focal_center.w) / focal_center.y;
  bool beside = mean_c.x - left * mean_c.z + length(lx - left * lz) < 0.0f ||
                mean_c.y - top * mean_c.z + length(ly - top * lz) < 0.0f ||
                right * mean_c.z - mean_c.x + length(lx - right * lz) < 0.0f ||
                bottom * mean_c.z - mean_c.y + length(ly - bottom * lz) < 0.0f;
  box = beside ? vec4(0.0f, 0.0f, -1.0f, -1.0f) : vec4(0.0f, 0.0f, size.x, size.y);
}

// The pixel offsets x at height y [px below the projected mean] that lie inside the outline: |W|^2 <= power |D|^2,
// solved for w.x x + w.y y. False: none.
TG_FN bool outlineAt(SplatRecord r, float y, TG_OUT(vec2) span) {
  TG_PRECISE float slope = r.d_g.x / r.w_r.x;
  TG_PRECISE float k = (r.d_g.y - slope * r.w_r.y) * y + r.d_g.z;
  TG_PRECISE float s = r.e_b.x * y + r.e_b.y;
  TG_PRECISE float v = r.w_r.z * y;
  TG_PRECISE float power = r.outline.z;
  TG_PRECISE float a = 1.0f - power * slope * slope;
  TG_PRECISE float b = power * slope * k;
  TG_PRECISE float c = v * v - power * (k * k + s * s + r.e_b.z * r.e_b.z);
  TG_PRECISE float discriminant = b * b - a * c;
  span = vec2(-1e9f, 1e9f);
  if (!(a > 1e-6f)) return true;  // also where w.x is 0
  if (discriminant < 0.0f) return false;
  TG_PRECISE float root = sqrt(discriminant);
  TG_PRECISE float low = ((b - root) / a - r.w_r.y * y) / r.w_r.x;
  TG_PRECISE float high = ((b + root) / a - r.w_r.y * y) / r.w_r.x;
  span = vec2(low, high);
  return true;
}

// The first and last pixel column, of those in [x0, x1], that a splat can colour in the rows [y0, y1]. False: none.
// An ellipse reaches farthest to a side at that side's touching point or in the row nearest to it; a splat without an
// outline is looked at in every row.
TG_FN bool splatColumns(SplatRecord r, float x0, float x1, float y0, float y1, TG_OUT(vec2) columns) {
  const float margin = 1.0f / 64.0f;  // [px] more than rounding moves an end that matters
  TG_PRECISE float top = y0 + 0.5f - r.center_depth_opacity.y;
  TG_PRECISE float bottom = y1 + 0.5f - r.center_depth_opacity.y;
  bool ellipse = r.outline.w != 0.0f;
  uint looks = ellipse ? 2u : uint(y1 - y0) + 1u;
  TG_PRECISE float low = 1e9f;
  TG_PRECISE float high = -1e9f;
  for (uint i = 0u; i < looks; ++i) {
    TG_PRECISE float y = ellipse ? clamp(i == 0u ? r.outline.x : r.outline.y, top, bottom) : top + float(i);
    vec2 span;
    if (outlineAt(r, y, span)) {
      low = min(low, span.x);
      high = max(high, span.y);
    }
  }
  TG_PRECISE float first = max(x0, -floor(0.5f + margin - low - r.center_depth_opacity.x));
  TG_PRECISE float last = min(x1, floor(high + r.center_depth_opacity.x - 0.5f + margin));
  columns = vec2(first, last);
  return first <= last;
}

// The first and last tile of a row of tiles that a splat can colour, given its pixel rectangle (x0, y0, x1, y1, ends
// inclusive). Returns how many.
TG_FN uint splatTiles(SplatRecord r, uvec4 rect, uint tile_y, TG_OUT(uint) first) {
  float size = float(kTileSize);
  float y0 = max(float(rect.y), float(tile_y) * size);
  float y1 = min(float(rect.w), float(tile_y) * size + size - 1.0f);
  vec2 columns;
  first = 0u;
  if (!splatColumns(r, float(rect.x), float(rect.z), y0, y1, columns)) return 0u;
  first = uint(columns.x) / kTileSize;
  return uint(columns.y) / kTileSize - first + 1u;
}

// Which blocks of 4 x 4 pixels of a tile a splat can colour, a bit each, row by row.
TG_FN uint splatBlocks(SplatRecord r, uint tile_x, uint tile_y) {
  float x0 = float(tile_x * kTileSize);
  uint blocks = 0u;
  for (uint row = 0u; row < 4u; ++row) {
    float y0 = float(tile_y * kTileSize + 4u * row);
    vec2 columns;
    if (splatColumns(r, x0, x0 + float(kTileSize - 1u), y0, y0 + 3.0f, columns)) {
      uint begin = uint(columns.x - x0) / 4u;
      uint end = uint(columns.y - x0) / 4u;
      blocks |= ((2u << end) - (1u << begin)) << (4u * row);
    }
  }
  return blocks;
}

TG_NAMESPACE_END
#endif
