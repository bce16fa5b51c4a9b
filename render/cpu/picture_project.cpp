// SPDX-License-Identifier: Apache-2.0
// First stages of the picture alone: Gaussians into records, eight at a time in float, and the tiles that they touch.
// Positions are turned into the camera's space in double; all else is products of factors that do not cancel
// (docs/math.md 2.3).
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "render/cpu/bit_places.h"
#include "render/cpu/picture.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/picture_project.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/cpu/sh_basis-inl.h"
#include "shared/limits.h"
#include "shared/splat.h"

#ifndef TG_RENDER_CPU_PICTURE_PROJECT_ARGS
#define TG_RENDER_CPU_PICTURE_PROJECT_ARGS
namespace tg::cpu {

constexpr std::size_t kPictureBlock = 512;  // Gaussians that pass from step to step in the cache

struct ProjectArgs {
  const View& view;
  const GaussianModel& model;
  PictureSplat* splats;
  PictureHit* hits;
  std::uint32_t* depths;
  PictureTiles* tiles;
};

}  // namespace tg::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

using F = HWY_CAPPED(float, 8);
using I = hn::RebindToSigned<F>;
using D = HWY_CAPPED(double, 4);
using H = hn::Rebind<float, D>;
using V = hn::Vec<F>;
using VI = hn::Vec<I>;
using M = hn::Mask<F>;
constexpr F f;
constexpr I fi;
constexpr H fh;
constexpr D fd;
constexpr hn::Rebind<std::uint8_t, F> fb;
constexpr std::size_t kLanes = hn::MaxLanes(F());
constexpr std::size_t kWideLanes = hn::MaxLanes(D());
static_assert(kLanes % kWideLanes == 0);

HWY_INLINE V set(float value) { return hn::Set(f, value); }
HWY_INLINE V set(double value) { return hn::Set(f, static_cast<float>(value)); }

struct V3 {
  V x, y, z;
};
HWY_INLINE V3 scaled(V3 a, V s) { return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)}; }
HWY_INLINE V3 product(V3 a, V3 b) { return {hn::Mul(a.x, b.x), hn::Mul(a.y, b.y), hn::Mul(a.z, b.z)}; }
// a s + b
HWY_INLINE V3 addScaled(V3 a, V s, V3 b) {
  return {hn::MulAdd(a.x, s, b.x), hn::MulAdd(a.y, s, b.y), hn::MulAdd(a.z, s, b.z)};
}
// b - a s
HWY_INLINE V3 subtractScaled(V3 a, V s, V3 b) {
  return {hn::NegMulAdd(a.x, s, b.x), hn::NegMulAdd(a.y, s, b.y), hn::NegMulAdd(a.z, s, b.z)};
}
HWY_INLINE V dot(V3 a, V3 b) { return hn::MulAdd(a.z, b.z, hn::MulAdd(a.y, b.y, hn::Mul(a.x, b.x))); }
HWY_INLINE V3 cross(V3 a, V3 b) {
  return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
          hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}
HWY_INLINE V length(V3 a) { return hn::Sqrt(dot(a, a)); }

// What double precision is for: where a mean lies in camera space and on the screen.
struct Position {
  V3 mean;
  V ray_x, ray_y;        // x / z, y / z
  V center_x, center_y;  // [px]
};
HWY_INLINE Position locate(const View& view, V3 world) {
  const glm::dmat3& r = view.rotation;
  const glm::dvec3 t = view.translation;
  alignas(64) float in[3][kLanes];
  alignas(64) float out[7][kLanes];
  hn::Store(world.x, f, in[0]);
  hn::Store(world.y, f, in[1]);
  hn::Store(world.z, f, in[2]);
  for (std::size_t lane = 0; lane < kLanes; lane += kWideLanes) {
    const auto wide = [&](int k) HWY_ATTR { return hn::PromoteTo(fd, hn::Load(fh, in[k] + lane)); };
    const auto put = [&](int k, hn::Vec<D> value) HWY_ATTR { hn::Store(hn::DemoteTo(fh, value), fh, out[k] + lane); };
    const auto x = wide(0), y = wide(1), z = wide(2);
    const auto row = [&](int k) HWY_ATTR {
      return hn::MulAdd(z, hn::Set(fd, r[2][k]),
                        hn::MulAdd(y, hn::Set(fd, r[1][k]), hn::MulAdd(x, hn::Set(fd, r[0][k]), hn::Set(fd, t[k]))));
    };
    const auto x_c = row(0), y_c = row(1), z_c = row(2);
    const auto ray_x = hn::Div(x_c, z_c), ray_y = hn::Div(y_c, z_c);
    put(0, x_c);
    put(1, y_c);
    put(2, z_c);
    put(3, ray_x);
    put(4, ray_y);
    put(5, hn::MulAdd(ray_x, hn::Set(fd, view.focal.x), hn::Set(fd, view.center.x)));
    put(6, hn::MulAdd(ray_y, hn::Set(fd, view.focal.y), hn::Set(fd, view.center.y)));
  }
  const auto at = [&](int k) HWY_ATTR { return hn::Load(f, out[k]); };
  return {{at(0), at(1), at(2)}, at(3), at(4), at(5), at(6)};
}

