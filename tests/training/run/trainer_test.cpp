// SPDX-License-Identifier: Apache-2.0
// The whole recipe on a small built-in scene: it learns, it is deterministic, it stops cleanly.
#include "training/run/trainer.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <thread>

#include "core/image/metrics.h"
#include "core/merge/decimate.h"
#include "core/model/fallback.h"
#include "core/model/texture_dictionary.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "render/contribution.h"
#include "support/catch.h"
#include "support/same.h"
#include "support/temporary_folder.h"
#include "training/data/sample.h"
#include "training/every_setting.h"
#include "training/render_picture.h"
#include "training/run/checkpoint.h"
#include "training/run/init.h"
#include "training/run/report.h"
#include "training/sample_dataset.h"
#include "training/score/evaluate.h"
#include "training/settings/schedule.h"
#include "training/step/context.h"
#include "training/step/filter_3d.h"
#include "training/step/optimizer.h"
#include "training/step/textures.h"

namespace {

constexpr tg::SampleOptions kScene{.size = 48, .train_views = 8, .test_views = 2, .points = 600, .supersampling = 2};

tg::Dataset sampleDataset() { return tg::test::sampleDataset(kScene); }

tg::TrainSettings shortRun() {
  tg::TrainSettings settings;
  settings.iterations = 60;
  settings.texture_iterations = 60;
  settings.seed = 7;
  settings.pixels_per_texel = 0;  // of which there are few
  return settings;
}

// Of stage 1 alone, with more rounds.
tg::TrainSettings densifyingRun() {
  tg::TrainSettings settings = shortRun();
  settings.iterations = 240;
  settings.texture_iterations = 0;
  settings.densify_every = 10;
  return settings;
}

}  // namespace

TEST_CASE("adding textures and SH degrees leaves the picture the same to the last bit", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  tg::TrainingState state;
  state.model = tg::gaussiansFromPoints(dataset.points);
  tg::resetMoments(state);
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  for (const tg::IntersectionModel model : {tg::IntersectionModel::plane, tg::IntersectionModel::maxResponse}) {
    state.model.intersection = model;
    const tg::Camera& camera = dataset.views[0];
    const tg::Image plain = tg::test::renderPicture(*renderer, state.model, camera, dataset.background);
    for (const tg::TextureMode mode : {tg::TextureMode::alpha, tg::TextureMode::rgb, tg::TextureMode::rgba}) {
      tg::TrainingState textured = state;
      tg::growShDegree(textured, 3);
      tg::addTextures(textured, tg::uniformRects(textured.model.size(), 4, 0), mode, tg::TextureInit::neutral);
      tg::checkModel(textured.model, "textured");
      CHECK(tg::test::renderPicture(*renderer, textured.model, camera, dataset.background).data == plain.data);
    }
  }
}

TEST_CASE("both stages lower the loss, and the report says so", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.compare_untextured = true;
  double first_loss = 0;
  int calls = 0;
  tg::TrainHooks hooks;
  hooks.after_step = [&](const tg::Trainer& trainer) {
    const tg::TrainProgress progress = trainer.progress();
    if (calls++ == 0) first_loss = progress.loss;
    CHECK(progress.gaussians > 0);
    CHECK(progress.seconds_left >= 0);
  };
  const tg::TrainResult result = tg::train(dataset, settings, *renderer, hooks);
  CHECK(calls == 180);
  tg::checkModel(result.model, "model");
  CHECK(result.model.sh_degree == 3);
  CHECK(result.model.texture_mode == tg::TextureMode::rgba);
  CHECK(result.model.atlas.texels.size() == result.model.size() * 16);
  for (const glm::vec4& texel : result.model.atlas.texels) REQUIRE((texel.a >= 0 && texel.a <= 1));

  const tg::TrainReport& report = result.report;
  CHECK(report.plain.loss < 0.9 * first_loss);
  REQUIRE(report.textured);
  REQUIRE(report.untextured);
  CHECK(report.textured->loss < report.plain.loss);
  CHECK(report.textured->gaussians == report.untextured->gaussians);
  REQUIRE(result.untextured);
  CHECK(result.untextured->texture_mode == tg::TextureMode::none);
  REQUIRE(report.plain.test);
  REQUIRE(report.textured->test);
  CHECK(report.textured->test->psnr > report.plain.test->psnr);
  CHECK(report.textured->test->views == 2);

  const std::string text = tg::formatTrainingJson(dataset, settings, report, result.model, {});
  const nlohmann::json json = nlohmann::json::parse(text);
  CHECK(json["stages"]["textured"]["test_psnr"].get<double>() == Approx(report.textured->test->psnr).margin(1e-3));
  CHECK(json["settings"]["seed"] == 7);
  CHECK(json["gaussians"] == result.model.size());
  CHECK(text.find('/') == std::string::npos);  // no paths
}

TEST_CASE("same seed, same model at any thread count, another seed, another model", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  tg::TrainSettings settings = shortRun();
  const auto trained = [&](int threads) {
    tg::setThreadCount(threads);
    const auto renderer = tg::makeCpuDifferentiableRenderer();
    tg::TrainResult result = tg::train(dataset, settings, *renderer);
    tg::setThreadCount(0);
    return result;
  };
  const tg::TrainResult one = trained(1);
  const tg::TrainResult two = trained(2);
  tg::test::checkSame(one.model, two.model);
  tg::TrainingJsonOptions json;
  json.measurements = false;
  CHECK(tg::formatTrainingJson(dataset, settings, one.report, one.model, json) ==
        tg::formatTrainingJson(dataset, settings, two.report, two.model, json));
  settings.seed = 8;
  CHECK(trained(2).model.mean != one.model.mean);
}

TEST_CASE("the untextured twin does not change the textured result", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  tg::TrainSettings settings = shortRun();
  settings.iterations = 20;
  settings.texture_iterations = 20;
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const tg::TrainResult alone = tg::train(dataset, settings, *renderer);
  settings.compare_untextured = true;
  tg::test::checkSame(tg::train(dataset, settings, *renderer).model, alone.model);
}

