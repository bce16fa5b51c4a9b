// SPDX-License-Identifier: Apache-2.0
// Camera, spherical harmonics and screen boxes: a batch of Gaussians at a time on all threads.
#include "render/cpu/project.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/project.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "render/cpu/geometry-inl.h"
#include "render/cpu/sh-inl.h"
#include "shared/limits.h"
#include "shared/splat.h"

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace {

// Writes one member of up to kBatch records.
struct SplatWriter {
  Splat* splats;
  int count;

  HWY_INLINE void put(float Splat::* member, VD value) const {
    alignas(64) float lanes[kBatch];
    hn::Store(hn::DemoteTo(dbf, value), dbf, lanes);
    for (int lane = 0; lane < count; ++lane) splats[lane].*member = lanes[lane];
  }
  HWY_INLINE void put(glm::vec3 Splat::* member, V3 value) const {
    alignas(64) float lanes[3][kBatch];
    hn::Store(hn::DemoteTo(dbf, value.x), dbf, lanes[0]);
    hn::Store(hn::DemoteTo(dbf, value.y), dbf, lanes[1]);
    hn::Store(hn::DemoteTo(dbf, value.z), dbf, lanes[2]);
    for (int lane = 0; lane < count; ++lane) {
      splats[lane].*member = glm::vec3(lanes[0][lane], lanes[1][lane], lanes[2][lane]);
    }
  }
};

// Bounds of one normalised image coordinate of an ellipsoid, tangentBounds() of shaders/shared/splat.h. lm, lz: the
// rows of its root for that coordinate and for z. Lanes that touch the plane z = 0 leave `bounded`.
struct Bounds {
  VD low, high;
};
HWY_INLINE Bounds tangentBounds(VD m, VD z, V3 lm, V3 lz, MD& bounded) {
  const VD c = hn::Div(m, z);
  const V3 e = subtract(lm, scaled(lz, c));
  const VD zz = hn::Mul(z, z);
  const VD denominator = hn::Sub(zz, dot(lz, lz));
  bounded = hn::And(bounded, hn::Gt(denominator, hn::Mul(splat(1e-6), zz)));
  const V3 ez = cross(e, lz);
  const VD root = hn::Sqrt(hn::Max(hn::MulSub(zz, dot(e, e), dot(ez, ez)), hn::Zero(dd)));
  const VD middle = hn::Neg(dot(e, lz));
  return {hn::Add(c, hn::Div(hn::Sub(middle, root), denominator)),
          hn::Add(c, hn::Div(hn::Add(middle, root), denominator))};
}

// First and one past the last pixel whose centre lies in [low, high], within [0, size). The slack covers float
// rounding.
HWY_INLINE void pixelRange(double low, double high, int size, std::int32_t& begin, std::int32_t& end) {
  const double slack = 0.01;
  begin = static_cast<std::int32_t>(std::ceil(std::clamp(low - 0.5 - slack, 0.0, static_cast<double>(size))));
  end = static_cast<std::int32_t>(std::floor(std::clamp(high + 0.5 + slack, 0.0, static_cast<double>(size))));
}

// Screen box, row margin and screen radius; the box stays empty in lanes that are not `visible`.
HWY_INLINE void putBoxes(const View& view, const Geometry& g, VD radius, MD visible, const SplatWriter& out,
                         float* screen_radius) {
  V3 extent = scaled(g.scale, radius);
  if (view.intersection == IntersectionModel::plane) extent.z = hn::Zero(dd);
  const auto root = [&](VD a, VD b, VD c) HWY_ATTR { return product(extent, {a, b, c}); };
  const V3 lx = root(g.axes_c[0].x, g.axes_c[1].x, g.axes_c[2].x);
  const V3 ly = root(g.axes_c[0].y, g.axes_c[1].y, g.axes_c[2].y);
  const V3 lz = root(g.axes_c[0].z, g.axes_c[1].z, g.axes_c[2].z);
  const VD z = g.mean_c.z;
  MD bounded = hn::Gt(z, hn::Zero(dd));
  const Bounds bx = tangentBounds(g.mean_c.x, z, lx, lz, bounded);
  const Bounds by = tangentBounds(g.mean_c.y, z, ly, lz, bounded);
  const glm::dvec2 f = view.focal, c = view.center;
  VD box[4] = {hn::MulAdd(bx.low, splat(f.x), splat(c.x)), hn::MulAdd(by.low, splat(f.y), splat(c.y)),
               hn::MulAdd(bx.high, splat(f.x), splat(c.x)), hn::MulAdd(by.high, splat(f.y), splat(c.y))};
  const VD most = splat(1e30);  // beyond it, and for no number at all, the whole image
  for (const VD& side : box) bounded = hn::And(bounded, hn::Lt(hn::Abs(side), most));
  const double whole[4] = {0.0, 0.0, static_cast<double>(view.size.x), static_cast<double>(view.size.y)};
  alignas(64) double boxes[4][kBatch];
  for (int side = 0; side < 4; ++side) {
    hn::Store(hn::IfThenElse(bounded, box[side], splat(whole[side])), dd, boxes[side]);
  }
  alignas(64) double shows[kBatch];
  alignas(64) double nearest[kBatch];
  hn::Store(hn::IfThenElseZero(visible, splat(1.0)), dd, shows);
  hn::Store(hn::Sub(z, length(lz)), dd, nearest);
  for (int lane = 0; lane < out.count; ++lane) {
    Splat& s = out.splats[lane];
    s.x0 = s.y0 = s.x1 = s.y1 = 0;
    screen_radius[lane] = 0.0f;
    s.near = nearest[lane] <= view.near * 1.001 ? view.near : 0.0f;
    const double width = boxes[2][lane] - boxes[0][lane];
    const double height = boxes[3][lane] - boxes[1][lane];
    s.margin = 0.05f + 1e-3f * static_cast<float>(width);
    if (shows[lane] == 0.0) continue;
    pixelRange(boxes[0][lane], boxes[2][lane], view.size.x, s.x0, s.x1);
    pixelRange(boxes[1][lane], boxes[3][lane], view.size.y, s.y0, s.y1);
    if (s.x0 < s.x1 && s.y0 < s.y1) screen_radius[lane] = static_cast<float>(0.5 * std::max(width, height));
  }
}

HWY_INLINE void putTexture(const View& view, const GaussianModel& model, Splat& s) {
  s.texel_offset = 0;
  s.texture_width = s.texture_height = 0;
  s.texel_density = 0.0f;
  if (model.atlas.rects.empty() || !view.textured()) return;
  const TextureRect& rect = model.atlas.rects[s.gaussian];
  s.texel_offset = rect.offset;
  if (rect.texelCount() == 0) return;
  s.texture_width = rect.width;
  s.texture_height = rect.height;
  if (!view.texel_density) return;
  s.texel_density = texelDensity(s.wx, s.wy, s.d0, rect.width, rect.height, static_cast<uint>(view.intersection));
}

// The first `count` coefficients count.
HWY_INLINE glm::vec3 baseColor(const GaussianModel& model, std::uint32_t gaussian, const ShBasis& basis, int count,
                               int lane) {
  const glm::vec3* sh = model.sh.data() + gaussian * model.shCount();
  glm::vec3 color(0.5f);
  for (int k = 0; k < count; ++k) color += basis.at[k][lane] * sh[k];
  return glm::max(color, glm::vec3(0.0f));
}

// The records of `count` <= kBatch Gaussians; gaussians holds kBatch indices.
void projectBatch(const View& view, const GaussianModel& model, const std::uint32_t* gaussians, int count,
                  Splat* splats, float* screen_radius) {
  const SplatWriter out{splats, count};
  const Batch batch = loadBatch(model, gaussians);
  const Geometry g = makeGeometry(view, batch);
  const VD inverse_z = hn::Div(splat(1.0), g.mean_c.z);
  const VD center_x = hn::MulAdd(hn::Mul(g.mean_c.x, inverse_z), splat(view.focal.x), splat(view.center.x));
  const VD center_y = hn::MulAdd(hn::Mul(g.mean_c.y, inverse_z), splat(view.focal.y), splat(view.center.y));
  const VD t[3] = {hn::Mul(g.mean_c.z, dot(g.power_d[2], g.power_d[0])),
                   hn::Mul(g.mean_c.z, dot(g.power_d[2], g.power_d[1])),
                   hn::Mul(g.mean_c.z, dot(g.power_d[2], g.power_d[2]))};
  const VD unit_w = splat(kExponentScale);
  const VD w[3] = {hn::Mul(unit_w, g.w_xx), hn::Mul(unit_w, g.w_xy), hn::Mul(unit_w, g.w_yy)};
  out.put(&Splat::center_x, center_x);
  out.put(&Splat::center_y, center_y);
  out.put(&Splat::depth, g.mean_c.z);
  out.put(&Splat::w_xx, w[0]);
  out.put(&Splat::w_xy, w[1]);
  out.put(&Splat::w_yy, w[2]);
  out.put(&Splat::d_xx, g.d_xx);
  out.put(&Splat::d_xy, g.d_xy);
  out.put(&Splat::d_x1, g.d_x1);
  out.put(&Splat::d_yy, g.d_yy);
  out.put(&Splat::d_y1, g.d_y1);
  out.put(&Splat::d_11, g.d_11);
  out.put(&Splat::t_x, t[0]);
  out.put(&Splat::t_y, t[1]);
  out.put(&Splat::t_1, t[2]);
  const V3 normal = g.axes_c[2];
  const MD away = hn::Gt(dot(normal, g.mean_c), hn::Zero(dd));
  out.put(&Splat::normal, select(away, scaled(normal, splat(-1.0)), normal));
  out.put(&Splat::wx, g.power_w[0]);
  out.put(&Splat::wy, g.power_w[1]);
  out.put(&Splat::dx, g.power_d[0]);
  out.put(&Splat::dy, g.power_d[1]);
  out.put(&Splat::d0, g.power_d[2]);
  out.put(&Splat::kappa, g.kappa);
  out.put(&Splat::kappa_first, hn::Mul(unit_w, dot(g.kappa, g.w_first)));
  out.put(&Splat::kappa_second, hn::Mul(hn::Mul(unit_w, unit_w), dot(g.kappa, g.w_second)));

  ShBasis basis;
  const int bands = std::min(model.sh_degree, view.max_sh_degree) + 1;
  shBasis(directionsTo(view, batch.mean), bands * bands, basis);
  alignas(64) double opacity_factor[kBatch];
  hn::Store(g.opacity_factor, dd, opacity_factor);
  alignas(64) double radius[kBatch] = {};
  float finite_base[kBatch] = {};
  for (int lane = 0; lane < count; ++lane) {
    Splat& s = splats[lane];
    s.gaussian = gaussians[lane];
    s.opacity = std::min(1.0f, sigmoidf(model.opacity_logit[s.gaussian]) * view.opacity_scale) *
                static_cast<float>(opacity_factor[lane]);
    s.log2_opacity = std::log2(s.opacity);
    radius[lane] = visibleRadius(s.opacity);
    if (view.fixed_radius > 0.0f && radius[lane] > 0.0) radius[lane] = view.fixed_radius;
    s.radius2 = static_cast<float>(kExponentScale * kExponentScale * radius[lane] * radius[lane]);
    s.base = baseColor(model, s.gaussian, basis, bands * bands, lane);
    finite_base[lane] = s.base.x + s.base.y + s.base.z + s.log2_opacity;
    putTexture(view, model, s);
  }
  // What float cannot hold is not drawn.
  VD size = hn::Add(hn::Abs(center_x), hn::Abs(center_y));
  for (const VD value : {g.mean_c.z, w[0], w[1], w[2], g.d_xx, g.d_xy, g.d_x1, g.d_yy, g.d_y1, g.d_11, t[0], t[1], t[2],
                         hn::PromoteTo(dd, hn::LoadU(dbf, finite_base))}) {
    size = hn::Add(size, hn::Abs(value));
  }
  const VD r = hn::Load(dd, radius);
  const MD visible = hn::And(hn::Lt(size, splat(std::numeric_limits<float>::max())), hn::Gt(r, hn::Zero(dd)));
  putBoxes(view, g, r, visible, out, screen_radius);
}

int projectBatchSize() { return kBatch; }

}  // namespace
}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
namespace {

HWY_EXPORT(projectBatch);
HWY_EXPORT(projectBatchSize);

constexpr int kMaxBatch = 8;  // Gaussians in a batch of any target

// Whether 255 opacity > 1, mostly without computing it.
bool visible(float logit, float opacity_scale) {
  constexpr float kSurely = -5.0f;  // a logit with 1.7 / 255
  return (logit > kSurely && opacity_scale >= 1.0f) || sigmoidf(logit) * opacity_scale * 255.0f > 1.0f;
}

// Nothing of the Gaussian can be on the image.
bool misses(const Frustum& frustum, glm::dvec3 mean_c, glm::vec3 log_scale) {
  const double longest = std::exp(std::max({log_scale.x, log_scale.y, log_scale.z}));
  const double reach = frustum.reach * longest + frustum.pixel * std::abs(mean_c.z);
  for (const glm::dvec3& plane : frustum.planes) {
    if (glm::dot(plane, mean_c) < -reach) return true;
  }
  return false;
}

bool inside(const CropBox& box, glm::vec3 x) {
  return glm::all(glm::lessThanEqual(box.min, x)) && glm::all(glm::lessThanEqual(x, box.max));
}

}  // namespace