HWY_INLINE unsigned bitsOf(M mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(f, mask, bytes);
  return bytes[0];
}

// Gaussians of a block that may be on the screen, one after another; room for a vector that hangs over.
struct Seen {
  alignas(64) std::uint32_t gaussian[kPictureBlock + kLanes];
  alignas(64) float center_x[kPictureBlock + kLanes];  // [px]
  alignas(64) float center_y[kPictureBlock + kLanes];
  alignas(64) float ray_x[kPictureBlock + kLanes];  // camera x / z of the mean
  alignas(64) float ray_y[kPictureBlock + kLanes];
  alignas(64) float z[kPictureBlock + kLanes];  // camera z of the mean
  std::size_t count = 0;
};

// Values of Gaussians [i, i + kLanes), the last one again beyond `end`.
template <typename T>
HWY_INLINE const float* rows(const std::vector<T>& from, std::size_t i, std::size_t end, float* spare) {
  constexpr std::size_t kFloats = sizeof(T) / sizeof(float);
  const float* at = reinterpret_cast<const float*>(from.data() + i);
  if (HWY_LIKELY(i + kLanes <= end)) return at;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    std::copy_n(at + std::min(lane, end - 1 - i) * kFloats, kFloats, spare + lane * kFloats);
  }
  return spare;
}
HWY_INLINE V3 load3(const float* from) {
  V3 v;
  hn::LoadInterleaved3(f, from, v.x, v.y, v.z);
  return v;
}

HWY_INLINE void findSeen(const ProjectArgs& args, const Frustum& frustum, std::size_t begin, std::size_t end,
                         Seen& seen) {
  const View& view = args.view;
  const GaussianModel& model = args.model;
  // Below this logit 255 opacity <= 1, were opacity not rounded.
  const float least = view.opacity_scale > 0.0f
                          ? -std::log(std::max(255.0f * view.opacity_scale - 1.0f, 1e-30f)) - 0.01f
                          : std::numeric_limits<float>::infinity();
  alignas(64) float spare[3 * kLanes];
  std::size_t n = 0;
  for (std::size_t i = begin; i < end; i += kLanes) {
    const V logit = hn::LoadU(f, rows(model.opacity_logit, i, end, spare));
    M seems = hn::And(hn::Gt(logit, set(least)), hn::FirstN(f, end - i));
    const V3 mean = load3(rows(model.mean, i, end, spare));
    const Position position = locate(view, mean);
    const V3 mean_c = position.mean;
    seems = hn::And(seems, hn::Gt(mean_c.z, set(view.near)));
    const V3 log_scale = load3(rows(model.log_scale, i, end, spare));
    const V longest = hn::Min(hn::Max(log_scale.x, hn::Max(log_scale.y, log_scale.z)), set(80.0f));
    const V reach = hn::MulAdd(set(frustum.pixel), mean_c.z, hn::Mul(set(frustum.reach), hn::Exp(f, longest)));
    for (const glm::dvec3& plane : frustum.planes) {
      const V inside = dot({set(plane.x), set(plane.y), set(plane.z)}, mean_c);
      seems = hn::AndNot(hn::Lt(inside, hn::Neg(reach)), seems);
    }
    if (view.crop) {
      const glm::vec3 low = view.crop->min, high = view.crop->max;
      seems = hn::And(seems, hn::And(hn::Le(set(low.x), mean.x), hn::Le(mean.x, set(high.x))));
      seems = hn::And(seems, hn::And(hn::Le(set(low.y), mean.y), hn::Le(mean.y, set(high.y))));
      seems = hn::And(seems, hn::And(hn::Le(set(low.z), mean.z), hn::Le(mean.z, set(high.z))));
    }
    if (hn::AllFalse(f, seems)) continue;
    const unsigned bits = bitsOf(seems);
    const auto order = hn::IndicesFromVec(f, hn::PromoteTo(fi, hn::LoadU(fb, kBitPlaces[bits].data())));
    const auto put = [&](V value, float* to) HWY_ATTR { hn::StoreU(hn::TableLookupLanes(value, order), f, to + n); };
    put(position.center_x, seen.center_x);
    put(position.center_y, seen.center_y);
    put(position.ray_x, seen.ray_x);
    put(position.ray_y, seen.ray_y);
    put(mean_c.z, seen.z);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      seen.gaussian[n + lane] = static_cast<std::uint32_t>(i) + kBitPlaces[bits][lane];
    }
    n += static_cast<std::size_t>(std::popcount(bits));
  }
  seen.count = n;
}

