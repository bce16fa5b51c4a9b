// SPDX-License-Identifier: Apache-2.0
// The float formulas of shaders/shared against float64, on thousands of Gaussians of every shape; and a plain float
// loop over all Gaussians, which sets the tolerances that the fast renderers are held to.
#include "shared/splat.h"

#include <algorithm>
#include <cmath>

#include "render/reference/reference.h"
#include "render/reference/splat.h"
#include "shared/sh.h"
#include "shared/texture.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

// A Gaussian in float as every fast renderer prepares it, and the record made of it.
struct FloatSplat {
  std::uint32_t gaussian = 0;
  vec3 mean_c;
  mat3 axes_c;  // ordered a, b, c
  vec3 scale;
  float opacity = 0;
  vec3 base;
  vec3 normal;
  Splat record;
};

mat3 cameraRotation(const Camera& camera) { return mat3(camera.rotation); }

vec3 baseColor(const GaussianModel& model, std::uint32_t i, vec3 direction) {
  vec4 b[4];
  shBasis(direction, b[0], b[1], b[2], b[3]);
  vec3 color(0.5f);
  for (std::size_t k = 0; k < model.shCount(); ++k) color += b[k / 4][k % 4] * model.sh[std::size_t{i} * model.shCount() + k];
  return glm::max(color, vec3(0.0f));
}

FloatSplat makeFloatSplat(const GaussianModel& model, const Camera& camera, std::uint32_t i) {
  FloatSplat s;
  s.gaussian = i;
  const mat3 rotation_c = cameraRotation(camera);
  s.mean_c = rotation_c * model.mean[i] + vec3(camera.translation);
  const mat3 axes = rotation_c * rotationFromQuaternion(model.rotation[i]);
  const vec3 scale = glm::exp(model.log_scale[i]);
  const int c = shortestAxis(scale);
  const int a = axisU(c), b = axisV(c);
  s.axes_c = mat3(axes[a], axes[b], axes[c]);
  s.scale = vec3(scale[a], scale[b], scale[c]);
  s.opacity = 1.0f / (1.0f + std::exp(-model.opacity_logit[i]));
  s.base = baseColor(model, i, glm::normalize(model.mean[i] - vec3(camera.position())));
  s.normal = glm::dot(axes[c], s.mean_c) > 0.0f ? -axes[c] : axes[c];
  s.record = makeSplat(s.mean_c, s.axes_c, s.scale, focalCenter(camera), s.opacity, s.base);
  return s;
}

bool isSeen(const FloatSplat& s) { return s.mean_c.z > kNear && s.opacity * 255.0f > 1.0f; }

bool intersectRecord(const Splat& r, IntersectionModel model, vec2 delta, Hit& hit) {
  return intersectSplat(vec3(r.wx_r), vec3(r.wy_g), vec3(r.dx_b), vec3(r.dy_offset), vec3(r.d0_size),
                        r.center_depth_opacity.z, static_cast<uint>(model), delta, kNear, hit);
}

vec4 sample(const GaussianModel& model, const TextureRect& rect, vec2 uv) {
  const TextureTap u = textureTap(uv.x, rect.width);
  const TextureTap v = textureTap(uv.y, rect.height);
  const vec4* texels = model.atlas.texels.data() + rect.offset;
  const vec4 low = glm::mix(texels[v.i0 * rect.width + u.i0], texels[v.i0 * rect.width + u.i1], u.fraction);
  const vec4 high = glm::mix(texels[v.i1 * rect.width + u.i0], texels[v.i1 * rect.width + u.i1], u.fraction);
  return glm::mix(low, high, v.fraction);
}