TEST_CASE("stage 2 on a saved stage-1 model is stage 2 of one run", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.iterations = settings.texture_iterations = 20;
  const tg::TrainResult whole = tg::train(dataset, settings, *renderer);
  settings.texture_iterations = 0;
  const tg::GaussianModel plain = tg::train(dataset, settings, *renderer).model;
  settings.iterations = 0;
  settings.texture_iterations = 20;
  tg::test::checkSame(tg::train(dataset, settings, *renderer, {}, plain).model, whole.model);
}

TEST_CASE("a start model keeps as many Gaussians and coefficients as the settings allow", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.texture_mode = tg::TextureMode::none;
  tg::GaussianModel start = tg::train(dataset, settings, *renderer).model;
  tg::setShDegree(start, 2);
  settings.iterations = 0;
  settings.sh_degree = 2;
  tg::test::checkSame(tg::train(dataset, settings, *renderer, {}, start).model, start);
  settings.sh_degree = 1;
  settings.gaussians = start.size() / 2;
  settings.limit_by = tg::LimitBy::room;
  const tg::GaussianModel less = tg::train(dataset, settings, *renderer, {}, start).model;
  CHECK(less.sh_degree == 1);
  CHECK(less.size() == start.size() / 2);
}

TEST_CASE("stage 2 goes on with the textures of a start model, whatever their sizes and mode", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.texture_mode = tg::TextureMode::rgb;
  settings.texture_sizes = tg::TextureSizes::footprint;
  const tg::TrainResult first = tg::train(dataset, settings, *renderer);
  settings.texture_mode = tg::TextureMode::rgba;
  const tg::TrainResult again = tg::train(dataset, settings, *renderer, {}, first.model);
  CHECK(again.model.atlas.rects == first.model.atlas.rects);
  CHECK(again.model.texture_mode == tg::TextureMode::rgb);
  CHECK(again.report.plain.iterations == 0);
  CHECK(again.report.textured->loss < first.report.textured->loss);
  settings.texture_iterations = 0;
  tg::test::checkSame(tg::train(dataset, settings, *renderer, {}, first.model).model, first.model);
  const char* refusal = "the start model has textures already";
  tg::TrainSettings other = settings;
  other.texture_iterations = 1;
  other.compare_untextured = true;
  CHECK_THROWS_WITH(tg::train(dataset, other, *renderer, {}, first.model), Contains(refusal));
  other = settings;
  other.texture_init = tg::TextureInit::paper;
  CHECK_THROWS_WITH(tg::train(dataset, other, *renderer, {}, first.model), Contains(refusal));
  const auto identity = [&](const tg::GaussianModel& start) {
    return tg::runIdentity(dataset, settings, "", &start).data;
  };
  tg::GaussianModel recolored = first.model;
  recolored.atlas.texels[3].r += 0.1f;
  CHECK(identity(recolored) != identity(first.model));
  tg::GaussianModel clipped = first.model;
  clipped.outside = tg::TextureOutside::clip;
  CHECK(identity(clipped) != identity(first.model));
}

TEST_CASE("a start model whose textures go on with their border is refused", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::GaussianModel start = tg::train(dataset, shortRun(), *renderer).model;
  start.outside = tg::TextureOutside::edge;
  CHECK_THROWS_WITH(tg::train(dataset, shortRun(), *renderer, {}, start),
                    "the start model has \"outside\": \"edge\", which has no gradient (expected \"base\" or \"clip\")");
}

TEST_CASE("what is drawn beyond new textures is the setting, and of a textured start model its own", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.texture_outside = tg::TextureOutside::edge;
  CHECK_THROWS_WITH(tg::train(dataset, settings, *renderer),
                    "--texture-outside edge has no gradient (expected base or clip)");
  settings.texture_outside = tg::TextureOutside::clip;
  const tg::GaussianModel first = tg::train(dataset, settings, *renderer).model;
  CHECK(first.outside == tg::TextureOutside::clip);
  settings.texture_outside = tg::TextureOutside::base;
  CHECK(tg::train(dataset, settings, *renderer, {}, first).model.outside == tg::TextureOutside::clip);
  tg::GaussianModel points = tg::gaussiansFromPoints(dataset.points);
  points.outside = tg::TextureOutside::edge;
  CHECK(tg::train(dataset, settings, *renderer, {}, points).model.outside == tg::TextureOutside::base);
  CHECK(tg::train(dataset, settings, *renderer).model.outside == tg::TextureOutside::base);
}

TEST_CASE("textures are no larger than the training views can teach, unless a size is given", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  std::uint64_t pixels = 0;
  for (const std::size_t view : dataset.indices(false)) {
    pixels +=
        static_cast<std::uint64_t>(dataset.views[view].size.x) * static_cast<std::uint64_t>(dataset.views[view].size.y);
  }
  const auto texels = [&](float pixels_per_texel, int size) {
    tg::TrainSettings settings = shortRun();
    settings.iterations = settings.texture_iterations = 1;
    settings.pixels_per_texel = pixels_per_texel;
    settings.texture_size = size;
    const auto renderer = tg::makeCpuDifferentiableRenderer();
    const tg::GaussianModel model = tg::train(dataset, settings, *renderer).model;
    return std::pair{model.atlas.texels.size(), model.size()};
  };
  const auto [all, gaussians] = texels(0, 0);
  CHECK(all == 16 * gaussians);
  for (const int side : {3, 1}) {  // as many pixels as this side needs, and a bit
    const double each = static_cast<double>(pixels) / static_cast<double>(gaussians) / (side * side + 0.5);
    CHECK(texels(static_cast<float>(each), 0).first == static_cast<std::size_t>(side * side) * gaussians);
  }
  CHECK(texels(1e6f, 0).first == gaussians);  // 1 x 1 at least
  CHECK(texels(1e6f, 4).first == 16 * gaussians);
}