// Rotation of a quaternion (w, x, y, z) of any length, by columns.
HWY_INLINE void rotationColumns(V w, V x, V y, V z, V3* columns) {
  const auto square = [&] HWY_ATTR { return hn::MulAdd(w, w, hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z)))); };
  // Of short ones the square keeps few bits; a power of two costs none.
  const V lift = hn::IfThenElse(hn::Lt(square(), set(1e-20f)), set(0x1p64f), set(1.0f));
  for (V* each : {&w, &x, &y, &z}) *each = hn::Mul(*each, lift);
  const V inverse = hn::Div(set(1.0f), hn::Sqrt(square()));
  w = hn::Mul(w, inverse);
  x = hn::Mul(x, inverse);
  y = hn::Mul(y, inverse);
  z = hn::Mul(z, inverse);
  const V x2 = hn::Add(x, x), y2 = hn::Add(y, y), z2 = hn::Add(z, z);
  const V xx = hn::Mul(x, x2), yy = hn::Mul(y, y2), zz = hn::Mul(z, z2);
  const V xy = hn::Mul(x, y2), xz = hn::Mul(x, z2), yz = hn::Mul(y, z2);
  const V wx = hn::Mul(w, x2), wy = hn::Mul(w, y2), wz = hn::Mul(w, z2);
  const V one = set(1.0f);
  columns[0] = {hn::Sub(one, hn::Add(yy, zz)), hn::Add(xy, wz), hn::Sub(xz, wy)};
  columns[1] = {hn::Sub(xy, wz), hn::Sub(one, hn::Add(xx, zz)), hn::Add(yz, wx)};
  columns[2] = {hn::Add(xz, wy), hn::Sub(yz, wx), hn::Sub(one, hn::Add(xx, yy))};
}

// Bounds [px] of one coordinate of an ellipsoid, tangentBounds() of shaders/shared/splat.h with c = its centre's ray.
// lm, lz: the rows of its root for that coordinate and for z, over the centre's z. Lanes that touch the plane z = 0,
// or that are too wide for squares in float, leave `bounded`.
struct Bounds {
  V low, high;
};
HWY_INLINE Bounds tangentBounds(V c, V3 lm, V3 lz, V center, double focal, M& bounded) {
  const V3 e = subtractScaled(lz, c, lm);
  const V denominator = hn::Sub(set(1.0f), dot(lz, lz));
  const V ee = dot(e, e);
  bounded = hn::And(bounded, hn::And(hn::Gt(denominator, set(1e-4f)), hn::Lt(ee, set(1e30f))));
  const V3 ez = cross(e, lz);
  const V root = hn::Sqrt(hn::Max(hn::Sub(ee, dot(ez, ez)), hn::Zero(f)));
  const V middle = hn::Neg(dot(e, lz));
  const V scale = hn::Div(set(focal), denominator);
  return {hn::MulAdd(hn::Sub(middle, root), scale, center), hn::MulAdd(hn::Add(middle, root), scale, center)};
}

// First and one past the last pixel whose centre lies in `bounds`, within [0, size). The slack covers float rounding.
struct PixelRange {
  VI begin, end;
};
HWY_INLINE PixelRange pixelRange(Bounds bounds, M bounded, int size) {
  const V most = hn::Set(f, static_cast<float>(size));
  const V slack = hn::MulAdd(hn::Sub(bounds.high, bounds.low), set(1e-4f), set(0.02f));
  const V low = hn::Max(hn::Zero(f), hn::Min(hn::Sub(bounds.low, hn::Add(slack, set(0.5f))), most));
  const V high = hn::Max(hn::Zero(f), hn::Min(hn::Add(bounds.high, hn::Add(slack, set(0.5f))), most));
  return {hn::ConvertTo(fi, hn::IfThenElseZero(bounded, hn::Ceil(low))),
          hn::ConvertTo(fi, hn::IfThenElse(bounded, hn::Floor(high), most))};
}

// Column k of the rows: 4 floats of each lane, one lane after another.
struct Quad {
  alignas(64) float of[4 * kLanes];
};
HWY_INLINE void putQuad(V a, V b, V c, V d, Quad& out) { hn::StoreInterleaved4(a, b, c, d, f, out.of); }
HWY_INLINE void copyQuad(const Quad& from, unsigned lane, float* to) { std::copy_n(from.of + 4 * lane, 4, to); }

