// SPDX-License-Identifier: Apache-2.0
// What survives the way through a GLB and back.
#include <cstring>

#include "converter/convert.h"
#include "converter/glb.h"
#include "converter/gltf/write_gltf.h"
#include "converter/registry/file_format.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"
#include "core/model/fallback.h"
#include "core/model/texture_dictionary.h"
#include "core/model/verbs.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using tg::test::Random;
using tg::test::SceneKind;

namespace {

GaussianModel throughGlb(const GaussianModel& model, const Scratch& scratch, bool base_only = false) {
  const auto path = scratch.folder() / "through.glb";
  writeGlb(path, {model, {}, glm::vec3(0.0f)});
  ReadOptions options;
  options.base_only = base_only;
  return readModel(path, options).model;
}

}  // namespace

TEST_CASE("a textured scene comes back from tgz to glb to tgz within the quantisation of 8 bit") {
  const Scratch scratch;
  for (const SceneKind kind : {SceneKind::ordinary, SceneKind::flat, SceneKind::oddTextures, SceneKind::mixed}) {
    for (const IntersectionModel intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      test::TestScene scene = test::makeScene(kind, 7);
      scene.model.intersection = intersection;
      Bundle bundle;
      bundle.model = scene.model;
      bundle.cameras = {scene.camera};
      writeBundle(scratch.folder() / "in.tgz", bundle);
      convert(scratch.folder() / "in.tgz", scratch.folder() / "mid.glb",
              {.overwrite = true, .measure = Measure::never});
      convert(scratch.folder() / "mid.glb", scratch.folder() / "out.tgz",
              {.overwrite = true, .measure = Measure::never});
      const Bundle out = readBundle(scratch.folder() / "out.tgz");
      CAPTURE(test::name(kind), name(intersection));
      CHECK(out.model.texture_mode == TextureMode::rgba);
      CHECK(out.model.intersection == intersection);
      // Measured: 71 dB and more, for texels in +-0.4.
      CHECK(psnr(picture(scene.model, scene.camera), picture(out.model, scene.camera)) > 60.0);
    }
  }
}

TEST_CASE("textures that Gaussians share stand in a GLB's atlas once") {
  const Scratch scratch;
  test::TestScene scene = sharedScene(5);
  std::size_t texels = 0;
  for (std::size_t i = 0; i < 5; ++i) texels += scene.model.atlas.rects[i].texelCount();
  const auto path = scratch.folder() / "shared.glb";
  for (const bool lossy : {false, true}) {
    GltfContent content{scene.model, {}, glm::vec3(0.0f)};
    if (lossy) content.options.texture_step = 1.0f / 64;
    const GltfReport report = writeGlb(path, content);
    CAPTURE(lossy);
    CHECK(report.texels > 20 * texels);
    CHECK(static_cast<std::size_t>(report.atlas_width) * report.atlas_height < 3 * texels);
    const GaussianModel out = readModel(path).model;
    CHECK(textureGroups(out.atlas) == textureGroups(scene.model.atlas));
    CHECK(psnr(picture(scene.model, scene.camera), picture(out, scene.camera)) > 40.0);
  }
}

TEST_CASE("how textures end comes back from our files, with a warning where other programs will not know it") {
  const Scratch scratch;
  Bundle bundle;
  bundle.model = test::makeScene(SceneKind::ordinary, 8, 20).model;
  for (const TextureOutside outside : valuesOf<TextureOutside>()) {
    bundle.model.outside = outside;
    writeBundle(scratch.folder() / "in.tgz", bundle);
    for (const char* name : {"out.glb", "out.gltf", "out.html"}) {
      CAPTURE(tg::name(outside), name);
      const ConvertReport report =
          convert(scratch.folder() / "in.tgz", scratch.folder() / name, {.overwrite = true, .measure = Measure::never});
      CHECK(readModel(scratch.folder() / name).model.outside == outside);
      const std::string file = name;
      const bool warns = outside != TextureOutside::base && file != "out.html";
      REQUIRE(report.warnings.size() == (warns ? 1 : 0));
      if (!warns) continue;
      CHECK(report.warnings[0] == "glTF has no word for \"outside\": \"" + std::string(tg::name(outside)) +
                                      "\": other programs draw the base there");
    }
  }
  CHECK(describe(bundle, false).find("outside: edge\n") != std::string::npos);
}