TEST_CASE("adaptive textures keep to their number of texels, and show what more uniform ones cannot", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.texture_iterations = 100;
  settings.texture_size = 8;
  settings.adaptive_texels = 4;
  tg::Trainer trainer(dataset, settings, *renderer);
  while (trainer.stage() == tg::Stage::plain || trainer.state().iteration < 50) REQUIRE(trainer.step());
  CHECK(trainer.model().atlas.texels.size() == 64 * trainer.model().size());
  REQUIRE(trainer.step());
  const std::vector<tg::TextureRect> rects = trainer.model().atlas.rects;
  while (trainer.step()) continue;
  const tg::TrainResult adaptive = trainer.result();
  tg::checkModel(adaptive.model, "model");
  CHECK(adaptive.model.atlas.rects == rects);
  const std::size_t limit = 4 * adaptive.model.size();
  CHECK(adaptive.model.atlas.texels.size() <= limit);
  CHECK(adaptive.model.atlas.texels.size() > limit * 9 / 10);
  const auto [least, most] = std::minmax_element(
      rects.begin(), rects.end(), [](const auto& a, const auto& b) { return a.texelCount() < b.texelCount(); });
  CHECK(least->texelCount() == 0);
  CHECK(most->texelCount() == 64);
  settings.adaptive_texels = 0;
  settings.texture_size = 2;
  const tg::TrainResult uniform = tg::train(dataset, settings, *renderer);
  REQUIRE((adaptive.report.textured && uniform.report.textured));
  CHECK(adaptive.report.textured->train_psnr > uniform.report.textured->train_psnr);
}

namespace {

double trainingPsnr(const tg::Dataset& dataset, const tg::GaussianModel& model, tg::DifferentiableRenderer& renderer) {
  const auto draw = [&](const tg::Camera& camera) {
    return tg::test::renderPicture(renderer, model, camera, dataset.background);
  };
  return tg::meanScore(tg::scoreViews(dataset, dataset.indices(false), draw)).psnr;
}

}  // namespace

TEST_CASE("with a dictionary Gaussians share its textures to the end, and it learns as they do", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.texture_iterations = 100;
  settings.texture_dictionary = 6;
  settings.quantize_iterations = 20;
  tg::Trainer trainer(dataset, settings, *renderer);
  trainer.onQuantizing([](const tg::GaussianModel& model, float&) { return model; });
  const auto different = [](const tg::GaussianModel& model) {
    const std::vector<std::uint32_t> groups = tg::textureGroups(model.atlas);
    return *std::ranges::max_element(groups) + 1;
  };
  while (trainer.stage() == tg::Stage::plain || trainer.state().iteration < 25) REQUIRE(trainer.step());
  CHECK(different(trainer.model()) > 6);
  const std::vector<glm::vec4> before = trainer.model().atlas.texels;
  const std::atomic<bool> stop = true;
  CHECK_FALSE(trainer.step(&stop));  // between k-means' rounds
  CHECK(trainer.state().iteration == 25);
  CHECK(trainer.model().atlas.texels == before);
  REQUIRE(trainer.step());
  const tg::GaussianModel first = trainer.model();
  CHECK(different(first) <= 6);
  CHECK(different(first) > 1);
  while (trainer.step()) CHECK(different(trainer.model()) == different(first));
  const tg::TrainResult result = trainer.result();
  tg::checkModel(result.model, "model");
  REQUIRE((result.report.textured && result.report.quantized));
  const auto psnr = [&](const tg::GaussianModel& model) { return trainingPsnr(dataset, model, *renderer); };
  CHECK(psnr(result.model) > psnr(first) + 0.1);

  for (const auto change : {+[](tg::TrainSettings& s) { s.texture_mode = tg::TextureMode::none; },
                            +[](tg::TrainSettings& s) { s.texture_sizes = tg::TextureSizes::footprint; },
                            +[](tg::TrainSettings& s) { s.adaptive_texels = 4; }}) {
    tg::TrainSettings wrong = settings;
    change(wrong);
    CHECK_THROWS_WITH(tg::checkSettings(wrong), Contains("--texture-dictionary is of textures of one size"));
  }
}

TEST_CASE("textures that are equal by chance are not shared, neither in a run that goes on nor in a file's",
          "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const bool dictionary = GENERATE(true, false);
  tg::TrainSettings settings = shortRun();
  settings.texture_iterations = 40;
  settings.texture_dictionary = dictionary ? 6 : 0;
  settings.quantize_iterations = 20;
  const auto rounded = [](const tg::GaussianModel& model, float&) { return model; };
  tg::Trainer trainer(dataset, settings, *renderer);
  trainer.onQuantizing(rounded);
  const tg::Stage stage = dictionary ? tg::Stage::textured : tg::Stage::quantized;
  while (trainer.stage() != stage || trainer.state().iteration < (dictionary ? 20 : 0)) REQUIRE(trainer.step());
  tg::RunState state = trainer.state();
  REQUIRE(state.texture_groups);
  const std::vector<std::uint32_t> groups = *state.texture_groups;
  CHECK(groups.empty() != dictionary);
  if (!dictionary) state.texture_groups.reset();  // as where the stage begins
  std::ranges::fill(state.training.model.atlas.texels, glm::vec4(0.25f));
  tg::Trainer next(dataset, settings, *renderer, std::move(state));
  next.onQuantizing(rounded);
  REQUIRE(next.step());
  CHECK(next.state().texture_groups == groups);
}

TEST_CASE("rotations and scales that a file takes from textures are those of the texels that it holds", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.texture_dictionary = GENERATE(0, 4);
  settings.quantize_iterations = 30;
  const auto follow = [](tg::GaussianModel model) {
    for (std::size_t i = 0; i < model.size(); ++i) {
      const float alpha = model.atlas.texels[model.atlas.rects[i].offset + 5].a;
      model.log_scale[i] = glm::vec3(-3.0f - alpha);
      model.rotation[i] = glm::vec4(1, alpha, 0, 0);
    }
    return model;
  };
  tg::Trainer trainer(dataset, settings, *renderer);
  trainer.onQuantizing([&](const tg::GaussianModel& model, float&) { return follow(model); });
  while (trainer.step()) continue;
  const tg::GaussianModel model = trainer.model();
  CHECK(model.log_scale == follow(model).log_scale);
  CHECK(model.rotation == follow(model).rotation);
}