HWY_INLINE void putTexture(const ProjectArgs& args, std::uint32_t gaussian, PictureHit& hit) {
  hit.gaussian = gaussian;
  hit.texel_offset = 0;
  hit.texture_width = hit.texture_height = 0;
  hit.texel_density = 0.0f;
  if (!args.view.textured() || args.model.atlas.rects.empty()) return;
  const TextureRect& rect = args.model.atlas.rects[gaussian];
  if (rect.texelCount() == 0) return;
  hit.texel_offset = rect.offset;
  hit.texture_width = rect.width;
  hit.texture_height = rect.height;
  if (!args.view.texel_density) return;
  hit.texel_density =
      texelDensity(hit.wx, hit.wy, hit.d0, rect.width, rect.height, static_cast<uint>(args.view.intersection));
}

// Records without colours of up to kLanes Gaussians of `seen`, from `first` on; the visible ones are appended. Returns
// their number, and leaves at `appended` which place of `seen` each comes from.
HWY_INLINE std::size_t putRecords(const ProjectArgs& args, const Seen& seen, std::size_t first, std::size_t at,
                                  std::uint32_t* appended) {
  const View& view = args.view;
  const GaussianModel& model = args.model;
  const bool plane = view.intersection == IntersectionModel::plane;
  const V zero = hn::Zero(f), one = set(1.0f);
  Quad rotations;
  alignas(64) float log_scales[3 * kLanes + 1], logits[kLanes], has_texture[kLanes];
  const bool textured = view.textured() && !model.atlas.rects.empty();
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const auto i = std::size_t{seen.gaussian[std::min(first + lane, seen.count - 1)]};
    std::copy_n(&model.rotation[i].x, 4, rotations.of + 4 * lane);
    std::copy_n(&model.log_scale[i].x, 3, log_scales + 3 * lane);
    logits[lane] = model.opacity_logit[i];
    has_texture[lane] = textured && model.atlas.rects[i].texelCount() > 0 ? 1.0f : 0.0f;
  }
  const V z = hn::LoadU(f, seen.z + first);
  const V ray_x = hn::LoadU(f, seen.ray_x + first);
  const V ray_y = hn::LoadU(f, seen.ray_y + first);
  const V center_x = hn::LoadU(f, seen.center_x + first);
  const V center_y = hn::LoadU(f, seen.center_y + first);

  // Local axes in camera space: c the shortest, the lowest index on ties; a and b the others in index order.
  const V3 ls = load3(log_scales);
  const M one_shorter = hn::Lt(ls.y, ls.x);
  const M shortest_2 = hn::Lt(ls.z, hn::Min(ls.x, ls.y));
  const M shortest_1 = hn::AndNot(shortest_2, one_shorter);
  const M shortest_0 = hn::Not(hn::Or(shortest_2, one_shorter));
  V3 columns[3];
  {
    V w, x, y, q;
    hn::LoadInterleaved4(f, rotations.of, w, x, y, q);
    rotationColumns(w, x, y, q, columns);
  }
  const glm::mat3 r(view.rotation);
  const auto ordered = [&](V a, V b, V c) HWY_ATTR {
    return V3{hn::IfThenElse(shortest_0, b, a), hn::IfThenElse(shortest_2, b, c),
              hn::IfThenElse(shortest_2, c, hn::IfThenElse(shortest_1, b, a))};
  };
  V3 rotation[3];  // row k: coordinate k in camera space of the axes a, b, c
  for (int k = 0; k < 3; ++k) {
    const V3 row = {set(r[0][k]), set(r[1][k]), set(r[2][k])};
    rotation[k] = ordered(dot(row, columns[0]), dot(row, columns[1]), dot(row, columns[2]));
  }
  const auto exp = [](V a) HWY_ATTR { return hn::Exp(f, hn::Max(set(-80.0f), hn::Min(a, set(88.0f)))); };
  V3 scale = scaled(ordered(exp(ls.x), exp(ls.y), exp(ls.z)), set(view.splat_scale));
  {  // drawnScale() of shaders/shared/splat.h
    const V most = hn::Min(hn::Max(scale.x, hn::Max(scale.y, scale.z)), set(kScaleMax));
    const V least = hn::Mul(most, set(kThinnest));
    for (V* each : {&scale.x, &scale.y, &scale.z}) *each = hn::Min(hn::Max(*each, least), most);
  }
  V opacity_factor = one;
  if (view.antialias) {  // docs/math.md 1.4
    const V pixel = hn::Div(z, set(std::max(view.focal.x, view.focal.y)));
    const V add_variance = hn::Mul(set(kScreenVariance), hn::Mul(pixel, pixel));
    const auto wider = [&](V s) HWY_ATTR { return hn::Sqrt(hn::MulAdd(s, s, add_variance)); };
    const V3 wide_scale = {wider(scale.x), wider(scale.y), wider(scale.z)};
    const V3 ratio = {hn::Div(scale.x, wide_scale.x), hn::Div(scale.y, wide_scale.y), hn::Div(scale.z, wide_scale.z)};
    opacity_factor = hn::Mul(ratio.x, ratio.y);
    if (!plane) {
      const V3 along = addScaled(rotation[0], ray_x, addScaled(rotation[1], ray_y, rotation[2]));
      const V3 inverse = {hn::Div(one, wide_scale.x), hn::Div(one, wide_scale.y), hn::Div(one, wide_scale.z)};
      const V3 after = product(along, inverse);
      // In units of the least scale, so that nothing overflows.
      const V least = hn::Min(scale.x, hn::Min(scale.y, scale.z));
      const V3 times = {hn::Div(least, scale.x), hn::Div(least, scale.y), hn::Div(least, scale.z)};
      const V before = hn::Div(length(product(along, times)), least);
      opacity_factor = hn::Mul(opacity_factor, hn::Div(hn::Mul(ratio.z, before), length(after)));
    }
    scale = wide_scale;
  }

  // Everything in units of the longest axis.
  const V longest = hn::Max(scale.x, hn::Max(scale.y, scale.z));
  const V3 inverse = {hn::Div(longest, scale.x), hn::Div(longest, scale.y), hn::Div(longest, scale.z)};
  const V3 others = {hn::Mul(inverse.y, inverse.z), hn::Mul(inverse.x, inverse.z), hn::Mul(inverse.x, inverse.y)};
  const V3 m[3] = {product(inverse, rotation[0]), product(inverse, rotation[1]), product(inverse, rotation[2])};
  const V3 ny = product(others, rotation[1]);  // m[2] x m[0], up to the sign of the axes' order
  const V3 nz = product(others, rotation[2]);  // m[0] x m[1]
  V3 d0 = addScaled(m[0], ray_x, addScaled(m[1], ray_y, m[2]));
  const V unit = hn::Div(one, length(d0));
  const V inverse_fx = set(1.0 / view.focal.x), inverse_fy = set(1.0 / view.focal.y);
  const V w_unit = hn::Mul(set(kExponentScale), hn::Div(hn::Mul(unit, z), longest));
  // m[0] x d0 = ray_y nz - ny and m[1] x d0 = nx - ray_x nz
  V3 wx = subtractScaled(nz, ray_y, ny);
  V3 wy = subtractScaled(nz, ray_x, product(others, rotation[0]));
  if (plane) wx.z = wy.z = zero;
  const V length_wx = length(wx);
  const V inverse_wx = hn::Div(one, length_wx);
  const V w_xx = hn::Mul(hn::Mul(w_unit, inverse_fx), length_wx);
  const V w_xy = hn::Neg(hn::Mul(hn::Mul(w_unit, inverse_fy), hn::Mul(dot(wx, wy), inverse_wx)));
  // wx x wy = d0 det(m)
  const V determinant = hn::Mul(inverse.x, others.x);
  const V cross_w = hn::Mul(determinant, plane ? hn::Abs(d0.z) : hn::Div(one, unit));
  const V w_yy = hn::Mul(hn::Mul(w_unit, inverse_fy), hn::Mul(cross_w, inverse_wx));
  V d_xx, d_xy, d_x1, d_yy = zero, d_y1 = zero, d_11 = zero;
  if (plane) {
    d_xx = hn::Mul(hn::Mul(unit, inverse_fx), m[0].z);
    d_xy = hn::Mul(hn::Mul(unit, inverse_fy), m[1].z);
    d_x1 = hn::Mul(unit, d0.z);
  } else {
    const V length_x = length(m[0]);
    const V per_x = hn::Div(unit, length_x);
    const V length_nz = length(nz);
    const V inverse_nz = hn::Div(one, length_nz);
    d_xx = hn::Mul(hn::Mul(unit, inverse_fx), length_x);
    d_xy = hn::Mul(hn::Mul(per_x, inverse_fy), dot(m[0], m[1]));
    d_x1 = hn::Mul(per_x, dot(m[0], d0));
    d_yy = hn::Mul(hn::Mul(per_x, inverse_fy), length_nz);
    // (m[0] x m[1]) . (m[0] x d0) / (|m[0]| |m[0] x m[1]|)
    d_y1 = hn::Mul(hn::Mul(per_x, inverse_nz), hn::Neg(dot(nz, wx)));
    d_11 = hn::Mul(hn::Mul(unit, determinant), inverse_nz);
  }

  const V sigmoid = hn::Div(one, hn::Add(one, exp(hn::Neg(hn::Load(f, logits)))));
  const V opacity = hn::Mul(hn::Min(one, hn::Mul(sigmoid, set(view.opacity_scale))), opacity_factor);
  const V log2_opacity = hn::Log2(f, hn::Max(opacity, set(1e-30f)));
  // visibleRadius() of shaders/shared/splat.h
  const V radius2 = hn::Mul(set(2.0 * 0.69314718056 * 1.0004), hn::Add(log2_opacity, set(7.99435344f)));
  V size = hn::Add(hn::Abs(center_x), hn::Abs(center_y));
  for (const V value : {z, w_xx, w_xy, w_yy, d_xx, d_xy, d_x1, d_yy, d_y1, d_11}) size = hn::Add(size, hn::Abs(value));
  M visible = hn::And(hn::Lt(size, set(std::numeric_limits<float>::max())), hn::Gt(radius2, zero));
  visible = hn::And(visible, hn::FirstN(f, seen.count - first));

  V3 extent = scaled(scale, hn::Sqrt(hn::Max(radius2, zero)));
  if (plane) extent.z = zero;
  const V3 lz = product(extent, rotation[2]);
  M bounded = hn::Gt(z, zero);
  const V3 over_z = scaled(extent, hn::Div(one, z));
  const V3 slope = product(over_z, rotation[2]);
  const Bounds bx = tangentBounds(ray_x, product(over_z, rotation[0]), slope, center_x, view.focal.x, bounded);
  const Bounds by = tangentBounds(ray_y, product(over_z, rotation[1]), slope, center_y, view.focal.y, bounded);
  for (const V& side : {bx.low, bx.high, by.low, by.high}) {
    bounded = hn::And(bounded, hn::Lt(hn::Abs(side), set(1e30f)));  // no number: the whole image
  }
  const PixelRange x_range = pixelRange(bx, bounded, view.size.x);
  const PixelRange y_range = pixelRange(by, bounded, view.size.y);
  visible = hn::And(visible,
                    hn::RebindMask(f, hn::And(hn::Gt(x_range.end, x_range.begin), hn::Gt(y_range.end, y_range.begin))));
  const M is_textured = hn::Gt(hn::Load(f, has_texture), zero);
  const M crosses_near = hn::Le(hn::Sub(z, length(lz)), set(1.001f * view.near));

  const M has_hit = hn::Or(crosses_near, is_textured);

  const auto floats = [](VI a) HWY_ATTR { return hn::BitCast(f, a); };
  const V box_rows = floats(hn::Or(y_range.begin, hn::ShiftLeft<16>(y_range.end)));
  Quad quads[4];
  putQuad(center_x, center_y, log2_opacity, w_xx, quads[0]);
  putQuad(w_xy, w_yy, d_xx, d_xy, quads[1]);
  putQuad(d_x1, d_yy, d_y1, hn::IfThenElse(has_hit, hn::Neg(hn::Max(d_11, set(1e-30f))), d_11), quads[2]);
  putQuad(zero, zero, zero, box_rows, quads[3]);
  static_assert(kTileWidth == 16 && kTileHeight == 32);
  const VI last = hn::Set(fi, 1);
  const VI tile_x1 = hn::Add(hn::ShiftRight<4>(hn::Sub(x_range.end, last)), last);
  const VI tile_y1 = hn::Add(hn::ShiftRight<5>(hn::Sub(y_range.end, last)), last);
  Quad tiles;
  putQuad(floats(hn::Or(hn::ShiftRight<4>(x_range.begin), hn::ShiftLeft<16>(hn::ShiftRight<5>(y_range.begin)))),
          floats(hn::Or(tile_x1, hn::ShiftLeft<16>(tile_y1))), z, zero, tiles);
  Quad hits[5];
  const unsigned hit_bits = bitsOf(hn::And(has_hit, visible));
  if (hit_bits != 0) {
    const V dx_unit = hn::Mul(unit, inverse_fx), dy_unit = hn::Mul(unit, inverse_fy);
    V3 dx = scaled(m[0], dx_unit), dy = scaled(m[1], dy_unit), d0_unit = scaled(d0, unit);
    if (plane) dx.x = dx.y = dy.x = dy.y = d0_unit.x = d0_unit.y = zero;
    // The axes a, b, c are a left-handed frame where b was left out.
    const V hand = hn::IfThenElse(shortest_1, set(-1.0f), one);
    const V moment = hn::Mul(hand, hn::Div(hn::Mul(unit, z), longest));
    const V3 wx_unit = scaled(wx, hn::Neg(hn::Mul(moment, inverse_fx)));
    const V3 wy_unit = scaled(wy, hn::Mul(moment, inverse_fy));
    putQuad(wx_unit.x, wx_unit.y, wx_unit.z, wy_unit.x, hits[0]);
    putQuad(wy_unit.y, wy_unit.z, dx.x, dx.y, hits[1]);
    putQuad(dx.z, dy.x, dy.y, dy.z, hits[2]);
    putQuad(d0_unit.x, d0_unit.y, d0_unit.z, hn::Mul(z, dot(d0_unit, dx)), hits[3]);
    putQuad(hn::Mul(z, dot(d0_unit, dy)), hn::Mul(z, dot(d0_unit, d0_unit)),
            hn::IfThenElse(crosses_near, set(view.near), set(std::numeric_limits<float>::lowest())), zero, hits[4]);
  }

  std::size_t n = 0;
  for (unsigned bits = bitsOf(visible); bits != 0; bits &= bits - 1) {
    const auto lane = static_cast<unsigned>(std::countr_zero(bits));
    float* record = &args.splats[at + n].center_x;
    for (int quad = 0; quad < 4; ++quad) copyQuad(quads[quad], lane, record + 4 * quad);
    std::memcpy(&args.tiles[at + n], tiles.of + 4 * lane, sizeof(PictureTiles));
    args.depths[at + n] = std::bit_cast<std::uint32_t>(tiles.of[4 * lane + 2]);
    if ((hit_bits >> lane & 1) != 0) {
      PictureHit& hit = args.hits[at + n];
      for (int quad = 0; quad < 5; ++quad) copyQuad(hits[quad], lane, &hit.wx.x + 4 * quad);
      putTexture(args, seen.gaussian[first + lane], hit);
    }
    appended[n++] = static_cast<std::uint32_t>(first + lane);
  }
  return n;
}

