// SPDX-License-Identifier: Apache-2.0
// Models made for other people's viewers, and models that stand upright.
#include "converter/edit/adapt.h"

#include <cmath>
#include <set>
#include <string_view>

#include "converter/convert.h"
#include "converter/edit/transform.h"
#include "converter/edit/upright.h"
#include "converter/edit/viewer_fit.h"
#include "converter/edits.h"
#include "converter/glb.h"
#include "converter/gltf/axes.h"
#include "converter/scratch.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;

namespace {

// Textured, with a Gaussian as wide as the room and cameras around.
Bundle room() {
  Bundle bundle;
  bundle.model = test::trainedLikeModel(3, 150);
  for (int k = 0; k < 14; ++k) {
    const double angle = 0.45 * k;
    Camera camera = lookAt({4 * std::sin(angle), -1.0, -4 * std::cos(angle)}, glm::dvec3(0.0), {0, -1, 0}, 0.9, 64, 48);
    camera.test = k % 4 == 1;
    bundle.cameras.push_back(camera);
  }
  const std::size_t wide = 5;
  bundle.model.log_scale[wide] = glm::log(glm::vec3(2.5f, 2.0f, 0.01f));
  return bundle;
}

}  // namespace

TEST_CASE("a textured file for a viewer shows our readers what it did, and that viewer's picture comes nearer") {
  const Scratch scratch;
  const Bundle source = room();
  writeBundle(scratch.folder() / "in.tgz", source);
  const GaussianModel before = readModel(scratch.folder() / "in.tgz").model;
  const auto out = scratch.folder() / "out.glb";
  const ConvertReport report = convert(scratch.folder() / "in.tgz", out, {.viewer = SplatViewer::three});
  REQUIRE(report.adapted);
  CHECK(report.adapted->wide >= 1);
  CHECK(report.adapted->pieces >= 3);
  CHECK(report.adapted->fitted);
  CHECK(report.adapted->skirts == before.size() / 4);
  CHECK(report.adapted->to_model.after > report.adapted->to_model.before);
  CHECK(std::isinf(report.adapted->ours));
  CHECK(report.gaussians == before.size() + report.adapted->pieces + report.adapted->skirts);
  // The file itself: 8-bit texels are all that textures lose, as without --for.
  const std::vector<Camera> views = {source.cameras.begin(), source.cameras.begin() + 3};
  const GaussianModel textured = readModel(out).model;
  const auto plain = scratch.folder() / "plain.glb";
  convert(scratch.folder() / "in.tgz", plain, {});
  const double lost = renderedPsnr(before, readModel(plain).model, views, source.background);
  CHECK(renderedPsnr(before, textured, views, source.background) > lost - 0.05);
  const GaussianModel base = readModel(out, {.base_only = true}).model;
  REQUIRE(base.size() == textured.size());
  const FitViews held = fitViews(bakeFallback(before, FallbackScale::kept), views, source.background, 256);
  CHECK(viewerPsnr(base, SplatViewer::three, held) >
        viewerPsnr(readModel(plain, {.base_only = true}).model, SplatViewer::three, held));
}

TEST_CASE(
    "what is so far that a viewer's bins of depth get coarse becomes a primitive of its own, in front in the file") {
  const Scratch scratch;
  Bundle source = room();
  const glm::vec3 far(0.0f, 0.0f, 1e5f);  // bins of 24 world units
  source.model.mean[70] = far;
  writeBundle(scratch.folder() / "in.tgz", source);
  const auto out = scratch.folder() / "out.glb";
  const ConvertReport report = convert(scratch.folder() / "in.tgz", out, {.viewer = SplatViewer::three});
  REQUIRE(report.adapted);
  CHECK(report.adapted->parts == 2);
  CHECK(std::isinf(report.adapted->ours));
  const Glb glb = Glb::read(out);
  const auto& primitives = glb.json["meshes"][0]["primitives"];
  REQUIRE(primitives.size() == 2);
  const auto first = glb.json["accessors"][primitives[0]["attributes"]["POSITION"].get<std::size_t>()];
  const GaussianModel textured = readModel(out).model;
  CHECK(textured.mean[0] == far);
  CHECK(first["count"].get<std::size_t>() < textured.size() / 4);
  const std::vector<Camera> views = {source.cameras.begin(), source.cameras.begin() + 3};
  CHECK(renderedPsnr(readModel(scratch.folder() / "in.tgz").model, textured, views, source.background) > 45.0);
}