// Every Gaussian against every pixel, in float. `boxed` skips pixels outside splatBox: the picture must not change.
Frame renderFloat(const GaussianModel& model, const Camera& camera, const RenderSettings& settings, bool boxed) {
  const uint mode = static_cast<uint>(model.texture_mode) & static_cast<uint>(settings.textures);
  const IntersectionModel intersection = settings.intersection.value_or(model.intersection);
  std::vector<FloatSplat> splats;
  for (std::uint32_t i = 0; i < model.size(); ++i) {
    const FloatSplat s = makeFloatSplat(model, camera, i);
    if (isSeen(s)) splats.push_back(s);
  }
  std::stable_sort(splats.begin(), splats.end(),
                   [](const FloatSplat& x, const FloatSplat& y) { return x.mean_c.z < y.mean_c.z; });
  std::vector<vec4> boxes;
  for (const FloatSplat& s : splats) {
    vec4 box;
    const bool bounded = splatBox(s.mean_c, s.axes_c, s.scale, visibleRadius(s.opacity),
                                  intersection == IntersectionModel::plane, focalCenter(camera), box);
    boxes.push_back(bounded && boxed ? box : vec4(-1e30f, -1e30f, 1e30f, 1e30f));
  }
  Frame frame(camera.size.x, camera.size.y);
  for (std::size_t pixel = 0; pixel < frame.base.size(); ++pixel) {
    const vec2 position = vec2(pixel % camera.size.x, pixel / camera.size.x) + 0.5f;
    float transmittance = 1.0f, weight_sum = 0.0f, depth_sum = 0.0f;
    for (std::size_t k = 0; k < splats.size(); ++k) {
      const FloatSplat& s = splats[k];
      const vec4 box = boxes[k];
      if (position.x < box.x || position.y < box.y || position.x > box.z || position.y > box.w) continue;
      Hit hit;
      if (!intersectRecord(s.record, intersection, position - vec2(s.record.center_depth_opacity), hit)) continue;
      vec4 texel(0.0f, 0.0f, 0.0f, 1.0f);
      const TextureRect rect = model.atlas.rects.empty() ? TextureRect{} : model.atlas.rects[s.gaussian];
      if (rect.texelCount() > 0 && insideTexture(hit.uv)) {
        const vec4 value = sample(model, rect, hit.uv);
        if (mode & kModeRgb) texel = vec4(vec3(value), texel.a);
        if (mode & kModeAlpha) texel.a = value.a;
      }
      const float alpha = std::min(kAlphaMax, s.opacity * std::exp(-0.5f * hit.power) * texel.a);
      if (alpha < kAlphaMin) continue;
      if (transmittance * (1.0f - alpha) < kTransmittanceStop) break;
      const float weight = transmittance * alpha;
      frame.base[pixel] += weight * s.base;
      frame.texture[pixel] += weight * vec3(texel);
      frame.normal[pixel] += weight * s.normal;
      frame.count[pixel] += 1.0f;
      depth_sum += weight * hit.t;
      weight_sum += weight;
      transmittance *= 1.0f - alpha;
    }
    frame.base[pixel] += transmittance * settings.background;
    frame.alpha[pixel] = 1.0f - transmittance;
    frame.depth[pixel] = weight_sum > 0.0f ? depth_sum / weight_sum : 0.0f;
  }
  return frame;
}

// The reference's splat for the same float numbers: camera at the origin, camera space = world space.
reference::Splat exactSplat(const FloatSplat& s) {
  reference::Splat exact;
  exact.z = s.mean_c.z;
  exact.rotation = glm::dmat3(s.axes_c);
  exact.scale = s.scale;
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) exact.m[j][k] = exact.rotation[k][j] / exact.scale[k];
  }
  exact.o = exact.m * -glm::dvec3(s.mean_c);
  return exact;
}

