// SPDX-License-Identifier: Apache-2.0
// What a viewer may change and ask for beyond the blended outputs: the meaning of every setting, on scenes small enough
// to work out by hand.
#include <cmath>

#include "core/system/error.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

constexpr double kFocal = 100.0;

double logit(double opacity) { return std::log(opacity / (1.0 - opacity)); }

Camera axisCamera(int size = 1) {
  Camera camera;
  camera.size.x = camera.size.y = size;
  camera.focal.x = camera.focal.y = kFocal;
  camera.center.x = camera.center.y = 0.5 * size;
  return camera;
}

// A disc across the axis at depth z.
void addDisc(ReferenceModel& model, double z, double opacity, glm::dvec3 color, glm::dvec3 scale = {1, 1, 0.01}) {
  model.mean.push_back({0, 0, z});
  model.rotation.push_back({1, 0, 0, 0});
  model.log_scale.push_back(glm::log(scale));
  model.opacity_logit.push_back(logit(opacity));
  model.sh.push_back((color - 0.5) / 0.28209479177387814);
}

FrameT<double> render(const ReferenceModel& model, const RenderSettings& settings, int size = 1) {
  return renderReference(model, axisCamera(size), settings);
}

RenderSettings asking(OutputSet outputs) {
  RenderSettings settings;
  settings.outputs = outputs;
  return settings;
}

double largestDifference(const FrameT<double>& a, const FrameT<double>& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.base.size(); ++i) {
    const glm::dvec3 d = glm::abs(a.color(i) - b.color(i));
    largest = std::max({largest, d.x, d.y, d.z});
  }
  return largest;
}

}  // namespace

TEST_CASE("the median depth is that of the splat that takes transmittance below a half") {
  ReferenceModel model;
  addDisc(model, 2.0, 0.3, glm::dvec3(1));
  addDisc(model, 3.0, 0.25, glm::dvec3(1));  // leaves 0.525
  const RenderSettings settings = asking({Output::depthMedian});
  CHECK(render(model, settings).depth_median[0] == 0.0);
  addDisc(model, 4.0, 0.1, glm::dvec3(1));
  addDisc(model, 5.0, 0.9, glm::dvec3(1));
  CHECK(render(model, settings).depth_median[0] == Approx(4.0).epsilon(1e-12));
}

TEST_CASE("overdraw counts the splats behind the transmittance stop, count does not") {
  ReferenceModel model;
  for (int i = 0; i < 6; ++i) addDisc(model, 2.0 + i, 0.985, glm::dvec3(1));
  addDisc(model, 9.0, 0.5 / 255, glm::dvec3(1));  // too faint for either
  const FrameT<double> frame = render(model, asking({Output::count, Output::overdraw}));
  CHECK(frame.count[0] == 2.0);
  CHECK(frame.overdraw[0] == 6.0);
}

TEST_CASE("a frame holds what was asked for") {
  ReferenceModel model;
  addDisc(model, 3.0, 0.5, {0.2, 0.4, 0.6});
  const FrameT<double> all = render(model, {});
  const FrameT<double> picture = render(model, asking({Output::final}));
  CHECK(picture.base.empty());
  CHECK(picture.depth.empty());
  CHECK(picture.color(0) == all.color(0));
  CHECK(all.picture.empty());
  CHECK(all.overdraw.empty());
}