TEST_CASE("a fit comes nearer to the picture that it aims at, with textures or without, and says both") {
  const Bundle source = room();
  const AdaptReport textures = adaptTo(SplatViewer::three, source, true).report;
  const AdaptReport base = adaptTo(SplatViewer::three, source, true, FitAim::base).report;
  CHECK(textures.to_model.before == base.to_model.before);
  CHECK(textures.to_base.before == base.to_base.before);
  CHECK(textures.to_model.after > base.to_model.after);
  CHECK(base.to_base.after > textures.to_base.after);
  CHECK(base.to_base.after > base.to_base.before);
}

TEST_CASE("a fit says before and after each of its steps how far it is and ends where its listener throws") {
  const Bundle source = room();
  std::vector<std::size_t> told;
  const auto stopAt = [&](std::size_t last) {
    return [&told, last](ConvertPart part, std::size_t done, std::size_t steps) {
      CHECK(part == ConvertPart::fit);
      CHECK(steps == 288);
      told.push_back(done);
      if (done == last) throw 5;
    };
  };
  CHECK_THROWS_AS(adaptTo(SplatViewer::three, source, true, FitAim::textures, stopAt(2)), int);
  CHECK(told == std::vector<std::size_t>{0, 1, 2});
  told.clear();
  CHECK_NOTHROW(adaptTo(SplatViewer::three, source, true, FitAim::textures, stopAt(289)));
  REQUIRE(told.size() == 289);
  CHECK(told.back() == 288);
}

TEST_CASE("formats without textures get the pieces in place of what is wide") {
  const Scratch scratch;
  writeBundle(scratch.folder() / "in.tgz", room());
  for (const char* name : {"out.ply", "out.splat"}) {
    CAPTURE(name);
    const ConvertReport report = convert(scratch.folder() / "in.tgz", scratch.folder() / name,
                                         {.measure = Measure::never, .viewer = SplatViewer::babylon});
    REQUIRE(report.adapted);
    CHECK(report.adapted->skirts == 0);  // that viewer's cut is far out
    CHECK(report.gaussians == 150 - report.adapted->wide + report.adapted->pieces);
    CHECK(readModel(scratch.folder() / name).model.size() == report.gaussians);
  }
  CHECK(test::messageOf(
            [&] { convert(scratch.folder() / "in.tgz", scratch.folder() / "out.sog", {.viewer = SplatViewer::spark}); },
            ErrorKind::usage) == "--for: a .sog has one base for textures and viewers (expected --no-textures)");
  CHECK(test::messageOf(
            [&] {
              convert(scratch.folder() / "in.tgz", scratch.folder() / "out.sog", {.viewer = SplatViewer::playcanvas});
            },
            ErrorKind::usage) ==
        "--for: a .sog has one base for textures and viewers (expected .glb, .gltf or --no-textures)");
  CHECK(!std::filesystem::exists(scratch.folder() / "out.sog"));
}

TEST_CASE("what a viewer cannot open is refused whatever the format or packing and nothing else is") {
  const auto refused = [](const Format& format, const ConvertOptions& options) {
    try {
      requireOpened(format, options);
      return false;
    } catch (const Error& error) {
      CHECK(error.kind == ErrorKind::usage);
      return true;
    }
  };
  struct Row {
    SplatViewer viewer;
    std::set<std::string_view> opens;
    bool meshopt;
    int newest_spz;
  };
  const Row rows[] = {
      {SplatViewer::three, {"ply", "splat", "spz", "glb", "gltf"}, true, 4},
      {SplatViewer::playcanvas, {"ply", "compressed.ply", "sog", "lod-meta.json", "glb", "gltf"}, false, 4},
      {SplatViewer::babylon, {"ply", "compressed.ply", "splat", "spz", "sog", "lod-meta.json", "glb", "gltf"}, true, 4},
      {SplatViewer::cesium, {"tileset.json"}, true, 4},
      {SplatViewer::spark, {"ply", "compressed.ply", "splat", "spz", "sog"}, true, 3},
  };
  REQUIRE(std::size(rows) == kCount<SplatViewer>);
  for (const Row& row : rows) {
    CAPTURE(name(row.viewer));
    for (const Format& format : formats()) {
      CAPTURE(format.name);
      const bool opened = row.opens.contains(format.name);
      CHECK(refused(format, {.viewer = row.viewer}) == !opened);
      CHECK(!refused(format, {}));
      if (!opened) continue;
      const bool packs = format.is_gltf && !row.meshopt;
      CHECK(refused(format, {.meshopt = true, .viewer = row.viewer}) == packs);
      CHECK(refused(format, {.steps = 1.0f, .viewer = row.viewer}) == packs);
      CHECK(refused(format, {.target = {.bytes = 1000}, .viewer = row.viewer}) == packs);
      CHECK(!refused(format, {.quantize = true, .texture_step = 0.1f, .viewer = row.viewer}));
      CHECK(!refused(format, {.spz_version = 3, .viewer = row.viewer}));
      CHECK(refused(format, {.spz_version = 4, .viewer = row.viewer}) == (format.name == "spz" && row.newest_spz < 4));
    }
  }
}