TEST_CASE("a texture that a file leaves out is left out in training, with what stands in for it", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.quantize_iterations = 20;
  tg::Trainer trainer(dataset, settings, *renderer);
  std::vector<float> scales;  // of the first Gaussian, of each call
  trainer.onQuantizing([&](const tg::GaussianModel& model, float&) {
    tg::GaussianModel stored = model;
    scales.push_back(model.log_scale[0].x);
    stored.atlas.rects[0] = {};
    stored.log_scale[0] -= 0.25f;
    return stored;
  });
  while (trainer.step()) continue;
  const tg::GaussianModel model = trainer.model();
  REQUIRE(scales.size() == 5);
  CHECK(scales[3] == scales[2]);  // scales are taken, and those of this one wait for its texels
  CHECK(model.log_scale[0].x == scales[3] - 0.25f);
  const tg::TextureRect rect = model.atlas.rects[0];
  REQUIRE(rect.texelCount() > 0);
  for (std::size_t t = 0; t < rect.texelCount(); ++t) {
    CHECK(model.atlas.texels[rect.offset + t] == glm::vec4(0, 0, 0, 1));
  }
}

TEST_CASE("what a file takes from the mean of texels and leaves in DC is taken so in training", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.densification = tg::Densification::none;
  settings.iterations = 0;
  settings.texture_iterations = 1;
  settings.quantize_iterations = 5;
  settings.texture_mode = GENERATE(tg::TextureMode::rgba, tg::TextureMode::alpha);
  settings.texture_init = tg::TextureInit::paper;
  // What is drawn changes by what is taken from the file alone.
  for (float tg::TrainSettings::* const rate :
       {&tg::TrainSettings::rate_position, &tg::TrainSettings::rate_position_end, &tg::TrainSettings::rate_rotation,
        &tg::TrainSettings::rate_scale, &tg::TrainSettings::rate_opacity, &tg::TrainSettings::rate_sh_dc,
        &tg::TrainSettings::rate_sh_rest, &tg::TrainSettings::rate_texels}) {
    settings.*rate = 0;
  }
  tg::Trainer trainer(dataset, settings, *renderer);
  std::optional<tg::GaussianModel> file;
  trainer.onQuantizing([&](const tg::GaussianModel& model, float&) {
    tg::GaussianModel stored = tg::bakeFallback(model, tg::FallbackScale::kept);
    stored.texture_mode = model.texture_mode;
    stored.atlas = model.atlas;
    for (glm::vec4& texel : stored.atlas.texels) texel = {0, 0, 0, texel.a};
    tg::removeFallback(stored, tg::FallbackScale::kept);
    if (!file) file = stored;
    return stored;
  });
  while (trainer.stage() != tg::Stage::quantized) REQUIRE(trainer.step());
  const tg::GaussianModel before = trainer.model();
  while (trainer.step()) continue;
  const tg::GaussianModel after = trainer.model();
  const bool has_color = settings.texture_mode == tg::TextureMode::rgba;
  CHECK((after.atlas.texels != before.atlas.texels) == has_color);
  for (std::size_t i = 0; i < after.size(); ++i) {
    const glm::vec3 change = after.sh[i * after.shCount()] - before.sh[i * before.shCount()];
    CHECK(change.r == Approx(has_color ? 25.0 / 255 / double{tg::kShC0} : 0).margin(1e-6));
  }
  const tg::Camera& camera = dataset.views[0];
  CHECK(tg::psnr(tg::test::renderPicture(*renderer, *file, camera, dataset.background), trainer.picture(camera)) > 60);
}

TEST_CASE("a dictionary of more textures than half of the Gaussians is kept in training for a file", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.gaussians = 12;
  settings.texture_iterations = 100;
  settings.texture_dictionary = 10;
  settings.quantize_iterations = 20;
  tg::Trainer trainer(dataset, settings, *renderer);
  trainer.onQuantizing([](const tg::GaussianModel& model, float&) { return model; });
  const auto groups = [&] { return tg::textureGroups(trainer.model().atlas); };
  while (trainer.stage() != tg::Stage::quantized) REQUIRE(trainer.step());
  const std::vector<std::uint32_t> shared = groups();
  const std::size_t different = *std::ranges::max_element(shared) + 1;
  REQUIRE(different < shared.size());
  REQUIRE(2 * different > shared.size());
  REQUIRE_FALSE(tg::areShared(trainer.model().atlas, shared));
  while (trainer.step()) CHECK(groups() == shared);
}

namespace {

// What a coarse file would leave of a model, the textures in an order of their own.
tg::GaussianModel rounded(const tg::GaussianModel& model, float step) {
  const auto round = [&](auto value) { return glm::round(value / step) * step; };
  tg::GaussianModel stored = model;
  for (glm::vec3& mean : stored.mean) mean = round(mean);
  for (glm::vec3& log_scale : stored.log_scale) log_scale = round(log_scale);
  for (float& logit : stored.opacity_logit) logit = round(logit);
  for (glm::vec3& sh : stored.sh) sh = round(sh);
  stored.atlas = {};
  for (std::size_t i = model.atlas.rects.size(); i-- > 0;) {
    tg::TextureRect rect = model.atlas.rects[i];
    const auto from = model.atlas.texels.begin() + rect.offset;
    rect.offset = static_cast<std::uint32_t>(stored.atlas.texels.size());
    for (std::size_t t = 0; t < rect.texelCount(); ++t) stored.atlas.texels.push_back(round(from[t]));
    stored.atlas.rects.insert(stored.atlas.rects.begin(), rect);
  }
  return stored;
}

}  // namespace

