// SPDX-License-Identifier: Apache-2.0
// Files of other programs, where they are at hand.
#include <algorithm>
#include <iterator>

#include "converter/convert.h"
#include "converter/registry/file_format.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "core/bundle/ply.h"
#include "support/catch.h"
#include "support/shared_files.h"

using namespace tg;

namespace {

std::filesystem::path sample(const std::string& name) { return test::sharedFile("samples/" + name); }

struct Sample {
  const char* name;
  std::size_t gaussians;  // 0: refused
  int sh_degree;
  const char* told = "";  // in the refusal
};

// docs/formats.md and docs/gltf.md say why.
constexpr Sample kSamples[] = {
    {"generated/base.glb", 144, 0},
    {"generated/one.glb", 1, 0},
    {"generated/tex_full.glb", 144, 0},
    {"generated/tex.glb", 0, 0, "/atlases/0: \"color\" is missing"},  // an earlier form of the extension
    {"generated/bad_count.glb", 0, 0, "RECT: the count differs from POSITION's (expected 144, found 100)"},
    {"generated/bad_mode.glb", 0, 0, "/mode: wrong mode for splats (expected 0, POINTS, found 4)"},
    {"gsplat-rs/minimal_ascii.ply", 3, 0},
    {"gsplat-rs/minimal_binary.ply", 3, 0},
    {"gsplat-rs/minimal_v4_degree0.spz", 8, 0},
    {"jsplat/unitCube-ascii.ply", 20, 0},
    {"playbot/playbot_lod3.ply", 31000, 2},
    {"playbot/playbot_lod4.glb", 8406, 2},
    {"playbot/playbot_lod4.ply", 8406, 2},
    {"playbot/playbot_lod4.spz", 8406, 2},
    {"splat-transform-fixtures/minimal-raw.spz", 4, 0},
    {"splat-transform-fixtures/minimal-v2.spz", 4, 0},
    {"splat-transform-fixtures/minimal-v4.spz", 4, 0},
    {"splat-transform-fixtures/minimal.splat", 4, 0},
};

}  // namespace

TEST_CASE("every sample loads, or is refused for the reason that is documented") {
  TG_SKIP_IF(test::missingShared({"samples"}));
  for (const Sample& expected : kSamples) {
    CAPTURE(expected.name);
    const auto path = sample(expected.name);
    if (expected.gaussians == 0) {
      CHECK(refusal(path).find(expected.told) != std::string::npos);
      continue;
    }
    const Bundle loaded = readModel(path);
    CHECK(loaded.model.size() == expected.gaussians);
    CHECK(loaded.model.sh_degree == expected.sh_degree);
    CHECK(loaded.warnings.empty());
  }
}

TEST_CASE("the table of samples leaves none out") {
  TG_SKIP_IF(test::missingShared({"samples"}));
  const auto folder = sample("");
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (!entry.is_regular_file() || extension == ".md" || extension == ".txt") continue;
    const std::string name = std::filesystem::relative(entry.path(), folder).string();
    CAPTURE(name);
    CHECK(std::any_of(std::begin(kSamples), std::end(kSamples), [&](const Sample& s) { return s.name == name; }));
  }
}

TEST_CASE("the sample with every key of the extension keeps its textures") {
  TG_SKIP_IF(test::missingShared({"samples/generated/tex_full.glb"}));
  const auto path = sample("generated/tex_full.glb");
  const Bundle loaded = readModel(path);
  CHECK(loaded.model.texture_mode == TextureMode::rgba);
  CHECK(loaded.model.intersection == IntersectionModel::plane);
  CHECK(loaded.model.atlas.texels.size() == 144 * 64);
}

TEST_CASE("a GLB by another converter is the scene of the PLY it was made from") {
  TG_SKIP_IF(test::missingShared({"samples/playbot/playbot_lod4.glb", "samples/playbot/playbot_lod4.ply"}));
  const auto glb = sample("playbot/playbot_lod4.glb");
  const auto ply = sample("playbot/playbot_lod4.ply");
  const GaussianModel from_glb = readModel(glb).model;
  const GaussianModel from_ply = readModel(ply).model;
  const std::vector<Camera> views = qualityViews(from_ply, {});
  REQUIRE(views.size() == 4);
  // Axes and signs of degree 2: a wrong one costs tens of dB.
  CHECK(renderedPsnr(from_ply, from_glb, views, glm::vec3(0.0f)) > 80.0);
}

TEST_CASE("a real scene loses nothing that shows on the way through a GLB") {
  TG_SKIP_IF(test::missingShared({"samples/playbot/playbot_lod4.ply"}));
  const auto ply = sample("playbot/playbot_lod4.ply");
  const Scratch scratch;
  const ConvertReport report = convert(ply, scratch.folder() / "a.glb", {.measure = Measure::always});
  REQUIRE(report.textured_psnr);
  CHECK(*report.textured_psnr > 120.0);
  CHECK(!report.base_psnr);
}

// Both SPZ are splat-transform's, which stores a PLY's numbers unturned (docs/formats.md).
TEST_CASE("the same four splats come out of SPZ 2 and .splat") {
  TG_SKIP_IF(test::missingShared(
      {"samples/splat-transform-fixtures/minimal-v2.spz", "samples/splat-transform-fixtures/minimal.splat"}));
  const auto spz = sample("splat-transform-fixtures/minimal-v2.spz");
  const auto splat = sample("splat-transform-fixtures/minimal.splat");
  const GaussianModel a = readModel(spz, {.spz_axes = SpzAxes::rdf}).model, b = readModel(splat).model;
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    CAPTURE(i);
    CHECK(glm::length(a.mean[i] - b.mean[i]) < 1e-3f);
    CHECK(glm::length(a.log_scale[i] - b.log_scale[i]) < 0.06f);
    CHECK(a.opacity_logit[i] == b.opacity_logit[i]);
  }
}

TEST_CASE("an SPZ by another converter is the scene of the PLY it was made from") {
  TG_SKIP_IF(test::missingShared({"samples/playbot/playbot_lod4.spz", "samples/playbot/playbot_lod4.ply"}));
  const auto spz = sample("playbot/playbot_lod4.spz");
  const auto ply = sample("playbot/playbot_lod4.ply");
  const GaussianModel from_spz = readModel(spz, {.spz_axes = SpzAxes::rdf}).model;
  const GaussianModel from_ply = readModel(ply).model;
  REQUIRE(from_spz.size() == from_ply.size());
  REQUIRE(from_spz.sh_degree == from_ply.sh_degree);
  // Signs of degree 2 within SPZ's 4 to 8 bits: a wrong one costs tens of dB.
  CHECK(renderedPsnr(from_ply, from_spz, qualityViews(from_ply, {}), glm::vec3(0.0f)) > 35.0);
}