TEST_CASE("a model without cameras is made for a viewer from a ring around it") {
  Bundle bundle = room();
  bundle.cameras.clear();
  const Adapted adapted = adaptTo(SplatViewer::playcanvas, bundle, false);
  CHECK(adapted.report.wide == 0);  // wide for a distance that nobody knows
  CHECK(adapted.report.to_model.after >= adapted.report.to_model.before);
  CHECK(adapted.report.held_views > 0);
  CHECK_NOTHROW(checkModel(adapted.model, "adapted"));
}

TEST_CASE("up is what the cameras agree on") {
  Bundle bundle = room();
  CHECK(glm::distance(*upOf(bundle.cameras), glm::dvec3(0, -1, 0)) < 1e-9);
  // All of them look down from one side: their tops lean, their right sides do not.
  std::vector<Camera> above;
  for (const double x : {-3.0, -1.0, 1.0, 3.0}) {
    above.push_back(lookAt({x, -4.0, -4.0 + std::abs(x)}, glm::dvec3(0.0), {0, -1, 0}, 0.9, 64, 48));
  }
  CHECK(glm::distance(*upOf(above), glm::dvec3(0, -1, 0)) < 1e-6);
  CHECK(!upOf({}));
  Camera over = bundle.cameras[0];
  over.rotation = glm::dmat3(-1, 0, 0, 0, -1, 0, 0, 0, 1) * over.rotation;
  CHECK(!upOf(std::vector<Camera>{bundle.cameras[0], over}));
  CHECK(glm::distance(*upOf(std::vector<Camera>{bundle.cameras[0]}), -glm::transpose(bundle.cameras[0].rotation)[1]) <
        1e-12);
}

TEST_CASE("a turn into nearly the opposite direction is one and arrives there") {
  const glm::dvec3 from = glm::normalize(glm::dvec3(0.3, -0.5, 0.8));
  const glm::dvec3 side = glm::normalize(glm::cross(from, glm::dvec3(0.1, 0.9, 0.2)));
  for (const double off : {0.0, 1e-12, 1e-6, 2e-6, 1e-5, 1e-4, 1e-2, 1.0}) {  // [rad]
    const glm::dvec3 to = glm::normalize(-std::cos(off) * from + std::sin(off) * side);
    const glm::dmat3 turn = turnBetween(from, to), square = turn * glm::transpose(turn) - glm::dmat3(1.0);
    CAPTURE(off);
    for (int k = 0; k < 3; ++k) CHECK(glm::length(square[k]) < 1e-12);
    CHECK(glm::determinant(turn) == Approx(1.0));
    CHECK(glm::distance(turn * from, to) < 2e-9);
  }
}

TEST_CASE("the edit --upright turns the model and its cameras so that their up is -y, and changes no picture") {
  Bundle bundle = room();
  const FrameT<double> before = referenceFrame(bundle.model, bundle.cameras[2]);
  Similarity tilt;
  tilt.rotation = matrixFromQuaternion(glm::normalize(glm::dvec4(0.3, 0.8, -0.4, 0.2)));
  transformModel(bundle.model, tilt);
  transformCameras(bundle.cameras, tilt);
  const std::vector<Edit> upright = {{"--upright", "", {}}};
  applyEdits(bundle, upright, false);
  CHECK(glm::distance(*upOf(bundle.cameras), glm::dvec3(0, -1, 0)) < 1e-6);
  CHECK(framePsnr(before, referenceFrame(bundle.model, bundle.cameras[2])) > 75.0);
  // Upside down, exactly.
  Similarity over;
  over.rotation = glm::dmat3(-1, 0, 0, 0, -1, 0, 0, 0, 1);
  transformCameras(bundle.cameras, over);
  applyEdits(bundle, upright, false);
  CHECK(glm::distance(*upOf(bundle.cameras), glm::dvec3(0, -1, 0)) < 1e-6);
  bundle.cameras.clear();
  CHECK(test::messageOf([&] { applyEdits(bundle, upright, false); }, ErrorKind::usage) ==
        "--upright: the model has no cameras that know (expected --rotate)");
}
