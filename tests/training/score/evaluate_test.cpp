// SPDX-License-Identifier: Apache-2.0
// Scores of a view with and without a mask, means, and what tgeval writes.
#include "training/score/evaluate.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/bundle/bundle.h"
#include "core/image/metrics.h"
#include "core/system/random.h"
#include "support/catch.h"
#include "training/score/eval_report.h"
#include "training/score/trained_on.h"

namespace {

tg::ViewPixels photograph(int width, int height, std::uint64_t seed) {
  tg::ViewPixels pixels;
  pixels.width = width;
  pixels.height = height;
  tg::Random random(seed);
  for (int i = 0; i < width * height * 3; ++i) pixels.rgb.push_back(static_cast<std::uint8_t>(random.below(256)));
  return pixels;
}

}  // namespace

TEST_CASE("a view is scored by every metric, over the pixels that count", "[evaluate]") {
  tg::ViewPixels pixels = photograph(24, 20, 1);
  tg::Image picture = pixels.image();
  for (float& value : picture.data) value = std::min(value + 0.02f, 1.0f);
  tg::ScoreOptions options;
  options.flip = true;
  tg::Image map;
  const tg::ViewScore score = tg::scoreView("a", pixels, picture, options, &map);
  CHECK(score.psnr == tg::psnr8Bit(picture, pixels.image()));
  CHECK(score.psnr_float == tg::psnr(picture, pixels.image()));
  CHECK(score.ssim == tg::ssim(picture, pixels.image()));
  REQUIRE(score.flip.has_value());
  CHECK(*score.flip == tg::flip(map));
  CHECK_FALSE(score.lpips.has_value());
  CHECK_FALSE(tg::scoreView("a", pixels, picture).flip.has_value());

  // What lies under the mask makes no difference, however wrong.
  pixels.mask.assign(24 * 20, 255);
  for (int i = 0; i < 100; ++i) pixels.mask[static_cast<std::size_t>(i)] = 0;
  const tg::ViewScore masked = tg::scoreView("a", pixels, picture, options);
  for (std::size_t i = 0; i < 300; ++i) picture.data[i] = 1 - picture.data[i];
  const tg::ViewScore same = tg::scoreView("a", pixels, picture, options);
  CHECK(same.psnr == masked.psnr);
  CHECK(same.psnr_float == masked.psnr_float);
  CHECK(same.ssim == masked.ssim);
  CHECK(same.flip == masked.flip);
}

TEST_CASE("a background that a file does not state is not the model's", "[evaluate]") {
  tg::Bundle bundle;
  bundle.format = "glb";
  bundle.cameras.resize(1);
  bundle.background = {1, 0, 0};
  CHECK(tg::trainedOn(bundle).background == glm::vec3(1, 0, 0));
  bundle.knows_background = false;
  CHECK_FALSE(tg::trainedOn(bundle).background);
}

TEST_CASE("means are over the views, a metric that no view has stays away", "[evaluate]") {
  std::vector<tg::ViewScore> scores(2);
  scores[0] = {"a", 20, 21, 0.5, 0.1, std::nullopt};
  scores[1] = {"b", 30, 32, 0.7, 0.3, std::nullopt};
  const tg::ViewScore mean = tg::meanView(scores);
  CHECK(mean.psnr == Approx(25));
  CHECK(mean.psnr_float == Approx(26.5));
  CHECK(mean.ssim == Approx(0.6));
  CHECK(mean.flip.value() == Approx(0.2));
  CHECK_FALSE(mean.lpips.has_value());
  const tg::Score short_mean = tg::meanScore(scores);
  CHECK(short_mean.psnr == mean.psnr);
  CHECK(short_mean.ssim == mean.ssim);
  CHECK(short_mean.views == 2);
  CHECK(tg::meanScore({}).views == 0);
}

TEST_CASE("the report says what was measured and how", "[evaluate]") {
  tg::EvalReport report;
  report.gaussians = 7;
  report.parameters = 1'500'000;
  report.bytes = 42;
  report.views = tg::EvalReport::Views{};
  tg::EvalReport::Views& views = *report.views;
  views.dataset = "fox";
  views.split = "test";
  views.asked = 3;
  views.options.flip = true;
  views.scores = {{"short.png", 20, 21, 0.5, 0.1, std::nullopt},
                  {"much_longer_name.png", 30, std::numeric_limits<double>::infinity(), 1, 0.3, std::nullopt}};
  const std::string text = tg::formatScores(report);
  CHECK_THAT(text, Contains("short.png             ") && Contains("7 Gaussians, 1.500 M parameters, 42 bytes"));
  CHECK_THAT(text, Contains("FLIP at 67.02 pixels per degree") && Contains("interrupted: 2 of 3 views"));
  // Columns line up: every line of the table ends at one place.
  const std::size_t first = text.find('\n');
  CHECK(text.find('\n', first + 1) == 2 * first + 1);
  CHECK(text.find('\n', 2 * first + 2) == 3 * first + 2);

  const nlohmann::json json = nlohmann::json::parse(tg::formatEvalJson(report));
  CHECK(json["interrupted"] == true);
  CHECK(json["psnr"] == 25);
  CHECK(json["flip"].get<double>() == Approx(0.2));
  CHECK(json["views"].size() == 2);
  CHECK(json["views"][1]["psnr_float"].is_null());  // JSON has no infinity
  CHECK_FALSE(json.contains("lpips"));
  CHECK_FALSE(json.contains("effective_rank"));
}

TEST_CASE("the report says how many Gaussians are needles, and how many are flat", "[evaluate]") {
  const float small = -20;
  const std::vector<glm::vec3> scales = {{0, small, small}, {0, small, 0}, {small, 0, 0}, {0, 0, 0}};
  CHECK_THAT(tg::formatRanks(tg::effectiveRanks(scales)), Contains("25.0 % needles") && Contains("50.0 % flat"));
  CHECK_THAT(tg::formatRanks(tg::effectiveRanks({})), Contains("of 0 Gaussians"));
}

TEST_CASE("photograph, rendering and error stand side by side", "[evaluate]") {
  tg::ViewPixels pixels = photograph(6, 5, 3);
  pixels.mask.assign(30, 1);
  pixels.mask[0] = 0;
  const tg::Image picture(6, 5, 3, 0.25f);
  tg::Image error(6, 5, 1);
  error.at(5, 4, 0) = 1;
  const tg::Image image = tg::sideBySide(pixels, picture, error);
  CHECK(image.width == 3 * 6 + 8);
  CHECK(image.height == 5);
  CHECK(image.at(3, 2, 1) == pixels.image().at(3, 2, 1));
  CHECK(image.at(6 + 4 + 3, 2, 1) == 0.25f);
  CHECK(image.at(20 + 3, 2, 0) == 0);  // no error: black
  CHECK(image.at(20 + 5, 4, 2) == 191 / 255.0f);  // the largest: magma's end
  CHECK(image.at(20, 0, 0) == 0.5f);   // masked: grey
}

TEST_CASE("views of which three beside each other are more pixels than a file holds are told before they are drawn",
          "[evaluate]") {
  CHECK_NOTHROW(tg::requireSideBySide({11000, 8000}, "a.png"));
  CHECK_THROWS_WITH(tg::requireSideBySide({12000, 8000}, "a.png"),
                    "a.png: three pictures of 12000 x 8000 beside each other have too many pixels (expected at most "
                    "268435456, found 288064000)");
}