// Bounds [px] of what lies on a sphere of radius r sigma around a splat, in double: the tangent cone as a conic, C =
// K (r^2 Sigma - m m^T) K^T, against shared/splat.h's form without cancellation.
glm::dvec4 conicBox(glm::dvec3 mean_c, const glm::dmat3& axes_c, glm::dvec3 scale, double r, glm::dvec4 focal_center) {
  glm::dmat3 spread(0.0);
  for (int k = 0; k < 3; ++k) spread += r * r * scale[k] * scale[k] * glm::outerProduct(axes_c[k], axes_c[k]);
  glm::dmat3 k(0.0);
  k[0][0] = focal_center.x;
  k[1][1] = focal_center.y;
  k[2] = {focal_center.z, focal_center.w, 1.0};
  const glm::dmat3 c = k * (spread - glm::outerProduct(mean_c, mean_c)) * glm::transpose(k);
  const double root_x = std::sqrt(c[2][0] * c[2][0] - c[0][0] * c[2][2]);
  const double root_y = std::sqrt(c[2][1] * c[2][1] - c[1][1] * c[2][2]);
  // c33 < 0: the plus sign gives the lower bound.
  return {(c[2][0] + root_x) / c[2][2], (c[2][1] + root_y) / c[2][2], (c[2][0] - root_x) / c[2][2],
          (c[2][1] - root_y) / c[2][2]};
}

std::vector<FloatSplat> seenSplats(const TestScene& scene) {
  std::vector<FloatSplat> splats;
  for (std::uint32_t i = 0; i < scene.model.size(); ++i) {
    const FloatSplat s = makeFloatSplat(scene.model, scene.camera, i);
    if (isSeen(s)) splats.push_back(s);
  }
  return splats;
}

constexpr IntersectionModel kModels[] = {IntersectionModel::plane, IntersectionModel::maxResponse};

}  // namespace

TEST_CASE("a plain float loop over shaders/shared keeps the tolerance of every scene") {
  for (SceneKind kind : kSceneKinds) {
    for (IntersectionModel intersection : kModels) {
      for (unsigned seed = 0; seed < 3; ++seed) {
        const TestScene scene = makeScene(kind, seed);
        RenderSettings settings;
        settings.intersection = intersection;
        settings.background = {0.2f, 0.4f, 0.6f};
        const Tolerance allowed = tolerance(kind, intersection);
        const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, settings);
        const auto difference =
            compareFrames(renderFloat(scene.model, scene.camera, settings, false), reference, allowed);
        INFO(name(kind) << ", " << name(intersection) << ", seed " << seed << "\n" << report(difference));
        CHECK(violations(difference, allowed) == "");
      }
    }
  }
}

TEST_CASE("splat records reproduce the float64 intersection of every kind of Gaussian") {
  for (SceneKind kind : kSceneKinds) {
    const TestScene scene = makeScene(kind, 100, 2000);
    const Camera& camera = scene.camera;
    Random random(7);
    double worst_value = 0, worst_uv = 0, worst_t = 0;
    int visible = 0;
    for (const FloatSplat& s : seenSplats(scene)) {
      const reference::Splat exact = exactSplat(s);
      for (IntersectionModel intersection : kModels) {
        // A position near the splat: the projection of a random point of it.
        const vec3 offset = s.axes_c * (s.scale * vec3(random.uniformVec3(-2.0, 2.0)));
        const vec3 point = s.mean_c + offset;
        if (point.z <= 0.3f) continue;
        const vec2 focal(camera.focal.x, camera.focal.y);
        const vec2 delta = focal * (vec2(point) / point.z - vec2(s.mean_c) / s.mean_c.z);
        const glm::dvec2 center = glm::dvec2(glm::dvec3(s.mean_c)) / double{s.mean_c.z};
        const glm::dvec3 direction(center + glm::dvec2(delta) / glm::dvec2(focal), 1.0);
        const auto expected = reference::intersect(exact, direction, intersection, kNear);
        Hit hit;
        const bool found = intersectRecord(s.record, intersection, delta, hit);
        if (!expected || std::abs(expected->t - kNear) < 1e-3) continue;
        const double power = glm::dot(expected->p, expected->p);
        if (power > 12.0) continue;  // beyond what 1/255 shows
        REQUIRE(found);
        ++visible;
        worst_value = std::max(worst_value, std::abs(std::exp(-0.5 * hit.power) - std::exp(-0.5 * power)));
        const double uv = glm::length(glm::dvec2(hit.uv) - glm::dvec2(expected->p));
        worst_uv = std::max(worst_uv, uv);
        worst_t = std::max(worst_t, std::abs(hit.t - expected->t) / expected->t);
      }
    }
    INFO(name(kind) << ": value " << worst_value << ", uv " << worst_uv << ", t " << worst_t << " over " << visible);
    // Rounding of the ray, 1e-7 of a distance, counted in the sigmas of a splat 1000 times thinner than far.
    CHECK(visible > 500);
    CHECK(worst_value < 2e-3);
    CHECK(worst_uv < 2e-3);
    CHECK(worst_t < 2e-3);
  }
}