// Colours of the `count` records from `at` on, which come from places `appended` of `seen`.
HWY_INLINE void putColors(const ProjectArgs& args, const Seen& seen, const std::uint32_t* appended, std::size_t at,
                          std::size_t count) {
  const View& view = args.view;
  const GaussianModel& model = args.model;
  const glm::mat3 r(view.rotation);
  const int bands = std::min(model.sh_degree, view.max_sh_degree) + 1;
  const int used = bands * bands, stored = static_cast<int>(model.shCount());
  using F4 = HWY_CAPPED(float, 4);
  constexpr F4 f4;
  constexpr std::size_t kParts = 4 / hn::MaxLanes(F4());
  for (std::size_t k = 0; k < count; k += kLanes) {
    alignas(64) float ray_x[kLanes], ray_y[kLanes];
    const std::size_t lanes = std::min(kLanes, count - k);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::uint32_t from = appended[k + std::min(lane, lanes - 1)];
      ray_x[lane] = seen.ray_x[from];
      ray_y[lane] = seen.ray_y[from];
    }
    const V x = hn::Load(f, ray_x), y = hn::Load(f, ray_y);
    const V unit = hn::Div(set(1.0f), hn::Sqrt(hn::MulAdd(x, x, hn::MulAdd(y, y, set(1.0f)))));
    const auto world = [&](int axis) HWY_ATTR {
      return hn::Mul(unit, hn::MulAdd(set(r[axis].x), x, hn::MulAdd(set(r[axis].y), y, set(r[axis].z))));
    };
    alignas(64) float basis[kShMax][kLanes];
    shBasis(f, world(0), world(1), world(2), used, basis[0]);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const auto gaussian = std::size_t{seen.gaussian[appended[k + lane]]};
      const float* sh = &model.sh[gaussian * static_cast<std::size_t>(stored)].x;
      // Three floats of each load count; the last coefficient is loaded so that no load passes the array's end.
      hn::Vec<F4> even[kParts], odd[kParts];
      for (std::size_t part = 0; part < kParts; ++part) {
        even[part] = hn::Set(f4, 0.5f);
        odd[part] = hn::Zero(f4);
      }
      int c = 0;
      for (; c + 2 < used; c += 2) {
        for (std::size_t part = 0; part < kParts; ++part) {
          const float* at_part = sh + 3 * c + part * (4 / kParts);
          even[part] = hn::MulAdd(hn::Set(f4, basis[c][lane]), hn::LoadU(f4, at_part), even[part]);
          odd[part] = hn::MulAdd(hn::Set(f4, basis[c + 1][lane]), hn::LoadU(f4, at_part + 3), odd[part]);
        }
      }
      alignas(16) float sum[4];
      for (std::size_t part = 0; part < kParts; ++part) {
        hn::Store(hn::Add(even[part], odd[part]), f4, sum + part * (4 / kParts));
      }
      glm::vec3 color(sum[0], sum[1], sum[2]);
      for (; c < used; ++c) color += basis[c][lane] * glm::vec3(sh[3 * c], sh[3 * c + 1], sh[3 * c + 2]);
      color = glm::max(color, glm::vec3(0.0f));
      args.splats[at + k + lane].base = color;
      // What float cannot hold is not drawn.
      if (!(color.x + color.y + color.z < std::numeric_limits<float>::max())) args.tiles[at + k + lane] = {0, 0, 0, 0};
    }
  }
}

}  // namespace