TEST_CASE("a PLY comes back from a GLB bit by bit") {
  const Scratch scratch;
  for (int degree = 0; degree <= 3; ++degree) {
    GaussianModel model = test::makeScene(SceneKind::ordinary, 3).model;
    model.texture_mode = TextureMode::none;
    model.atlas = {};
    setShDegree(model, degree);
    for (std::size_t i = 0; i < model.size(); ++i) {
      model.rotation[i] *= 0.3f + static_cast<float>(i);       // of any length
      model.opacity_logit[i] = static_cast<float>(i) - 15.5f;  // beyond what an opacity can say
    }
    writeSplatPly(scratch.folder() / "in.ply", model);
    const ConvertOptions options = {.overwrite = true, .measure = Measure::never};
    convert(scratch.folder() / "in.ply", scratch.folder() / "mid.glb", options);
    convert(scratch.folder() / "mid.glb", scratch.folder() / "out.ply", options);
    CAPTURE(degree);
    CHECK(Glb::slurp(scratch.folder() / "out.ply") == Glb::slurp(scratch.folder() / "in.ply"));
  }
}

TEST_CASE("a lean GLB brings a PLY back within the rounding of a float") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::ordinary, 3).model;
  model.texture_mode = TextureMode::none;
  model.atlas = {};
  writeSplatPly(scratch.folder() / "in.ply", model);
  convert(scratch.folder() / "in.ply", scratch.folder() / "mid.glb", {.measure = Measure::never, .lean = true});
  Glb mid = Glb::read(scratch.folder() / "mid.glb");
  for (const auto& [name, accessor] : mid.primitive()["attributes"].items()) {
    CHECK(name.rfind("_TG_SOURCE", 0) != 0);
  }
  convert(scratch.folder() / "mid.glb", scratch.folder() / "out.ply", {.measure = Measure::never});
  const GaussianModel in = readSplatPly(scratch.folder() / "in.ply");
  const GaussianModel out = readSplatPly(scratch.folder() / "out.ply");
  REQUIRE(out.size() == in.size());
  REQUIRE(out.sh_degree == in.sh_degree);
  // Signs flip twice: the same bits.
  CHECK(std::memcmp(in.mean.data(), out.mean.data(), in.size() * sizeof(glm::vec3)) == 0);
  CHECK(std::memcmp(in.sh.data(), out.sh.data(), in.sh.size() * sizeof(glm::vec3)) == 0);
  for (std::size_t i = 0; i < in.size(); ++i) {
    CAPTURE(i);
    const glm::dvec4 before = glm::normalize(glm::dvec4(in.rotation[i]));
    CHECK(glm::length(before - glm::dvec4(out.rotation[i])) < 1e-7);  // normalised, same sign: half a float step each
    CHECK(glm::length(in.log_scale[i] - out.log_scale[i]) < 2e-6f);   // exp and log round once each
    CHECK(std::abs(opacityOf(in, i) - opacityOf(out, i)) < 1e-7);
  }
}

TEST_CASE("a textured model's numbers come back bit by bit, whatever the order of its axes") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::mixed, 12).model;
  for (std::size_t i = 0; i < model.size(); ++i) model.rotation[i] *= 0.5f + static_cast<float>(i);
  const GaussianModel out = throughGlb(model, scratch);
  REQUIRE(out.size() == model.size());
  CHECK(std::memcmp(model.rotation.data(), out.rotation.data(), model.size() * sizeof(glm::vec4)) == 0);
  CHECK(std::memcmp(model.log_scale.data(), out.log_scale.data(), model.size() * sizeof(glm::vec3)) == 0);
  CHECK(std::memcmp(model.opacity_logit.data(), out.opacity_logit.data(), model.size() * sizeof(float)) == 0);
}