TEST_CASE("splat records keep the digits that the closed form loses") {
  Random random(12);
  double worst_closed = 0, worst_record = 0;
  for (int n = 0; n < 20000; ++n) {
    FloatSplat s;
    s.mean_c = vec3(random.uniform(-3, 3), random.uniform(-2, 2), random.uniform(11, 13));
    s.axes_c = rotationFromQuaternion(vec4(random.quaternion()));
    s.scale = vec3(glm::exp(random.uniformVec3(std::log(2e-3), std::log(0.3))));
    const vec4 focal_center(1000, 1000, 500, 400);
    s.record = makeSplat(s.mean_c, s.axes_c, s.scale, focal_center, 0.5f, vec3(0.0f));
    const vec3 point = s.mean_c + s.axes_c * (s.scale * vec3(random.uniformVec3(-1.5, 1.5)));
    const vec2 delta = 1000.0f * (vec2(point) / point.z - vec2(s.mean_c) / s.mean_c.z);
    const reference::Splat exact = exactSplat(s);
    const glm::dvec2 center = glm::dvec2(glm::dvec3(s.mean_c)) / double{s.mean_c.z};
    const glm::dvec3 direction(center + glm::dvec2(delta) / 1000.0, 1.0);
    const auto expected = reference::intersect(exact, direction, IntersectionModel::maxResponse, kNear);
    const double power = glm::dot(expected->p, expected->p);
    Hit hit;
    REQUIRE(intersectRecord(s.record, IntersectionModel::maxResponse, delta, hit));
    // |o|^2 - (o . d)^2 / |d|^2, every step in float.
    const vec3 o = vec3(exact.o);
    const vec3 d = vec3(exact.m * direction);
    const float closed = glm::dot(o, o) - glm::dot(o, d) * glm::dot(o, d) / glm::dot(d, d);
    worst_closed = std::max(worst_closed, std::abs(closed - power));
    worst_record = std::max(worst_record, std::abs(hit.power - power));
  }
  INFO("largest error in |p|^2: closed form " << worst_closed << ", record " << worst_record);
  CHECK(worst_closed > 1.0);
  CHECK(worst_record < 1e-3);
}

TEST_CASE("the screen box of case G is the published one") {
  const glm::dvec3 mean(0.3, -0.2, 4), scale(0.4, 0.3, 0.05);
  const glm::dmat3 axes(rotationFromQuaternion(vec4(0.9f, 0.2f, -0.3f, 0.1f)));
  const glm::dvec4 focal_center(100, 100, 32.5, 32.5);
  const glm::dvec4 published(11.940139434, 4.242062033, 60.805875476, 46.742028512);
  vec4 box;
  REQUIRE(splatBox(vec3(mean), mat3(axes), vec3(scale), 3.0f, false, vec4(focal_center), box));
  for (int k = 0; k < 4; ++k) CHECK(std::abs(box[k] - published[k]) < 5e-5);  // float
  // In double, with double axes.
  ReferenceModel model;
  model.mean = {mean};
  model.rotation = {{0.9, 0.2, -0.3, 0.1}};
  model.log_scale = {glm::log(scale)};
  model.opacity_logit = {3.0};
  model.sh = {glm::dvec3(0.0)};
  Camera camera;
  const auto exact = reference::makeScene(model, camera, {}, {});
  const glm::dvec4 conic = conicBox(mean, exact.splats.at(0).rotation, scale, 3.0, focal_center);
  for (int k = 0; k < 4; ++k) CHECK(std::abs(conic[k] - published[k]) < 5.1e-10);
}