TEST_CASE("per-pixel order follows the hits where two discs cross, global order the means") {
  // Two planes that cross on the axis at depth 4, turned by +-45 degrees: which is nearer changes sides.
  ReferenceModel model;
  model.intersection = IntersectionModel::plane;
  for (const double turn : {0.25, -0.25}) {
    addDisc(model, 4.0, 0.9, turn > 0 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1));
    const double half = turn * std::acos(-1.0) / 2;
    model.rotation.back() = {std::cos(half), 0, std::sin(half), 0};
  }
  RenderSettings settings;
  const auto redLead = [&](double pixel_x) {
    const auto hits = traceReference(model, axisCamera(40), settings, pixel_x, 20.0);
    REQUIRE(hits.size() == 2);
    return hits[0].gaussian == 0;
  };
  CHECK(redLead(5.0));
  CHECK(redLead(35.0));
  settings.order = SplatOrder::perPixel;
  CHECK(redLead(5.0) != redLead(35.0));
  for (const double x : {5.0, 15.0, 25.0, 35.0}) {
    const auto hits = traceReference(model, axisCamera(40), settings, x, 20.0);
    CHECK(hits[0].t < hits[1].t);
  }
}

TEST_CASE("scales, SH degree, near plane and crop box act as if the model were another") {
  const TestScene scene = makeScene(SceneKind::mixed, 3, 80, 24, 18);
  const ReferenceModel model(scene.model);
  const auto picture = [&](const ReferenceModel& m, const RenderSettings& s) {
    return renderReference(m, scene.camera, s);
  };
  RenderSettings settings;
  settings.splat_scale = 0.5f;
  settings.opacity_scale = 1.5f;
  ReferenceModel changed = model;
  for (glm::dvec3& s : changed.log_scale) s += std::log(0.5);
  for (double& o : changed.opacity_logit) {
    const double opacity = std::min(1.0, 1.5 / (1.0 + std::exp(-o)));
    o = opacity < 1.0 ? logit(opacity) : 100.0;
  }
  CHECK(largestDifference(picture(model, settings), picture(changed, {})) < 1e-12);

  settings = {};
  settings.max_sh_degree = 1;
  changed = model;
  for (std::size_t i = 0; i < changed.sh.size(); ++i) {
    if (i % 16 >= 4) changed.sh[i] = glm::dvec3(0.0);
  }
  CHECK(largestDifference(picture(model, settings), picture(changed, {})) < 1e-12);

  settings = {};
  settings.crop = CropBox{{-0.5f, -10.0f, -10.0f}, {0.75f, 10.0f, 10.0f}};
  changed = model;
  for (std::size_t i = 0; i < changed.size(); ++i) {
    if (model.mean[i].x < -0.5 || model.mean[i].x > 0.75) changed.opacity_logit[i] = -100.0;
  }
  CHECK(largestDifference(picture(model, settings), picture(changed, {})) < 1e-12);
  CHECK(largestDifference(picture(model, settings), picture(model, {})) > 0.01);

  settings = {};
  settings.near = 3.0f;
  for (const double x : {6.5, 12.5, 18.5}) {
    for (const ReferenceHit& hit : traceReference(model, scene.camera, settings, x, 9.5)) CHECK(hit.t > 3.0);
  }
}

TEST_CASE("ellipsoids are entered at one sigma and lit from the camera") {
  ReferenceModel model;
  addDisc(model, 5.0, 0.02, {0.5, 1.0, 0.25}, glm::dvec3(1.0));  // hidden behind
  addDisc(model, 4.0, 0.02, {1.0, 0.5, 0.25}, glm::dvec3(0.5));
  RenderSettings settings = asking({Output::ellipsoids});
  settings.background = {0.0f, 0.0f, 1.0f};
  const int size = 101;
  const FrameT<double> frame = render(model, settings, size);
  const auto at = [&](int x, int y) { return frame.ellipsoids[static_cast<std::size_t>(y) * size + x]; };
  CHECK(glm::length(at(50, 50) - glm::dvec3(1.0, 0.5, 0.25)) < 1e-9);  // faces the light
  CHECK(at(0, 0) == glm::dvec3(0, 0, 1));
  // The nearer sphere's outline: tan = 0.5 / sqrt(4^2 - 0.5^2), 12.6 px. Dark at its rim, then the farther one.
  CHECK(at(50 + 12, 50).x < 0.6);
  CHECK(at(50 + 12, 50).x == Approx(2.0 * at(50 + 12, 50).y).epsilon(1e-9));
  CHECK(at(50 + 13, 50).y == Approx(2.0 * at(50 + 13, 50).x).epsilon(1e-9));
  settings.splat_scale = 0.1f;
  CHECK(render(model, settings, size).ellipsoids[50 * size + 62] == glm::dvec3(0, 0, 1));
}

