// SPDX-License-Identifier: Apache-2.0
// The inspector's state, the picked Gaussian's numbers, and what the display's settings come to.
#include "viewer/view/inspection.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/file/json.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "viewer/keys.h"
#include "viewer/picture/inspector_thread.h"
#include "viewer/view/actions.h"
#include "viewer/view/scene_lines.h"

using namespace tg;
using test::press;

namespace {

ViewerState sampleState() {
  Scene scene;
  scene.path = "sample.tgz";
  scene.model = std::make_shared<GaussianModel>(test::trainedLikeModel(11, 400));
  scene.bounds = sceneBounds(*scene.model);
  scene.cameras.push_back(test::trainedLikeCamera(96, 72));
  ViewerState state;
  state.camera.aspect = 96.0 / 72.0;
  setScene(state, scene);
  return state;
}

// Asks and waits for the answer.
void inspectNow(ViewerState& state, glm::ivec2 pixel) {
  InspectorThread thread;
  inspect(state, pixel);
  for (int i = 0; i < 12000 && !thread.update(state, {96, 72}); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  REQUIRE(state.inspect.inspected);
}

}  // namespace

TEST_CASE("an inspected pixel lists its splats front to back and picks the one of most weight") {
  ViewerState state = sampleState();
  CHECK_FALSE(pickedGaussian(state));
  inspectNow(state, {48, 36});
  REQUIRE(state.inspect.hits.size() > 2);
  CHECK(state.inspect.pixel == glm::ivec2(48, 36));
  CHECK(state.ui.tab == Tab::inspect);
  CHECK_FALSE(state.inspect.busy);
  double transmittance = 1;
  for (const PixelHit& hit : state.inspect.hits) {
    CHECK(hit.transmittance == Approx(transmittance).margin(1e-9));
    transmittance *= 1 - hit.alpha;
  }
  const int strongest = state.inspect.picked;
  REQUIRE(strongest >= 0);
  for (const PixelHit& hit : state.inspect.hits) {
    CHECK(hit.weight <= state.inspect.hits[static_cast<std::size_t>(strongest)].weight);
  }
  pickHit(state, 0);
  CHECK(pickedGaussian(state) == state.inspect.hits[0].index);
  press(state, ']');
  CHECK(state.inspect.picked == 1);
  press(state, '[');
  press(state, '[');
  CHECK(state.inspect.picked == 0);
  pickHit(state, 100000);
  CHECK(state.inspect.picked == static_cast<int>(state.inspect.hits.size()) - 1);
}

TEST_CASE("alone, a Gaussian is drawn by a box around its mean, the list stays that of all") {
  ViewerState state = sampleState();
  press(state, 'N');
  CHECK_FALSE(state.inspect.isolated);
  inspectNow(state, {48, 36});
  const std::size_t hits = state.inspect.hits.size();
  pickHit(state, 1);
  press(state, 'N');
  const glm::vec3 mean = state.scene.model->mean[*pickedGaussian(state)];
  REQUIRE(effectiveSettings(state).crop);
  CHECK(effectiveSettings(state).crop->min == mean);
  CHECK(effectiveSettings(state).crop->max == mean);
  inspectNow(state, {48, 36});
  CHECK(state.inspect.hits.size() == hits);
  CHECK_FALSE(state.inspect.isolated);
}

TEST_CASE("a pixel of nothing has no splats, another model forgets the pixel") {
  ViewerState state = sampleState();
  state.camera.pose.yaw += 3.14;
  inspectNow(state, {0, 0});
  CHECK(state.inspect.hits.empty());
  CHECK_FALSE(pickedGaussian(state));
  press(state, ']');
  CHECK_FALSE(state.messages.notice.empty());
  press(state, 'M');
  setScene(state, state.scene);
  CHECK_FALSE(state.inspect.inspected);
  CHECK(state.inspect.active);
}

TEST_CASE("the picked Gaussian is drawn as its texture's square, three axes and an outline") {
  ViewerState state = sampleState();
  CHECK(sceneLines(state).empty());
  inspectNow(state, {48, 36});
  const std::vector<SceneLine> lines = sceneLines(state);
  REQUIRE(lines.size() == 7 + 64);
  const GaussianFacts facts = factsOf(*state.scene.model, *pickedGaussian(state));
  double diagonal = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(lines[i].b == lines[(i + 1) % 4].a);
    diagonal += glm::length(lines[i].b - lines[i].a);
  }
  // +-3 sigma of the two largest axes.
  const double smallest = std::min({facts.sigma.x, facts.sigma.y, facts.sigma.z});
  CHECK(diagonal == Approx(12 * (facts.sigma.x + facts.sigma.y + facts.sigma.z - smallest)).epsilon(1e-5));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    CHECK(glm::length(lines[4 + axis].b - lines[4 + axis].a) ==
          Approx(facts.sigma[static_cast<int>(axis)]).epsilon(1e-5));
    CHECK(glm::length(lines[4 + axis].a - facts.mean) < 1e-9);
  }
  // The rays of the outline touch the ellipsoid: in its own units they pass at a distance of 1.
  const glm::vec4 q = state.scene.model->rotation[*pickedGaussian(state)];
  const glm::dmat3 axes = glm::mat3_cast(glm::normalize(glm::dquat(q.x, q.y, q.z, q.w)));
  const auto unit = [&](glm::dvec3 p) { return (glm::transpose(axes) * (p - facts.mean)) / (3.0 * facts.sigma); };
  const glm::dvec3 eye = unit(state.camera.pose.position);
  for (std::size_t i = 7; i < lines.size(); ++i) {
    CHECK(glm::length(unit(lines[i].a)) == Approx(1).epsilon(1e-4));
    const glm::dvec3 way = glm::normalize(unit(lines[i].a) - eye);
    CHECK(glm::length(glm::cross(way, eye)) == Approx(1).epsilon(1e-4));
  }
  CHECK(outlineOf(*state.scene.model, *pickedGaussian(state), 3, facts.mean).empty());
}