TEST_CASE("a screen box is the same in every unit of length and has an end until it reaches the plane of the camera") {
  const auto boxOf = [](float unit, float reach, vec4& box) {
    const vec3 mean = vec3(0.3f, -0.2f, 4) * unit;
    const mat3 axes = rotationFromQuaternion(vec4(0.9f, 0.2f, -0.3f, 0.1f));
    return splatBox(mean, axes, vec3(mean.z * reach), 1.0f, false, vec4(100, 100, 32.5f, 32.5f), box);
  };
  for (const float unit : {0x1p-60f, 0x1p-14f, 0x1p-3f, 0x1p14f, 0x1p36f, 0x1p60f}) {
    INFO("unit " << unit);
    vec4 box, expected;
    for (const float reach : {0.1f, 0.999f}) {
      REQUIRE(boxOf(1, reach, expected));
      REQUIRE(boxOf(unit, reach, box));
      CHECK(box == expected);
    }
    for (const float reach : {0.9999998f, 1.1f}) CHECK_FALSE(boxOf(unit, reach, box));
  }
}

TEST_CASE("a screen box whose half width has no square in float has no end") {
  const auto bounded = [](float longest, vec4& box) {
    // b leaves the image plane by a tenth of the mean's depth.
    const mat3 axes(vec3(1, 0, 0), vec3(0, 1, 1e-3f / 2e9f), vec3(0, 0, 1));
    return splatBox(vec3(0.001f, 0.0005f, 0.01f), axes, vec3(longest, 2e9f, 2e9f), 1.0f, true, vec4(16, 16, 8, 8), box);
  };
  vec4 box;
  REQUIRE(bounded(1e9f, box));
  CHECK(box.x < -1e12f);
  CHECK(box.z > 1e12f);
  CHECK_FALSE(bounded(3.33e18f, box));
}

TEST_CASE("a quaternion of any length turns as that of length one does bit for bit") {
  const vec4 quaternion = vec4(0.9f, 0.2f, -0.3f, 0.1f);
  for (const float length : {0x1p-72f, 0x1p-66f, 0x1p-34f, 0x1p-32f, 0x1p62f}) {
    INFO(length);
    CHECK((rotationFromQuaternion(length * quaternion) == rotationFromQuaternion(quaternion)));
  }
}

TEST_CASE("screen boxes are the exact tangent bounds and contain every point") {
  int bounded = 0;
  for (SceneKind kind : kSceneKinds) {
    const TestScene scene = makeScene(kind, 101, 300);
    const vec4 focal_center = focalCenter(scene.camera);
    Random random(8);
    for (const FloatSplat& s : seenSplats(scene)) {
      const float radius = visibleRadius(s.opacity);
      for (bool flat : {false, true}) {
        vec4 box;
        if (!splatBox(s.mean_c, s.axes_c, s.scale, radius, flat, focal_center, box)) continue;
        ++bounded;
        const glm::dvec3 scale(s.scale.x, s.scale.y, flat ? 0.0 : s.scale.z);
        const glm::dvec4 exact = conicBox(s.mean_c, glm::dmat3(s.axes_c), scale, radius, focal_center);
        const double extent = std::max(exact.z - exact.x, exact.w - exact.y);
        const double size = std::max({extent, std::abs(exact.x), std::abs(exact.y), 1.0});
        // Near z = 0 the bounds run to infinity and the conic form loses digits first.
        if (size < 1e3) {
          for (int k = 0; k < 4; ++k) CHECK(std::abs(box[k] - exact[k]) < 1e-5 * size);
        }
        double inside_x = 0;  // how much of the box's width the points reach
        for (int n = 0; n < 100; ++n) {
          const glm::dvec3 local = double{radius} * scale * random.direction();
          const glm::dvec3 p = glm::dvec3(s.mean_c) + glm::dmat3(s.axes_c) * local;
          REQUIRE(p.z > 0.0);
          const double x = focal_center.x * p.x / p.z + focal_center.z;
          const double y = focal_center.y * p.y / p.z + focal_center.w;
          const double slack = 1e-5 * size;
          CHECK((x >= box.x - slack && x <= box.z + slack && y >= box.y - slack && y <= box.w + slack));
          inside_x = std::max(inside_x, std::abs(2 * x - box.x - box.z) / (box.z - box.x));
        }
        if (!flat) CHECK(inside_x > 0.5);
      }
    }
  }
  CHECK(bounded > 2000);
}

