// SPDX-License-Identifier: Apache-2.0
// .splat comes back within its bytes, and says what they could not hold.
#include "converter/formats/splat.h"

#include <algorithm>
#include <cmath>

#include "converter/convert.h"
#include "converter/scratch.h"
#include "core/bundle/bundle.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;

TEST_CASE("a model comes back from .splat within the steps of its bytes, without SH") {
  GaussianModel in = test::makeScene(test::SceneKind::ordinary, 71, 200).model;
  in.texture_mode = TextureMode::none;
  in.atlas = {};
  REQUIRE(in.sh_degree == 3);
  SplatReport report;
  const GaussianModel out = parseSplat(formatSplat(in, report), "a.splat").model;
  REQUIRE(out.size() == in.size());
  CHECK(out.sh_degree == 0);
  std::size_t outside = 0;
  for (std::size_t i = 0; i < in.size(); ++i) {
    CAPTURE(i);
    CHECK(out.mean[i] == in.mean[i]);
    CHECK(glm::length(out.log_scale[i] - in.log_scale[i]) < 1e-6f * (1.0f + glm::length(in.log_scale[i])));
    CHECK(std::abs(opacityOf(in, i) - opacityOf(out, i)) <= 0.5 / 255 + 1e-6);
    const glm::dvec4 a = glm::normalize(glm::dvec4(in.rotation[i])), b = glm::normalize(glm::dvec4(out.rotation[i]));
    CHECK(glm::length(a - b) < 0.011);  // half a step of 1/128 in four components; a component of 1 a whole one
    const glm::vec3 color = 0.5f + 0.28209479f * in.sh[i * 16], found = 0.5f + 0.28209479f * out.sh[i];
    for (int c = 0; c < 3; ++c) CHECK(std::abs(glm::clamp(color[c], 0.0f, 1.0f) - found[c]) <= 0.5f / 255 + 1e-5f);
    outside +=
        glm::any(glm::lessThan(color, glm::vec3(-0.002f))) || glm::any(glm::greaterThan(color, glm::vec3(1.002f)));
  }
  CHECK(report.clipped_colors == outside);

  SplatReport again;
  const GaussianModel base = parseSplat(formatSplat(out, again), "a.splat").model;
  CHECK(again.clipped_colors == 0);
  CHECK(base.sh == out.sh);
  CHECK(base.opacity_logit == out.opacity_logit);
}

TEST_CASE("a .splat of a textured model is its fallback, and the summary says what is missing") {
  const Scratch scratch;
  Bundle bundle;
  bundle.model = test::makeScene(test::SceneKind::ordinary, 72, 60).model;
  REQUIRE(bundle.model.texture_mode == TextureMode::rgba);
  writeBundle(scratch.folder() / "in.tgz", bundle);
  const ConvertReport report = convert(scratch.folder() / "in.tgz", scratch.folder() / "out.splat");
  CHECK(report.output_bytes == 60 * 32);
  CHECK(report.texture_mode == "none");
  CHECK(report.base_psnr.has_value());
  REQUIRE(report.deviation.has_value());  // from the fallback: of rounding alone
  CHECK(report.deviation->mean == 0);
  CHECK(report.deviation->opacity > 0);
  CHECK(report.deviation->opacity <= 0.5 / 255 + 1e-6);
  CHECK(std::find(report.warnings.begin(), report.warnings.end(),
                  ".splat holds no SH: colours are those of degree 0") != report.warnings.end());
  CHECK(readModel(scratch.folder() / "out.splat").format == "splat");
  CHECK_THROWS_AS(writeSplat(scratch.folder() / "none.splat", GaussianModel()), Error);
  CHECK(!std::filesystem::exists(scratch.folder() / "none.splat"));
}