TEST_CASE("a pixel's list is sorted by any of its columns, and turned round by a second click") {
  ViewerState state = sampleState();
  inspectNow(state, {48, 36});
  const GaussianModel& model = *state.scene.model;
  const std::vector<PixelHit>& hits = state.inspect.hits;
  const auto check = [&](HitColumn column, auto value) {
    sortHits(state, column);
    const bool first = state.inspect.descending;
    for (int turn = 0; turn < 2; ++turn) {
      const std::vector<int> order = sortedHits(model, hits, column, state.inspect.descending);
      REQUIRE(order.size() == hits.size());
      for (std::size_t i = 1; i < order.size(); ++i) {
        const double a = value(hits[static_cast<std::size_t>(order[i - 1])]);
        const double b = value(hits[static_cast<std::size_t>(order[i])]);
        CHECK((state.inspect.descending ? a >= b : a <= b));
      }
      sortHits(state, column);
    }
    CHECK(state.inspect.descending == first);
  };
  check(HitColumn::index, [](const PixelHit& h) { return static_cast<double>(h.index); });
  check(HitColumn::depth, [](const PixelHit& h) { return h.t; });
  check(HitColumn::weight, [](const PixelHit& h) { return h.weight; });
  check(HitColumn::alpha, [](const PixelHit& h) { return h.alpha; });
  check(HitColumn::opacity, [&](const PixelHit& h) { return factsOf(model, h.index).opacity; });
  check(HitColumn::size, [&](const PixelHit& h) {
    const glm::dvec3 sigma = factsOf(model, h.index).sigma;
    return std::max({sigma.x, sigma.y, sigma.z});
  });
}

TEST_CASE("the mark of an inspected pixel stays on it, and on its hit when the camera moves") {
  ViewerState state = sampleState();
  CHECK_FALSE(inspectedPoint(state));
  inspectNow(state, {48, 36});
  REQUIRE(inspectedPoint(state));
  const Camera& camera = state.inspect.camera;
  const glm::dvec3 seen = cameraFromWorld(camera, *inspectedPoint(state));
  CHECK(glm::distance(project(camera, seen), glm::dvec2(48.5, 36.5)) < 1e-6);
  CHECK(seen.z == Approx(state.inspect.hits[static_cast<std::size_t>(state.inspect.picked)].t));
  const glm::dvec3 point = *inspectedPoint(state);
  state.camera.pose.yaw += 0.3;
  CHECK(*inspectedPoint(state) == point);
}

TEST_CASE("a Gaussian's numbers are the activated ones") {
  GaussianModel model = test::trainedLikeModel(3, 5);
  model.log_scale[2] = {0, 0, -20};
  model.opacity_logit[2] = 0;
  const GaussianFacts facts = factsOf(model, 2);
  CHECK(facts.sigma.x == 1);
  CHECK(facts.opacity == 0.5);
  CHECK(facts.effective_rank == Approx(2));
  CHECK(facts.width == model.atlas.rects[2].width);
  GaussianModel plain = model;
  plain.atlas = {};
  CHECK(factsOf(plain, 2).width == 0);
}