TEST_CASE("texels a pixel are those that the hits of neighbouring rays are apart") {
  constexpr uint kWide = 5, kHigh = 9;
  int seen = 0;
  for (SceneKind kind : kSceneKinds) {
    const TestScene scene = makeScene(kind, 102, 300);
    const glm::dvec4 focal_center(focalCenter(scene.camera));
    for (IntersectionModel model : kModels) {
      for (const FloatSplat& s : seenSplats(scene)) {
        const reference::Splat exact = exactSplat(s);
        const auto hit = [&](double x, double y) {  // offset from the projected mean [px] to uv
          const glm::dvec3 mean(s.mean_c);
          const glm::dvec3 d =
              exact.m * glm::dvec3(mean.x / mean.z + x / focal_center.x, mean.y / mean.z + y / focal_center.y, 1.0);
          const double t =
              model == IntersectionModel::plane ? -exact.o.z / d.z : -glm::dot(exact.o, d) / glm::dot(d, d);
          return glm::dvec2(exact.o + t * d);
        };
        constexpr double kStep = 1e-3;  // [px]
        const glm::dvec2 across = (hit(kStep, 0) - hit(-kStep, 0)) / (2 * kStep);
        const glm::dvec2 down = (hit(0, kStep) - hit(0, -kStep)) / (2 * kStep);
        const double texels = (kWide - 1) * (kHigh - 1) / (4.0 * kTextureExtent * kTextureExtent);
        const Splat& r = s.record;
        const float density =
            texelDensity(vec3(r.wx_r), vec3(r.wy_g), vec3(r.d0_size), kWide, kHigh, static_cast<uint>(model));
        const double expected = texels * std::abs(across.x * down.y - across.y * down.x);
        const double whole = texels * glm::length(across) * glm::length(down);
        if (!(whole < 1e6)) continue;  // a plane seen from its edge
        ++seen;
        CHECK(std::abs(double{density} * density - expected) < 1e-3 * whole);
      }
    }
  }
  CHECK(seen > 2000);
}

TEST_CASE("skipping the pixels outside the screen boxes changes no pixel") {
  for (SceneKind kind : kSceneKinds) {
    for (IntersectionModel intersection : kModels) {
      const TestScene scene = makeScene(kind, 102);
      RenderSettings settings;
      settings.intersection = intersection;
      const Frame all = renderFloat(scene.model, scene.camera, settings, false);
      const Frame boxed = renderFloat(scene.model, scene.camera, settings, true);
      INFO(name(kind) << ", " << name(intersection));
      CHECK(all.base == boxed.base);
      CHECK(all.count == boxed.count);
    }
  }
}

