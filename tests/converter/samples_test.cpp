// SPDX-License-Identifier: Apache-2.0
// Files of other programs, where they are at hand.
#include <cstdlib>

#include "converter/convert.h"
#include "converter/read_model.h"
#include "core/ply.h"
#include "scenes.h"
#include "scratch.h"
#include "support/catch.h"

using namespace tg;

namespace {

// Empty, with a message, when the file is not there.
std::filesystem::path sample(const std::string& name) {
  const char* shared = std::getenv("TG_SHARED");
  const std::filesystem::path path = std::filesystem::path(shared != nullptr ? shared : "../shared") / "samples" / name;
  if (std::filesystem::exists(path)) return path;
  WARN("skipped: no " << path.string());
  return {};
}

}  // namespace

TEST_CASE("Generated samples: read, or refused by name") {
  if (const auto path = sample("generated/tex_full.glb"); !path.empty()) {
    const LoadedModel loaded = readModel(path);
    CHECK(loaded.model.size() == 144);
    CHECK(loaded.model.texture_mode == TextureMode::rgba);
    CHECK(loaded.model.intersection == IntersectionModel::plane);
    CHECK(loaded.model.atlas.texels.size() == 144 * 64);
    CHECK(loaded.warnings.empty());
  }
  if (const auto path = sample("generated/base.glb"); !path.empty()) CHECK(readModel(path).model.size() == 144);
  if (const auto path = sample("generated/one.glb"); !path.empty()) CHECK(readModel(path).model.size() == 1);
  if (const auto path = sample("generated/bad_count.glb"); !path.empty()) {
    CHECK(refusal(path).find("RECT: the count differs from POSITION's (expected 144, found 100)") != std::string::npos);
  }
  if (const auto path = sample("generated/bad_mode.glb"); !path.empty()) {
    CHECK(refusal(path).find("/mode: wrong mode for splats (expected 0, POINTS, found 4)") != std::string::npos);
  }
}

TEST_CASE("A GLB by another converter is the scene of the PLY it was made from") {
  const auto glb = sample("playbot/playbot_lod4.glb");
  const auto ply = sample("playbot/playbot_lod4.ply");
  if (glb.empty() || ply.empty()) return;
  const GaussianModel from_glb = readModel(glb).model;
  const GaussianModel from_ply = readModel(ply).model;
  const std::vector<Camera> views = qualityViews(from_ply, {});
  REQUIRE(views.size() == 4);
  // Axes and signs of degree 2: a wrong one costs tens of dB.
  CHECK(renderedPsnr(from_ply, from_glb, views, glm::vec3(0.0f)) > 80.0);
}

TEST_CASE("A real scene loses nothing that shows on the way through a GLB") {
  const auto ply = sample("playbot/playbot_lod4.ply");
  if (ply.empty()) return;
  const Scratch scratch;
  const ConvertReport report = convert(ply, scratch.folder() / "a.glb");
  CHECK(*report.textured_psnr > 120.0);
  CHECK(!report.base_psnr);
}

TEST_CASE("SPZ, .splat and ASCII PLY of other programs load") {
  const auto count = [](const char* name) -> std::size_t {
    const auto path = sample(name);
    return path.empty() ? 0 : readModel(path).model.size();
  };
  for (const char* name : {"splat-transform-fixtures/minimal-v2.spz", "splat-transform-fixtures/minimal-v4.spz",
                           "splat-transform-fixtures/minimal-raw.spz", "splat-transform-fixtures/minimal.splat"}) {
    CAPTURE(name);
    if (const std::size_t n = count(name); n != 0) CHECK(n == 4);
  }
  if (const std::size_t n = count("gsplat-rs/minimal_v4_degree0.spz"); n != 0) CHECK(n == 8);
  if (const std::size_t n = count("jsplat/unitCube-ascii.ply"); n != 0) CHECK(n == 20);
  if (const std::size_t n = count("gsplat-rs/minimal_ascii.ply"); n != 0) CHECK(n == 3);
}

TEST_CASE("The same four splats come out of SPZ 2 and .splat") {
  const auto spz = sample("splat-transform-fixtures/minimal-v2.spz");
  const auto splat = sample("splat-transform-fixtures/minimal.splat");
  if (spz.empty() || splat.empty()) return;
  const GaussianModel a = readModel(spz).model, b = readModel(splat).model;
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    CAPTURE(i);
    CHECK(glm::length(a.mean[i] - b.mean[i]) < 1e-3f);
    CHECK(glm::length(a.log_scale[i] - b.log_scale[i]) < 0.06f);
    CHECK(a.opacity_logit[i] == b.opacity_logit[i]);
  }
}

TEST_CASE("An SPZ by another converter is the scene of the PLY it was made from") {
  const auto spz = sample("playbot/playbot_lod4.spz");
  const auto ply = sample("playbot/playbot_lod4.ply");
  if (spz.empty() || ply.empty()) return;
  const GaussianModel from_spz = readModel(spz).model;
  const GaussianModel from_ply = readModel(ply).model;
  REQUIRE(from_spz.size() == from_ply.size());
  REQUIRE(from_spz.sh_degree == from_ply.sh_degree);
  // Signs of degree 2 within SPZ's 4 to 8 bits: a wrong one costs tens of dB.
  CHECK(renderedPsnr(from_ply, from_spz, qualityViews(from_ply, {}), glm::vec3(0.0f)) > 35.0);
}