TEST_CASE("what another program changed in a GLB wins over the numbers it was made from") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::ordinary, 13, 3).model;
  model.texture_mode = TextureMode::none;
  model.atlas = {};
  for (glm::vec4& q : model.rotation) q *= 2.0f;
  for (float& logit : model.opacity_logit) logit = 7.5f;
  writeGlb(scratch.folder() / "a.glb", {model, {}, glm::vec3(0.0f)});
  Glb glb = Glb::read(scratch.folder() / "a.glb");
  const auto put = [&](const std::string& semantic, float value) {
    std::memcpy(glb.bin.data() + glb.start("KHR_gaussian_splatting:" + semantic), &value, sizeof(value));
  };
  put("SCALE", 0.25f);
  put("OPACITY", 0.5f);
  const GaussianModel out = readModel(scratch.write("b.glb", glb.bytes())).model;
  CHECK(out.log_scale[0].x == std::log(0.25f));
  CHECK(out.opacity_logit[0] == 0.0f);
  CHECK(out.rotation[0] == model.rotation[0]);  // nobody touched it
  CHECK(out.opacity_logit[1] == 7.5f);
  CHECK(out.rotation[1] == model.rotation[1]);
}

TEST_CASE("the same model gives the same bytes") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::mixed, 11);
  const Camera cameras[] = {scene.camera};
  writeGlb(scratch.folder() / "a.glb", {scene.model, cameras, glm::vec3(0.5f)});
  writeGlb(scratch.folder() / "b.glb", {scene.model, cameras, glm::vec3(0.5f)});
  CHECK(Glb::slurp(scratch.folder() / "a.glb") == Glb::slurp(scratch.folder() / "b.glb"));
}

TEST_CASE("textures stay on their axes whatever the order of the scales, ties included") {
  const Scratch scratch;
  Random random(5);
  const Camera camera = lookAt({0.3, -0.4, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 96, 96);
  const float s = std::log(0.5f), t = std::log(0.3f);
  const glm::vec3 orders[] = {{s, s, s}, {t, s, s}, {s, t, s}, {s, s, t}, {t, t, s}, {t, s, t}, {s, t, t}};
  for (const glm::vec3& log_scale : orders) {
    GaussianModel model;
    model.mean = {glm::vec3(0.0f)};
    model.rotation = {glm::vec4(random.quaternion())};
    model.log_scale = {log_scale};
    model.opacity_logit = {3.0f};
    model.sh = {glm::vec3(0.2f)};
    model.texture_mode = TextureMode::rgba;
    model.atlas = makeUniformAtlas(1, 4, 3);
    for (glm::vec4& texel : model.atlas.texels) {
      for (int c = 0; c < 4; ++c) texel[c] = static_cast<float>(std::round(random.uniform(0.0, 255.0)) / 255.0);
      for (int c = 0; c < 3; ++c) texel[c] -= 0.5f;
    }
    for (const IntersectionModel intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      model.intersection = intersection;
      CAPTURE(log_scale.x, log_scale.y, log_scale.z, name(intersection));
      CHECK(psnr(picture(model, camera), picture(throughGlb(model, scratch), camera)) > 48.0);
    }
  }
}

TEST_CASE("cameras and the background come back from a GLB") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::ordinary, 2);
  Camera held_out = lookAt({1, -2, -3}, {0, 0, 0}, {0, -1, 0}, 0.9, 321, 123);
  held_out.test = true;
  held_out.name = "view_012.png";
  const std::vector<Camera> cameras = {scene.camera, held_out};
  writeGlb(scratch.folder() / "a.glb", {scene.model, cameras, glm::vec3(1.0f, 0.25f, 0.0f)});
  const Bundle loaded = readModel(scratch.folder() / "a.glb");
  CHECK(loaded.background == glm::vec3(1.0f, 0.25f, 0.0f));
  REQUIRE(loaded.cameras.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    const Camera& a = cameras[i];
    const Camera& b = loaded.cameras[i];
    CHECK(b.name == a.name);
    CHECK(b.test == a.test);
    CHECK(b.size.x == a.size.x);
    CHECK(b.size.y == a.size.y);
    CHECK(b.focal.x == a.focal.x);
    CHECK(b.focal.y == a.focal.y);
    CHECK(b.center.x == a.center.x);
    CHECK(b.center.y == a.center.y);
    CHECK(glm::length(a.translation - b.translation) < 1e-12);
    for (int k = 0; k < 3; ++k) {
      CHECK(glm::length(a.rotation[k] - b.rotation[k]) < 1e-12);
    }
  }
}