TEST_CASE("texel centres lie on the borders of the texture's square") {
  CHECK(glm::length(texelPosition({-3, -3}, 4, 8) - glm::dvec2(0.5, 0.5)) < 1e-12);
  CHECK(glm::length(texelPosition({3, 3}, 4, 8) - glm::dvec2(3.5, 7.5)) < 1e-12);
  CHECK(glm::length(texelPosition({0, 0}, 1, 2) - glm::dvec2(0.5, 1)) < 1e-12);
}

TEST_CASE("the JSON of a pixel adds up to its colour") {
  ViewerState state = sampleState();
  inspectNow(state, {40, 30});
  RenderSettings settings;
  settings.background = {0.25f, 0.5f, 1};
  const std::string text =
      formatInspection(*state.scene.model, state.inspect.camera, settings, {40, 30}, state.inspect.hits);
  const nlohmann::json json = parseJson(text, "inspect");
  CHECK(json["format"] == "tgview-inspect");
  CHECK(json["pixel"] == nlohmann::json({40, 30}));
  REQUIRE(json["hits"].size() == state.inspect.hits.size());
  double red = json["transmittance"].get<double>() * 0.25;
  for (const nlohmann::json& hit : json["hits"]) {
    red += hit["weight"].get<double>() * (hit["base"][0].get<double>() + hit["texture"][0].get<double>());
    CHECK(hit["sigma"].size() == 3);
    CHECK(hit["effective_rank"].get<double>() >= 1);
  }
  CHECK(json["color"][0].get<double>() == Approx(red));
}

TEST_CASE("crop, exposure and resolution become what is drawn") {
  ViewerState state = sampleState();
  CHECK_FALSE(effectiveSettings(state).crop);
  const CropBox all = state.display.box;
  for (const glm::vec3 mean : state.scene.model->mean) {
    CHECK(glm::all(glm::greaterThanEqual(mean, all.min)));
    CHECK(glm::all(glm::lessThanEqual(mean, all.max)));
  }
  fitCrop(state);
  CHECK(glm::all(glm::greaterThan(state.display.box.min, all.min)));
  CHECK(glm::all(glm::lessThan(state.display.box.max, all.max)));
  press(state, 'J');
  CHECK(effectiveSettings(state).crop == state.display.box);
  CHECK(sceneLines(state).size() == 12);
  resetCrop(state);
  CHECK(state.display.box == all);
  CHECK(drawnSize(state, {800, 600}) == glm::ivec2(800, 600));
  state.display.resolution = 0.5;
  CHECK(drawnSize(state, {801, 600}) == glm::ivec2(401, 300));
  state.display.resolution = 2;
  CHECK(drawnSize(state, {10000, 10}).x == kMaxImageSide);
  state.display.resolution = 0.1;
  CHECK(drawnSize(state, {1, 1}) == glm::ivec2(1, 1));
}

TEST_CASE("every output is in the menu and has a key if one is named") {
  std::vector<Output> outputs;
  for (const KeyBinding& binding : keyBindings()) {
    if (binding.menu != Menu::output) continue;
    ViewerState state = sampleState();
    runAction(state, binding);
    outputs.push_back(state.display.output);
    CHECK(effectiveSettings(state).outputs.has(outputs.back()));
    INFO(name(outputs.back()));
    CHECK((binding.key == 0) == (*binding.keys == 0));
    if (binding.key == 0) continue;
    state.display.output = outputs.back() == Output::final ? Output::base : Output::final;
    press(state, binding.key);
    CHECK(state.display.output == outputs.back());
  }
  INFO("viewer/view/actions.cpp: a row with Menu::output for each, with 0 and \"\" where no key is free");
  for (const Output output : valuesOf<Output>()) {
    INFO(name(output));
    CHECK(std::ranges::count(outputs, output) == 1);
  }
}

TEST_CASE("keys toggle order, filter and antialiasing") {
  ViewerState state = sampleState();
  press(state, 'O');
  CHECK(state.display.settings.order == SplatOrder::perPixel);
  press(state, 'O');
  CHECK(state.display.settings.order == SplatOrder::global);
  press(state, 'Y');
  CHECK(state.display.settings.texture_filter == TextureFilter::footprint);
  press(state, 'Y', true);
  CHECK(state.display.settings.antialiasing == Antialiasing::screen);
}