View makeView(const GaussianModel& model, const Camera& camera, const RenderSettings& settings) {
  checkSettings(settings);
  if (camera.size.x <= 0 || camera.size.y <= 0 || !(camera.focal.x > 0.0) || !(camera.focal.y > 0.0)) {
    throw Error(ErrorKind::usage, "camera " + camera.name,
                "empty image or focal length (expected sizes above 0, found " + std::to_string(camera.size.x) + " x " +
                    std::to_string(camera.size.y) + ", fx " + std::to_string(camera.focal.x) + ", fy " +
                    std::to_string(camera.focal.y) + ")");
  }
  const unsigned mode = static_cast<unsigned>(model.texture_mode) & static_cast<unsigned>(settings.textures);
  View view{camera};
  view.eye = camera.position();
  view.background = settings.background;
  view.texture_rgb = (mode & kModeRgb) != 0u;
  view.texture_alpha = (mode & kModeAlpha) != 0u;
  view.intersection = settings.intersection.value_or(model.intersection);
  view.antialias_for = view.intersection;
  view.outside = settings.outside.value_or(model.outside);
  view.order = settings.order;
  view.antialias = settings.antialiasing == Antialiasing::screen;
  view.footprint = settings.texture_filter == TextureFilter::footprint && view.textured();
  view.texel_density = view.footprint || (settings.outputs.has(Output::texelDensity) && view.textured());
  view.opacity_scale = settings.opacity_scale;
  view.splat_scale = settings.splat_scale;
  view.max_sh_degree = settings.max_sh_degree;
  view.near = settings.near;
  view.crop = settings.crop;
  return view;
}