// Gaussians [begin, end): records from `begin` on. Returns their number.
std::size_t projectChunk(const ProjectArgs& args, std::size_t begin, std::size_t end) {
  const Frustum frustum = makeFrustum(args.view);
  Seen seen;
  std::uint32_t appended[kPictureBlock + kLanes];
  std::size_t at = begin;
  for (std::size_t block = begin; block < end; block += kPictureBlock) {
    findSeen(args, frustum, block, std::min(end, block + kPictureBlock), seen);
    std::size_t count = 0;
    for (std::size_t k = 0; k < seen.count; k += kLanes) {
      count += putRecords(args, seen, k, at + count, appended + count);
    }
    putColors(args, seen, appended, at, count);
    at += count;
  }
  return at - begin;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(projectChunk);

namespace {

template <typename Visit>
void forEachTile(const PictureTiles& range, int tiles_x, const Visit& visit) {
  for (int y = range.y0; y < range.y1; ++y) {
    for (int x = range.x0; x < range.x1; ++x) visit(static_cast<std::size_t>(y * tiles_x + x));
  }
}

}  // namespace

void projectPicture(const View& view, const GaussianModel& model, PictureScene& scene) {
  TG_ASSERT(std::max(view.size.x, view.size.y) <= kMaxPictureSide, "16 bits hold the picture's sides");
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  const std::size_t count = model.size();
  // Few enough chunks that their counters (chunks x tiles) stay small beside the pairs.
  scene.chunk = std::max<std::size_t>(4096, (count / 64 / kPictureBlock + 1) * kPictureBlock);
  const std::size_t chunks = (count + scene.chunk - 1) / scene.chunk;
  scene.tiles_x = (view.size.x + kTileWidth - 1) / kTileWidth;
  scene.tiles_y = (view.size.y + kTileHeight - 1) / kTileHeight;
  const std::size_t tiles = static_cast<std::size_t>(scene.tiles_x) * static_cast<std::size_t>(scene.tiles_y);
  const ProjectArgs args{view,
                         model,
                         scene.splats.reserve(count),
                         scene.hits.reserve(count),
                         scene.depths.reserve(count),
                         scene.tiles.reserve(count)};
  scene.visible.assign(chunks, 0);
  scene.next.resize(chunks * tiles);
  parallelFor(static_cast<std::int64_t>(chunks), 1, [&](std::int64_t chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * scene.chunk;
    const std::size_t visible = HWY_DYNAMIC_DISPATCH(projectChunk)(args, begin, std::min(count, begin + scene.chunk));
    scene.visible[chunk] = static_cast<std::uint32_t>(visible);
    std::uint32_t* counts = scene.next.data() + static_cast<std::size_t>(chunk) * tiles;
    std::fill_n(counts, tiles, 0u);
    for (std::size_t k = begin; k < begin + visible; ++k) {
      forEachTile(args.tiles[k], scene.tiles_x, [&](std::size_t tile) { ++counts[tile]; });
    }
  });
}

void listPicture(PictureScene& scene) {
  TG_ASSERT(scene.chunk > 0, "projectPicture() comes first");
  const std::size_t tiles = static_cast<std::size_t>(scene.tiles_x) * static_cast<std::size_t>(scene.tiles_y);
  const std::size_t chunks = scene.visible.size();
  scene.begin.resize(tiles + 1);
  std::uint64_t at = 0;
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    scene.begin[tile] = static_cast<std::uint32_t>(at);
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
      const std::uint32_t n = scene.next[chunk * tiles + tile];
      scene.next[chunk * tiles + tile] = static_cast<std::uint32_t>(at);
      at += n;
    }
    if (at > std::numeric_limits<std::uint32_t>::max()) {
      throw Error(ErrorKind::badData, "model", "too many large Gaussians (expected below 2^32 splats over all tiles)");
    }
  }
  scene.begin[tiles] = static_cast<std::uint32_t>(at);
  std::uint64_t* pairs = scene.pairs.reserve(at);
  const std::uint32_t* depths = scene.depths.data();
  const PictureTiles* ranges = scene.tiles.data();
  parallelFor(static_cast<std::int64_t>(chunks), 1, [&](std::int64_t chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * scene.chunk;
    std::uint32_t* next = scene.next.data() + static_cast<std::size_t>(chunk) * tiles;
    for (std::size_t k = begin; k < begin + scene.visible[chunk]; ++k) {
      const std::uint64_t pair = std::uint64_t{depths[k]} << 32 | k;
      forEachTile(ranges[k], scene.tiles_x, [&](std::size_t tile) { pairs[next[tile]++] = pair; });
    }
  });
}

}  // namespace tg::cpu
#endif