TEST_CASE("a reader without textures sees the constant that fits best") {
  const Scratch scratch;
  test::TestScene scene = test::makeScene(SceneKind::ordinary, 4);

  SECTION("a texture that is one colour and one alpha is baked without loss") {
    for (glm::vec4& texel : scene.model.atlas.texels) texel = glm::vec4(0.25f, -0.125f, 0.0f, 0.5f);
    // Bases that are clamped at 0 can not be shifted exactly; keep them positive.
    for (std::size_t i = 0; i < scene.model.sh.size(); ++i) {
      if (i % scene.model.shCount() == 0) scene.model.sh[i] = glm::vec3(0.8f);
      if (i % scene.model.shCount() != 0) scene.model.sh[i] *= 0.02f;
    }
    // Beyond 3 sigma a texture ends and its stand-in does not: the rim of alpha below 0.0111.
    const double error =
        psnr(picture(scene.model, scene.camera), picture(throughGlb(scene.model, scratch, true), scene.camera));
    CHECK(error > 40.0);
  }
  SECTION("the baked base is closer to the textured picture than the trained base") {
    Random random(9);
    for (glm::vec4& texel : scene.model.atlas.texels) {
      texel = glm::vec4(glm::vec3(random.uniformVec3(-0.1, 0.5)), random.uniform(0.2, 1.0));
    }
    const Image textured = picture(scene.model, scene.camera);
    GaussianModel trained_base = scene.model;
    trained_base.texture_mode = TextureMode::none;
    const double baked = psnr(textured, picture(throughGlb(scene.model, scratch, true), scene.camera));
    CHECK(baked > psnr(textured, picture(trained_base, scene.camera)) + 6.0);
    CHECK(baked ==
          Approx(psnr(textured, picture(bakeFallback(scene.model, FallbackScale::kept), scene.camera))).margin(0.05));
  }
}

TEST_CASE("the report states both figures and what was written") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::flat, 6);
  Bundle bundle;
  bundle.model = scene.model;
  bundle.cameras = {scene.camera};
  writeBundle(scratch.folder() / "in.tgz", bundle);
  const ConvertReport report = convert(scratch.folder() / "in.tgz", scratch.folder() / "out.glb");
  CHECK(report.gaussians == scene.model.size());
  CHECK(report.views == 1);
  CHECK(report.atlases == 1);
  REQUIRE(report.textured_psnr);
  REQUIRE(report.base_psnr);
  CHECK(*report.textured_psnr > *report.base_psnr);
  CHECK(describe(report).find("textured ") != std::string::npos);
  CHECK(describe(report).find("base only ") != std::string::npos);
  const auto json = nlohmann::json::parse(describeJson(report));
  CHECK(json["psnr"]["base_only"].get<double>() == Approx(*report.base_psnr));

  const ConvertReport ply = convert(scratch.folder() / "out.glb", scratch.folder() / "out.ply");
  CHECK(!ply.textured_psnr);
  CHECK(*ply.base_psnr == Approx(*report.base_psnr).margin(0.5));
}

TEST_CASE("opacities of exactly 0 and 1 and scales of 0 have a place") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::ordinary, 8, 3).model;
  model.texture_mode = TextureMode::none;
  model.atlas = {};
  model.opacity_logit = {-200.0f, 0.0f, 200.0f};
  const auto path = scratch.folder() / "a.glb";
  writeGlb(path, {model, {}, glm::vec3(0.0f), true});
  Glb glb = Glb::read(path);
  const std::string scale = "KHR_gaussian_splatting:SCALE";
  const std::vector<float> scales = {0.0f, 2.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 1.0f, 1.0f};
  std::memcpy(glb.bin.data() + glb.start(scale), scales.data(), scales.size() * sizeof(float));
  const GaussianModel read = readModel(scratch.write("b.glb", glb.bytes())).model;
  CHECK(read.opacity_logit[0] == -20.0f);
  CHECK(read.opacity_logit[1] == 0.0f);
  CHECK(read.opacity_logit[2] == 20.0f);
  CHECK(read.log_scale[0].x == Approx(std::log(1e-4)));
  CHECK(read.log_scale[1].x == Approx(std::log(1e-10)));
  CHECK(read.log_scale[2] == glm::vec3(0.0f));
}