TEST_CASE("float spherical harmonics and their gradient match float64 and finite differences") {
  Random random(9);
  for (int n = 0; n < 500; ++n) {
    const glm::dvec3 direction = random.direction();
    const auto exact = reference::shBasis(direction);
    const auto exact_gradient = reference::shBasisGradient(direction);
    vec4 b[4];
    shBasis(vec3(direction), b[0], b[1], b[2], b[3]);
    for (uint k = 0; k < 16; ++k) {
      CHECK(std::abs(b[k / 4][k % 4] - exact[k]) < 2e-6);
      const vec3 gradient = shBasisGradient(vec3(direction), k);
      for (int axis = 0; axis < 3; ++axis) {
        CHECK(std::abs(gradient[axis] - exact_gradient[k][axis]) < 5e-6);
        const double h = 1e-5;
        glm::dvec3 step(0.0);
        step[axis] = h;
        const double difference =
            (reference::shBasis(direction + step)[k] - reference::shBasis(direction - step)[k]) / (2 * h);
        CHECK(std::abs(exact_gradient[k][axis] - difference) < 1e-9);
      }
    }
  }
}

TEST_CASE("texture taps stay inside the texture and reproduce the float64 look-up") {
  Random random(10);
  for (std::uint16_t size = 1; size <= 64; ++size) {
    ReferenceModel model;
    for (int i = 0; i < size; ++i) model.texels.push_back(glm::dvec4(random.uniform()));
    for (int n = 0; n < 60; ++n) {
      // The ends, every texel's own position, and anything between.
      float u = static_cast<float>(random.uniform(-3.0, 3.0));
      if (n == 0) u = -3.0f;
      if (n == 1) u = 3.0f;
      if (n == 2) u = std::nextafter(3.0f, 0.0f);
      if (n >= 3 && n < 20 && size > 1) u = -3.0f + 6.0f * static_cast<float>(n % size) / static_cast<float>(size - 1);
      u = std::min(u, 3.0f);
      const TextureTap tap = textureTap(u, size);
      REQUIRE(tap.i0 < size);
      REQUIRE(tap.i1 < size);
      REQUIRE(tap.i1 >= tap.i0);
      CHECK(tap.fraction >= 0.0f);
      CHECK(tap.fraction <= 1.0f + 1e-5f);
      const auto exact = reference::sampleTexture(model, {0, size, 1}, u, 0.0);
      REQUIRE(exact);
      const double value = glm::mix(model.texels[tap.i0].r, model.texels[tap.i1].r, double{tap.fraction});
      CHECK(std::abs(value - exact->value.r) < 1e-5);
      CHECK(texelsPerSigma(size) == Approx((size - 1) / 6.0));
    }
  }
  CHECK(insideTexture({3.0f, -3.0f}));
  CHECK_FALSE(insideTexture({std::nextafter(3.0f, 4.0f), 0.0f}));
  CHECK_FALSE(insideTexture({0.0f, std::nextafter(-3.0f, -4.0f)}));
  CHECK_FALSE(insideTexture({std::nanf(""), 0.0f}));
}

TEST_CASE("the texture plane drops the shortest axis, the lowest index on ties") {
  CHECK(shortestAxis({1, 1, 1}) == 0);
  CHECK(shortestAxis({2, 1, 1}) == 1);
  CHECK(shortestAxis({2, 1, 0.5f}) == 2);
  CHECK(shortestAxis({1, 2, 1}) == 0);
  CHECK(shortestAxis({1, 2, 0.5f}) == 2);
  CHECK((axisU(0) == 1 && axisV(0) == 2));
  CHECK((axisU(1) == 0 && axisV(1) == 2));
  CHECK((axisU(2) == 0 && axisV(2) == 1));
}

TEST_CASE("the visible radius ends where alpha falls below 1/255") {
  for (float opacity : {0.005f, 0.1f, 0.5f, 0.99f, 1.0f}) {
    const float radius = visibleRadius(opacity);
    CHECK(opacity * std::exp(-0.5f * radius * radius) < kAlphaMin);
    CHECK(opacity * std::exp(-0.5f * radius * radius) > 0.99f * kAlphaMin);
  }
  CHECK(visibleRadius(0.0039f) == 0.0f);
}