TEST_CASE("what a coarse file takes, training for it gives back in part", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.sh_degree = 1;
  settings.iterations = 600;
  settings.texture_iterations = 200;
  const auto psnr = [&](const tg::GaussianModel& model) { return trainingPsnr(dataset, model, *renderer); };
  constexpr float kStep = 0.2f;
  const double without = psnr(rounded(tg::train(dataset, settings, *renderer).model, kStep));

  settings.quantize_iterations = 180;
  std::vector<float> asked;
  const auto stored = [&](const tg::GaussianModel& model, float& steps) {
    asked.push_back(std::exchange(steps, kStep));
    return rounded(model, kStep);
  };
  tg::Trainer trainer(dataset, settings, *renderer);
  trainer.onQuantizing(stored);
  std::optional<tg::RunState> middle;
  while (trainer.step()) {
    const tg::RunState& state = trainer.state();
    if (state.stage != tg::Stage::quantized) continue;
    const tg::GaussianModel& model = state.training.model;
    const tg::GaussianModel file = rounded(model, kStep);
    CHECK(model.mean == file.mean);
    CHECK((model.log_scale == file.log_scale) == (state.iteration > 72));
    CHECK((model.opacity_logit == file.opacity_logit) == (state.iteration > 108));
    CHECK((model.sh[1] == file.sh[1] && model.sh[3] == file.sh[3]) == (state.iteration > 144));
    if (state.iteration == 80) middle = state;
  }
  CHECK(asked == std::vector<float>{0, kStep, kStep, kStep, kStep});
  CHECK(trainer.fileSteps() == kStep);
  const tg::GaussianModel last = trainer.model();
  CHECK(psnr(rounded(last, kStep)) > without + 1);
  REQUIRE(trainer.report().quantized);
  CHECK(trainer.report().quantized->iterations == 180);

  REQUIRE(middle);
  tg::Trainer resumed(dataset, settings, *renderer, *middle);
  resumed.onQuantizing(stored);
  while (resumed.step()) continue;
  tg::test::checkSame(resumed.model(), last);
  settings.compare_untextured = true;
  CHECK_THROWS_WITH(tg::checkSettings(settings), Contains("no twin without textures"));
}

TEST_CASE("a threshold above the opacity of points is named where it leaves no Gaussian", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = densifyingRun();
  settings.prune_opacity = 1;
  const auto says = Contains(": --prune-opacity 1 prunes what is less opaque (points begin at 0.1)");
  CHECK_THROWS_WITH(tg::train(dataset, settings, *renderer), says);
  // Of a start model, whose opacities are its own.
  tg::Trainer points(dataset, settings, *renderer);
  tg::GaussianModel start = points.model();
  std::ranges::fill(start.opacity_logit, 2.0f);
  tg::Trainer trainer(dataset, settings, *renderer, start);
  CHECK_THROWS_WITH(
      [&] {
        while (trainer.step()) continue;
      }(),
      says);
}

TEST_CASE("where no Gaussian is left for another reason it is asked whether the cameras see any", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const tg::TrainSettings settings = densifyingRun();
  tg::Trainer points(dataset, settings, *renderer);
  tg::GaussianModel start = points.model();
  std::ranges::fill(start.opacity_logit, -9.0f);
  tg::Trainer trainer(dataset, settings, *renderer, start);
  CHECK_THROWS_WITH(
      [&] {
        while (trainer.step()) continue;
      }(),
      Contains(": do the cameras see what it began with?"));
}

TEST_CASE("a model of lower SH degree than the settings' is trained for a file, too", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.texture_mode = tg::TextureMode::none;
  settings.iterations = 4;
  settings.sh_every = 0;
  settings.sh_degree = 3;
  settings.quantize_iterations = 5;
  tg::Trainer trainer(dataset, settings, *renderer);
  trainer.onQuantizing([](const tg::GaussianModel& model, float&) { return rounded(model, 0.2f); });
  while (trainer.step()) {
    if (trainer.stage() == tg::Stage::quantized) CHECK(tg::momentsAgree(trainer.state().training));
  }
  // A turn an iteration, none left out.
  const tg::GaussianModel model = trainer.model(), file = rounded(model, 0.2f);
  CHECK(model.sh_degree == 3);
  CHECK(model.mean == file.mean);
  CHECK(model.log_scale == file.log_scale);
  CHECK(model.opacity_logit == file.opacity_logit);
  for (std::size_t i = 0; i < model.sh.size(); ++i) {
    if (i % model.shCount() > 0) CHECK(model.sh[i] == file.sh[i]);
  }
  settings.quantize_iterations = 4;
  CHECK_THROWS_WITH(tg::Trainer(dataset, settings, *renderer), Contains("too few for all parameters"));
}

TEST_CASE("what stage quantized spends on files is no part of its time", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.texture_mode = tg::TextureMode::none;
  settings.iterations = 4;
  settings.quantize_iterations = 50;
  tg::Trainer trainer(dataset, settings, *renderer);
  constexpr double kWriting = 1;  // [s]
  trainer.onQuantizing([&](const tg::GaussianModel& model, float&) {
    std::this_thread::sleep_for(std::chrono::duration<double>(kWriting));
    return model;
  });
  const auto start = std::chrono::steady_clock::now();
  while (trainer.stage() != tg::Stage::quantized) REQUIRE(trainer.step());
  const std::chrono::duration<double> all = std::chrono::steady_clock::now() - start;
  CHECK(trainer.state().seconds <= all.count() - kWriting);
  CHECK(trainer.progress().seconds_left < 49 * kWriting);
}

TEST_CASE("every strategy, filter and texture layout trains to a valid, better model", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.iterations = 240;
  SECTION("MCMC reaches its cap exactly") {
    settings.densification = tg::Densification::mcmc;
    settings.gaussians = 700;
  }
  SECTION("stage 2 with rates of its own and a decay of texels") {
    settings.rate_position_texture = settings.rate_position_end;
    settings.rate_texels_end = 1e-4f;
    settings.texel_decay = 0.1f;
  }
  SECTION("magnitudes") { settings.densify_score = tg::DensifyScore::magnitudes; }
  SECTION("3D filter") { settings.filter_3d = true; }
  SECTION("random start, fixed count") {
    settings.start = tg::Start::random;
    settings.init_count = 900;
    settings.densification = tg::Densification::none;
  }
  SECTION("texels by footprint, plane in stage 2") {
    settings.texture_sizes = tg::TextureSizes::footprint;
    settings.texel_budget = 3000;
    settings.texture_intersection = tg::TextureIntersection::plane;
  }
  SECTION("the paper's texels") { settings.texture_init = tg::TextureInit::paper; }
  SECTION("a share of the default count") {
    settings.percent = 50;
    settings.iterations = 120;
  }
  const tg::TrainResult result = tg::train(dataset, settings, *renderer);
  tg::checkModel(result.model, "model");
  REQUIRE(result.report.textured);
  CHECK(result.report.textured->loss < result.report.plain.loss);
  CHECK(result.report.plain.test->psnr > 15);
  if (settings.densification == tg::Densification::mcmc) CHECK(result.model.size() == 700);
  if (settings.densification == tg::Densification::none) CHECK(result.model.size() == 900);
  if (settings.texel_budget > 0) CHECK(result.model.atlas.texels.size() <= 3000);
  if (settings.texture_intersection == tg::TextureIntersection::plane) {
    CHECK(result.model.intersection == tg::IntersectionModel::plane);
  }
  if (settings.texture_init == tg::TextureInit::paper) {
    for (const glm::vec4& texel : result.model.atlas.texels) REQUIRE((texel.r >= 0 && texel.r <= 1));
  }
  if (settings.percent > 0) {
    REQUIRE(result.report.count);
    CHECK(result.model.size() <= (result.report.count->gaussians + 1) / 2);
    CHECK(result.model.atlas.rects[0].width == 6);
    settings.iterations = settings.texture_iterations = 1;
    settings.texture_size = 3;
    CHECK(tg::train(dataset, settings, *renderer).model.atlas.rects[0].width == 3);
  }
}