Frustum makeFrustum(const View& view) {
  const glm::dvec3 low = ray(view, {0, 0}), high = ray(view, view.size);
  constexpr double kMostRadius = 3.34;  // [sigma] visibleRadius(1), rounded up
  return {{glm::normalize(glm::dvec3(1, 0, -low.x)), glm::normalize(glm::dvec3(-1, 0, high.x)),
           glm::normalize(glm::dvec3(0, 1, -low.y)), glm::normalize(glm::dvec3(0, -1, high.y))},
          kMostRadius * view.splat_scale,
          2.0 / std::min(view.focal.x, view.focal.y)};
}

void findDepthOrder(const View& view, const GaussianModel& model, DepthOrder& out) {
  std::vector<DepthKey> keys;
  findVisible(view, model, out.gaussians, keys);
  sortByDepth(keys, out.order);
}

void findVisible(const View& view, const GaussianModel& model, std::vector<std::uint32_t>& gaussians,
                 std::vector<DepthKey>& keys) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  constexpr std::size_t kChunk = 4096;
  const Frustum frustum = makeFrustum(view);
  const std::size_t chunks = (model.size() + kChunk - 1) / kChunk;
  keys.resize(model.size());
  std::vector<std::size_t> counts(chunks, 0);
  const auto range = [&](std::size_t chunk) {
    return std::pair(chunk * kChunk, std::min(model.size(), (chunk + 1) * kChunk));
  };
  parallelFor(static_cast<std::int64_t>(chunks), 1, [&](std::int64_t chunk) {
    const auto [begin, end] = range(chunk);
    std::size_t next = begin;
    for (std::size_t i = begin; i < end; ++i) {
      const glm::dvec3 mean_c = cameraFromWorld(view, model.mean[i]);
      const double z = mean_c.z;
      if (!(z > view.near) || !visible(model.opacity_logit[i], view.opacity_scale)) continue;
      if (misses(frustum, mean_c, model.log_scale[i])) continue;
      if (view.crop && !inside(*view.crop, model.mean[i])) continue;
      keys[next++] = {std::bit_cast<std::uint32_t>(static_cast<float>(z)), static_cast<std::uint32_t>(i)};
    }
    counts[chunk] = next - begin;
  });
  std::size_t kept = 0;
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    const auto from = keys.begin() + static_cast<std::ptrdiff_t>(range(chunk).first);
    std::copy(from, from + static_cast<std::ptrdiff_t>(counts[chunk]),
              keys.begin() + static_cast<std::ptrdiff_t>(kept));
    kept += counts[chunk];
  }
  keys.resize(kept);
  gaussians.resize(kept);
  for (std::size_t k = 0; k < kept; ++k) {
    gaussians[k] = keys[k].index;
    keys[k].index = static_cast<std::uint32_t>(k);
  }
}