TEST_CASE("centres are dots of 1.5 pixels, the nearest first") {
  ReferenceModel model;
  addDisc(model, 5.0, 0.5, {0, 1, 0});
  addDisc(model, 4.0, 0.5, {1, 0, 0});
  const FrameT<double> frame = render(model, asking({Output::centers}), 7);
  int red = 0;
  for (const glm::dvec3 color : frame.centers) {
    CHECK(color.y == 0.0);
    red += color.x > 0.99;
  }
  CHECK(red == 9);  // the centre pixel and its eight neighbours, at most 1.41 px away
}

TEST_CASE("a texture's texels per pixel, and the filter that fades them to their mean") {
  ReferenceModel model;
  model.texture_mode = TextureMode::rgba;
  addDisc(model, 4.0, 0.8, glm::dvec3(0.5), {0.6, 0.3, 0.01});
  model.rects.push_back({0, 7, 4});
  Random random(5);
  for (int i = 0; i < 28; ++i) model.texels.push_back({random.uniformVec3(-0.5, 0.5), random.uniform(0.2, 1.0)});
  const auto density = [&](const RenderSettings& s) {
    return renderReference(model, axisCamera(), s).texel_density[0];
  };
  RenderSettings settings = asking(kBlendedOutputs | OutputSet{Output::texelDensity});
  for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
    settings.intersection = intersection;
    // A pixel is 4 / 100 world units; 6 and 3 texel steps span 6 sigmas.
    const double expected = std::sqrt(0.04 / 0.6 * 6 / 6 * 0.04 / 0.3 * 3 / 6);
    CHECK(density(settings) == Approx(expected).epsilon(1e-9));
    // Half the size on the screen, twice the texels a pixel.
    settings.splat_scale = static_cast<float>(expected / std::sqrt(2.0));  // where the filter is half way
    CHECK(density(settings) == Approx(std::sqrt(2.0)).epsilon(1e-6));
    settings.splat_scale = 1.0f;
  }
  settings.textures = TextureMode::none;
  CHECK(density(settings) == 0.0);

  settings = {};
  settings.intersection = IntersectionModel::plane;
  const double expected = std::sqrt(0.04 / 0.6 * 0.04 / 0.3 * 3 / 6);
  const auto hit = [&](double density_wanted, TextureFilter filter) {
    settings.splat_scale = static_cast<float>(expected / density_wanted);
    settings.texture_filter = filter;
    return traceReference(model, axisCamera(), settings, 0.5, 0.5).at(0);
  };
  CHECK(hit(0.99, TextureFilter::footprint).texture == hit(0.99, TextureFilter::bilinear).texture);
  const glm::dvec3 sharp = hit(1.0, TextureFilter::bilinear).texture;
  // The mean under the Gaussian by brute force, from the bilinear samples themselves.
  glm::dvec4 mean(0.0);
  double mass = 0.0;
  constexpr int kSteps = 240;
  for (int j = 0; j < kSteps; ++j) {
    for (int i = 0; i < kSteps; ++i) {
      const double u = (i + 0.5) * 6.0 / kSteps - 3.0, v = (j + 0.5) * 6.0 / kSteps - 3.0;
      const double x = (u + 3.0) * 6 / 6, y = (v + 3.0) * 3 / 6;
      const int i0 = std::min(static_cast<int>(x), 5), j0 = std::min(static_cast<int>(y), 2);
      const auto texel = [&](int a, int b) { return model.texels[static_cast<std::size_t>(b) * 7 + a]; };
      const glm::dvec4 sample = glm::mix(glm::mix(texel(i0, j0), texel(i0 + 1, j0), x - i0),
                                         glm::mix(texel(i0, j0 + 1), texel(i0 + 1, j0 + 1), x - i0), y - j0);
      const double weight = std::exp(-0.5 * (u * u + v * v));
      mean += weight * sample;
      mass += weight;
    }
  }
  mean /= mass;
  for (const double far : {2.0, 5.0}) {
    const ReferenceHit faded = hit(far, TextureFilter::footprint);
    CHECK(glm::length(faded.texture - glm::dvec3(mean)) < 1e-4);
    CHECK(faded.texture_alpha == Approx(mean.a).epsilon(1e-3));
  }
  const glm::dvec3 half = hit(std::sqrt(2.0), TextureFilter::footprint).texture;
  CHECK(glm::length(half - 0.5 * (sharp + glm::dvec3(mean))) < 1e-4);
}