TEST_CASE("under a limit, what no view shows makes room", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = densifyingRun();
  settings.gaussians = dataset.points.position.size();
  tg::GaussianModel start = tg::gaussiansFromPoints(dataset.points);
  for (std::size_t i = 0; i < 25; ++i) start.mean[7 * i] = glm::vec3(1000.0f + static_cast<float>(i));
  const auto unseen = [](const tg::GaussianModel& model) {
    return std::ranges::count_if(model.mean, [](glm::vec3 mean) { return mean.x > 900; });
  };
  settings.limit_by = GENERATE(tg::LimitBy::room, tg::LimitBy::swap);
  tg::Trainer trainer(dataset, settings, *renderer, start);
  std::size_t least = start.size();
  while (trainer.step()) least = std::min(least, trainer.progress().gaussians);
  const tg::GaussianModel model = trainer.model();
  CHECK(model.size() <= settings.gaussians);
  CHECK(least >= settings.gaussians * 9 / 10);
  CHECK(unseen(model) == (settings.limit_by == tg::LimitBy::room ? 25 : 0));
}

TEST_CASE("more Gaussians than the limit grow, and pairs are merged down to it", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = densifyingRun();
  settings.densify_threshold = 1e-6f;
  settings.gaussians = dataset.points.position.size() / 6;
  settings.limit_by = tg::LimitBy::merge;
  tg::Trainer trainer(dataset, settings, *renderer);
  const int merged_after = tg::makeSchedule(settings).merge_after;
  CHECK(merged_after == 144);
  std::vector<std::size_t> counts;
  std::vector<tg::GaussianModel> around;
  while (trainer.step()) {
    counts.push_back(trainer.progress().gaussians);
    const int iteration = trainer.progress().iteration;
    if (iteration == merged_after - 1 || iteration == merged_after) around.push_back(trainer.model());
  }
  const auto most = std::ranges::max(counts);
  CHECK(most > 2 * settings.gaussians);
  CHECK(most <= 4 * settings.gaussians);
  CHECK(counts[static_cast<std::size_t>(merged_after) - 2] == around[0].size());
  CHECK(around[0].size() > settings.gaussians);
  CHECK(around[1].size() == settings.gaussians);
  CHECK(trainer.model().size() == settings.gaussians);
  // Merged, not only chosen: together they are as opaque and large, and shown as well as before.
  const std::vector<tg::Camera> views(dataset.views.begin(), dataset.views.end());
  const auto seen = [&](const tg::GaussianModel& model) {
    const std::vector<double> weights = tg::blendWeights(model, views);
    return std::accumulate(weights.begin(), weights.end(), 0.0);
  };
  tg::GaussianModel chosen = around[0];
  tg::decimate(chosen, settings.gaussians, tg::blendWeights(chosen, views));
  CHECK(std::abs(seen(around[1]) - seen(around[0])) < std::abs(seen(chosen) - seen(around[0])));
  // No more than the photographs have pixels for.
  CHECK(tg::grownLimit(100, 100 * 32 * 5) == 400);
  CHECK(tg::grownLimit(100, 100 * 32 * 3 + 5) == 300);
  CHECK(tg::grownLimit(100, 100) == 100);
  CHECK(tg::grownLimit(400'000, std::uint64_t{1} << 40) == 1'000'000);
  CHECK(tg::grownLimit(2'000'000, std::uint64_t{1} << 40) == 2'000'000);
  const std::size_t few = tg::grownLimit(dataset.points.position.size() / 2, tg::trainingPixels(dataset));
  CHECK(few < 2 * dataset.points.position.size());
  tg::TrainSettings limited = settings;
  limited.gaussians = dataset.points.position.size() / 2;
  tg::Trainer bounded(dataset, limited, *renderer);
  while (bounded.step()) CHECK(bounded.progress().gaussians <= few);
  // A limit that is never reached leaves the run as it is.
  settings.gaussians = 4 * most;
  settings.iterations = 60;
  const tg::GaussianModel merging = tg::train(dataset, settings, *renderer).model;
  settings.limit_by = tg::LimitBy::swap;
  tg::test::checkSame(merging, tg::train(dataset, settings, *renderer).model);
}

TEST_CASE("what the training views show is asked of pictures as steps draw them", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const std::vector<tg::Camera> views = tg::trainingViews(dataset);
  tg::GaussianModel start = tg::gaussiansFromPoints(dataset.points);
  for (std::size_t i = 0; i < start.size(); i += 2) start.log_scale[i] -= 2.0f;  // thinner than a pixel
  auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.limit_by = tg::LimitBy::room;
  settings.gaussians = start.size() * 2 / 3;
  tg::GaussianModel shown = start;
  std::vector<double> weights;
  SECTION("through the 3D filter") {
    settings.filter_3d = true;
    tg::EffectiveParameters effective;
    tg::applyFilter(start, tg::minSigmas(tg::filterCameras(dataset), start), effective);
    shown.log_scale = effective.log_scale;
    shown.opacity_logit = effective.opacity_logit;
    weights = tg::blendWeights(shown, views);
  }
  SECTION("behind a context") {
    std::vector<std::uint32_t> half(start.size() / 2);
    std::iota(half.begin(), half.end(), 0u);
    tg::GaussianModel context = tg::select(start, half);
    for (float& logit : context.opacity_logit) logit = 4;
    renderer = tg::withContext(std::move(renderer), context);
    tg::append(shown, context);
    weights = tg::blendWeights(shown, views);
    weights.resize(start.size());
  }
  const auto mostSeen = [&](const std::vector<double>& by) {
    std::vector<std::uint32_t> order(start.size());
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::stable_sort(order, [&](std::uint32_t a, std::uint32_t b) { return by[a] > by[b]; });
    order.resize(settings.gaussians);
    std::ranges::sort(order);
    return tg::select(start, order).mean;
  };
  const tg::Trainer trainer(dataset, settings, *renderer, start);
  CHECK(trainer.model().mean == mostSeen(weights));
  CHECK(mostSeen(weights) != mostSeen(tg::blendWeights(start, views)));
}

TEST_CASE("under a limit no place goes that few views show", "[trainer]") {
  constexpr int kPlaces = 64, kEach = 5;  // a camera over each, which sees no other
  tg::Dataset dataset;
  std::vector<tg::Photograph> photographs;
  for (int place = 0; place < kPlaces; ++place) {
    tg::Camera camera;
    camera.size = {16, 16};
    camera.focal = {16, 16};
    camera.center = {8, 8};
    camera.translation = {-4.0 * place, 0, 0};
    dataset.views.push_back(camera);
    tg::Photograph& photograph = photographs.emplace_back();
    photograph.pixels.width = photograph.pixels.height = 16;
    photograph.pixels.rgb.assign(3 * 16 * 16, 128);
    for (int k = 0; k < kEach; ++k) {
      dataset.points.position.emplace_back(4.0f * static_cast<float>(place) + 0.3f * static_cast<float>(k - 2),
                                           0.2f * static_cast<float>(k * k % 4 - 1),
                                           2.0f + 0.1f * static_cast<float>(k));
      dataset.points.color.emplace_back(0.5f);
    }
  }
  dataset.photographs = tg::storeInMemory(std::move(photographs));
  tg::TrainSettings settings = shortRun();
  settings.iterations = 480;
  settings.texture_iterations = 0;
  settings.densify_every = 10;
  settings.densify_from = 10;
  settings.densify_until = 460;
  settings.reset_every = 10'000;
  settings.gaussians = dataset.points.position.size();
  settings.limit_by = tg::LimitBy::swap;
  const tg::GaussianModel model = tg::train(dataset, settings, *tg::makeCpuDifferentiableRenderer()).model;
  std::vector<int> left(kPlaces, 0);
  for (const glm::vec3 mean : model.mean) {
    const auto place = static_cast<int>(std::lround(mean.x / 4));
    if (place >= 0 && place < kPlaces) ++left[static_cast<std::size_t>(place)];
  }
  CHECK(std::ranges::min(left) > 0);
}

TEST_CASE("what is wide for its distance is split at densification, within the limit", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = densifyingRun();
  tg::GaussianModel start = tg::gaussiansFromPoints(dataset.points);
  for (std::size_t i = 0; i < 6; ++i) start.log_scale[50 * i] = glm::vec3(0.5f, -1.0f, -3.0f);
  const auto widest = [&](const tg::GaussianModel& model) {
    double most = 0;
    for (std::size_t i = 0; i < model.size(); ++i) {
      double nearest = 1e9;
      for (const std::size_t view : dataset.indices(false)) {
        nearest = std::min(nearest, glm::distance(dataset.views[view].position(), glm::dvec3(model.mean[i])));
      }
      const glm::dvec3 sigma = glm::exp(glm::dvec3(model.log_scale[i]));
      most = std::max(most, std::max({sigma.x, sigma.y, sigma.z}) / nearest);
    }
    return most;
  };
  REQUIRE(widest(start) > 0.4);
  settings.wide_sigma = 0.1f;
  settings.gaussians = GENERATE(0, 640);
  const tg::TrainResult split = tg::train(dataset, settings, *renderer, {}, start);
  CHECK(widest(split.model) < 0.2);  // what they grow in the iterations without densification stays
  if (settings.gaussians > 0) CHECK(split.model.size() <= settings.gaussians);
  const tg::TrainResult again = tg::train(dataset, settings, *renderer, {}, start);
  CHECK(again.model == split.model);
}

TEST_CASE("all random points are the start under a limit: the first round picks, and without a round the end does",
          "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.densification = GENERATE(tg::Densification::adc, tg::Densification::mcmc);
  settings.limit_by = GENERATE(tg::LimitBy::swap, tg::LimitBy::merge);
  settings.start = tg::Start::random;
  settings.init_count = 2000;
  settings.gaussians = 300;
  settings.iterations = GENERATE(30, 240);
  const tg::TrainResult result = tg::train(dataset, settings, *renderer);
  CHECK(result.report.initial_gaussians == 2000);
  CHECK(result.model.size() <= 300);
  CHECK(result.model.size() >= 285);
}

TEST_CASE("stage 2 has rates of its own, and MCMC's noise does not follow this trainer's", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.densification = tg::Densification::none;
  settings.rate_position = settings.rate_position_end = 0;
  tg::GaussianModel start = tg::gaussiansFromPoints(dataset.points);
  SECTION("of positions") {
    CHECK(tg::train(dataset, settings, *renderer).model.mean == start.mean);
    settings.rate_position_end = 1e-3f;  // which a rate of 0 does not rise to
    CHECK(tg::train(dataset, settings, *renderer).model.mean == start.mean);
    settings.rate_position_texture = 1e-4f;
    CHECK(tg::train(dataset, settings, *renderer).model.mean != start.mean);
  }
  SECTION("of texels") {
    settings.rate_texels = settings.rate_texels_end = 0;
    const auto changed = [](const tg::GaussianModel& model) {
      return std::ranges::any_of(model.atlas.texels, [](glm::vec4 texel) { return texel != glm::vec4(0, 0, 0, 1); });
    };
    CHECK_FALSE(changed(tg::train(dataset, settings, *renderer).model));
    settings.rate_texels_end = 1e-3f;
    CHECK_FALSE(changed(tg::train(dataset, settings, *renderer).model));
    settings.rate_texels = 1e-3f;
    CHECK(changed(tg::train(dataset, settings, *renderer).model));
  }
  SECTION("of noise") {
    settings.densification = tg::Densification::mcmc;
    settings.gaussians = start.size();
    settings.iterations = 1;
    settings.densify_from = 10;
    settings.texture_mode = tg::TextureMode::none;
    for (float& logit : start.opacity_logit) logit = -5;  // noise is for the transparent
    CHECK(tg::train(dataset, settings, *renderer, {}, start).model.mean != start.mean);
    settings.mcmc_noise = 0;
    CHECK(tg::train(dataset, settings, *renderer, {}, start).model.mean == start.mean);
  }
}

TEST_CASE("densification obeys the cap, and the start does too", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.iterations = 240;
  settings.texture_iterations = 0;
  settings.gaussians = 500;
  settings.limit_by = GENERATE(tg::LimitBy::swap, tg::LimitBy::merge);
  const bool merges = settings.limit_by == tg::LimitBy::merge;
  const tg::TrainResult result = tg::train(dataset, settings, *renderer);
  CHECK(result.report.initial_gaussians == (merges ? tg::grownLimit(500, tg::trainingPixels(dataset)) : 500));
  CHECK(result.model.size() <= 500);
  CHECK(result.model.texture_mode == tg::TextureMode::none);
  settings.gaussians = 700;
  const std::size_t grown = tg::train(dataset, settings, *renderer).model.size();
  CHECK(grown > 600);
  CHECK(grown <= 700);
}

TEST_CASE("a stop request ends after the current step with a valid model", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  for (const int stop_at : {5, 70}) {
    std::atomic<bool> stop{false};
    int steps = 0;
    tg::TrainHooks hooks;
    hooks.stop = &stop;
    hooks.after_step = [&](const tg::Trainer&) { stop = ++steps == stop_at; };
    const tg::TrainResult result = tg::train(dataset, shortRun(), *renderer, hooks);
    CHECK(steps == stop_at);
    CHECK(result.report.interrupted);
    tg::checkModel(result.model, "model");
    CHECK(result.model.sh_degree == 3);
    CHECK((result.model.texture_mode == tg::TextureMode::rgba) == (stop_at == 70));
  }
}

namespace {

// Has no room for textures.
class PlainRenderer final : public tg::DifferentiableRenderer {
 public:
  using DifferentiableRenderer::forward;
  void setModel(const tg::GaussianModel& model) override {
    if (tg::isTextured(model)) throw std::bad_alloc();
    renderer_->setModel(model);
  }
  const std::vector<glm::vec3>& forward(const tg::Camera& camera, const tg::RenderSettings& settings) override {
    return renderer_->forward(camera, settings);
  }
  void backward(std::span<const glm::vec3> v_color, tg::ModelGradient& gradient,
                const tg::GradientOptions& options) override {
    renderer_->backward(v_color, gradient, options);
  }
  std::span<const tg::PhaseTime> phaseTimes() const override { return renderer_->phaseTimes(); }
  std::string deviceName() const override { return renderer_->deviceName(); }

 private:
  const std::unique_ptr<tg::DifferentiableRenderer> renderer_ = tg::makeCpuDifferentiableRenderer();
};

}  // namespace

TEST_CASE("where the first step with textures fails the plain model is left as it was trained", "[trainer]") {
  const tg::Dataset dataset = sampleDataset();
  PlainRenderer renderer;
  tg::TrainSettings settings = shortRun();
  SECTION("with another intersection") { settings.texture_intersection = tg::TextureIntersection::plane; }
  SECTION("with the paper's first texels") { settings.texture_init = tg::TextureInit::paper; }
  SECTION("through the 3D filter") { settings.filter_3d = true; }
  SECTION("beside a twin and with clipped textures") {
    settings.compare_untextured = true;
    settings.texture_outside = tg::TextureOutside::clip;
  }
  tg::Trainer trainer(dataset, settings, renderer);
  CHECK_FALSE(trainer.takePlain());
  while (trainer.progress().iteration < settings.iterations) trainer.step();
  CHECK_THROWS_AS(trainer.step(), std::bad_alloc);
  const std::optional<tg::TrainResult> left = trainer.takePlain();
  REQUIRE(left);
  settings.texture_iterations = 0;
  settings.compare_untextured = false;
  const tg::TrainResult plain = tg::train(dataset, settings, renderer);
  CHECK(left->model == plain.model);
  CHECK(left->report.interrupted);
  CHECK_FALSE(left->report.textured);
  CHECK(left->report.plain.iterations == settings.iterations);
  CHECK(left->report.plain.loss == plain.report.plain.loss);
  CHECK_FALSE(trainer.takePlain());
}

TEST_CASE("every setting changes what is trained", "[trainer]") {
  const tg::Dataset dataset = tg::test::tinyDataset();
  tg::test::SettingEffects cpu(dataset, [] { return tg::makeCpuDifferentiableRenderer(); });
  for (const tg::SettingEntry& entry : tg::settingEntries()) {
    INFO("--" << entry.name << ": a value in every_setting.h trains what the default or another one trains");
    CHECK(cpu.changesModel(tg::test::runsOf(entry)));
  }
}

TEST_CASE("settings out of range and hopeless data are refused", "[trainer]") {
  tg::Dataset dataset = sampleDataset();
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainSettings settings = shortRun();
  settings.texture_size = -1;
  CHECK_THROWS_WITH(tg::train(dataset, settings, *renderer),
                    Contains("--texture-size: expected an integer from 0 to 256, found '-1'"));
  settings = shortRun();
  settings.iterations = -1;
  CHECK_THROWS_WITH(tg::train(dataset, settings, *renderer),
                    Contains("--iterations: expected an integer from 0 to 10000000, found '-1'"));
}