void sortByDepth(std::vector<DepthKey>& keys, std::vector<std::uint32_t>& order) {
  sortByKey(keys);
  order.resize(keys.size());
  for (std::size_t k = 0; k < keys.size(); ++k) order[k] = keys[k].index;
}

void projectSplats(const View& view, const GaussianModel& model, const std::vector<std::uint32_t>& gaussians,
                   ScreenSplats& out) {
  TG_ASSERT(gaussians.empty() || gaussians.back() < model.size(), "the model has these Gaussians");
  TG_ASSERT(std::is_sorted(gaussians.begin(), gaussians.end()), "Gaussians come in the model's order");
  constexpr std::size_t kChunk = 256;  // Gaussians per grab: some ten microseconds
  const std::size_t count = gaussians.size();
  out.splats.resize(count);
  out.screen_radius.resize(count);
  const auto batch = static_cast<std::size_t>(HWY_DYNAMIC_DISPATCH(projectBatchSize)());
  parallelFor(static_cast<std::int64_t>((count + kChunk - 1) / kChunk), 1, [&](std::int64_t chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * kChunk;
    const std::size_t end = std::min(count, begin + kChunk);
    for (std::size_t k = begin; k < end; k += batch) {
      std::uint32_t lanes[kMaxBatch];
      for (std::size_t lane = 0; lane < batch; ++lane) lanes[lane] = gaussians[std::min(k + lane, end - 1)];
      HWY_DYNAMIC_DISPATCH(projectBatch)
      (view, model, lanes, static_cast<int>(std::min(batch, end - k)), &out.splats[k], &out.screen_radius[k]);
    }
  });
}

}  // namespace tg::cpu
#endif