TEST_CASE("screen antialiasing widens small splats and keeps what they cover") {
  for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
    // A pixel is 0.04: this disc is a tenth of one.
    ReferenceModel model;
    model.intersection = intersection;
    addDisc(model, 4.0, 0.9, glm::dvec3(1), {0.004, 0.004, 0.0001});
    RenderSettings settings;
    settings.antialiasing = Antialiasing::screen;
    const auto hits = traceReference(model, axisCamera(), settings, 0.5, 0.5, {.cutoffs = false});
    REQUIRE(hits.size() == 1);
    // 0.004^2 / (0.004^2 + 0.1 * 0.04^2)
    CHECK(hits[0].alpha == Approx(0.9 / 11.0).epsilon(1e-9));
    // What it covers, sampled far finer than a pixel. Opaque enough to be cut nowhere.
    const auto covers = [&](const RenderSettings& s) {
      const Camera coarse = axisCamera(10);
      double total = 0.0;
      for (int y = 0; y < 200; ++y) {
        for (int x = 0; x < 200; ++x) {
          for (const auto& hit : traceReference(model, coarse, s, (x + 0.5) / 20, (y + 0.5) / 20, {.cutoffs = false})) {
            total += hit.alpha / 400;
          }
        }
      }
      return total;
    };
    CHECK(covers(settings) == Approx(covers({})).epsilon(1e-3));
  }
  ReferenceModel large;
  addDisc(large, 4.0, 0.5, glm::dvec3(1), glm::dvec3(40.0));
  RenderSettings settings;
  settings.antialiasing = Antialiasing::screen;
  CHECK(largestDifference(render(large, settings, 4), render(large, {}, 4)) < 1e-6);
}

TEST_CASE("settings out of range are usage errors that name them") {
  ReferenceModel model;
  addDisc(model, 4.0, 0.5, glm::dvec3(1));
  const auto message = [&](const auto& change) -> std::string {
    RenderSettings settings;
    change(settings);
    try {
      render(model, settings);
    } catch (const Error& error) {
      CHECK(error.kind == ErrorKind::usage);
      return error.what();
    }
    return "";
  };
  const auto starts = [](const std::string& text, const std::string& with) { return text.rfind(with, 0) == 0; };
  CHECK(message([](RenderSettings&) {}) == "");
  CHECK(starts(message([](RenderSettings& s) { s.opacity_scale = -1.0f; }), "opacity scale: "));
  CHECK(starts(message([](RenderSettings& s) { s.splat_scale = 0.0f; }), "splat scale: "));
  CHECK(starts(message([](RenderSettings& s) { s.splat_scale = NAN; }), "splat scale: "));
  CHECK(starts(message([](RenderSettings& s) { s.max_sh_degree = 4; }), "SH degree: "));
  CHECK(starts(message([](RenderSettings& s) { s.near = 0.0f; }), "near plane: "));
  CHECK(starts(message([](RenderSettings& s) { s.crop = CropBox{{1, 0, 0}, {0, 1, 1}}; }), "crop box: "));
}
