// SPDX-License-Identifier: Apache-2.0
// The loop: next view, forward, loss, backward, step, densify.
#include "training/trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <string>

#include "core/error.h"
#include "training/densify.h"
#include "training/init.h"
#include "training/loss.h"
#include "training/optimizer.h"
#include "training/random.h"
#include "training/schedule.h"
#include "training/textures.h"

namespace tg {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kRandomPoints = 100'000;  // the Blender recipe of 3DGS
constexpr int kMaxTextureSize = 256;
constexpr double kRunningMean = 0.98;  // weight of the past in the numbers shown: about 50 views

// Independent streams of one seed.
enum class Stream : std::uint64_t { points = 1, densify, plain, textured };
Random stream(std::uint64_t seed, Stream which) {
  return Random(Random(seed + 0x632be59bd9b4e019u * static_cast<std::uint64_t>(which)).bits());
}

double secondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// Every view once in random order, then again in another.
class ViewOrder {
 public:
  ViewOrder(std::vector<std::size_t> views, Random random) : views_(std::move(views)), random_(random) {}
  std::size_t next() {
    if (position_ == 0) random_.shuffle(views_);
    const std::size_t view = views_[position_];
    position_ = (position_ + 1) % views_.size();
    return view;
  }

 private:
  std::vector<std::size_t> views_;
  Random random_;
  std::size_t position_ = 0;
};

// Mean of a series that forgets; unbiased from the first value on.
class RunningMean {
 public:
  void add(double value) {
    sum_ = kRunningMean * sum_ + value;
    weight_ = kRunningMean * weight_ + 1;
  }
  double value() const { return weight_ > 0 ? sum_ / weight_ : 0; }

 private:
  double sum_ = 0;
  double weight_ = 0;
};

void checkSettings(const TrainSettings& settings) {
  const auto check = [](const char* what, long value, long low, long high) {
    if (value < low || value > high) {
      throw Error(ErrorKind::usage, std::string(what) + " out of range (expected " + std::to_string(low) + " to " +
                                        std::to_string(high) + ", found " + std::to_string(value) + ")");
    }
  };
  check("iterations", settings.iterations, 0, 10'000'000);
  check("texture iterations", settings.texture_iterations, 0, 10'000'000);
  check("texture size", settings.texture_size, 1, kMaxTextureSize);
  check("SH degree", settings.sh_degree, 0, 3);
}

class Run {
 public:
  Run(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer, const TrainHooks& hooks)
      : dataset_(dataset),
        settings_(settings),
        renderer_(renderer),
        hooks_(hooks),
        extent_(cameraExtent(dataset)),
        densify_random_(stream(settings.seed, Stream::densify)) {}

  TrainResult operator()() {
    TrainResult result;
    TrainReport& report = result.report;
    report.extent = extent_;
    TrainingState state;
    state.model = firstGaussians();
    state.model.intersection = settings_.intersection;
    resetMoments(state);
    report.initial_gaussians = state.model.size();

    const bool textured = settings_.texture_mode != TextureMode::none && settings_.texture_iterations > 0;
    const bool twin = textured && settings_.compare_untextured;
    later_iterations_ = (textured + twin) * settings_.texture_iterations;
    report.plain = optimize(state, Stage::plain, settings_.iterations);
    if (textured && !stopped()) {
      growShDegree(state, settings_.sh_degree);
      TrainingState untextured = twin ? state : TrainingState{};
      addTextures(state, settings_.texture_size, settings_.texture_mode);
      later_iterations_ = twin * settings_.texture_iterations;
      report.textured = optimize(state, Stage::textured, settings_.texture_iterations);
      if (twin && !stopped()) {
        resetMoments(untextured);
        later_iterations_ = 0;
        report.untextured = optimize(untextured, Stage::untextured, settings_.texture_iterations);
        result.untextured = std::move(untextured.model);
      }
    }
    growShDegree(state, settings_.sh_degree);
    result.model = std::move(state.model);
    report.interrupted = stopped();
    return result;
  }

 private:
  bool stopped() const { return hooks_.stop && hooks_.stop->load(std::memory_order_relaxed); }

  GaussianModel firstGaussians() const {
    std::size_t limit = settings_.init_count;
    if (settings_.max_gaussians > 0) limit = limit ? std::min(limit, settings_.max_gaussians) : settings_.max_gaussians;
    Random random = stream(settings_.seed, Stream::points);
    if (!dataset_.points.position.empty()) {
      return gaussiansFromPoints(limit ? randomSubset(dataset_.points, limit, random.bits()) : dataset_.points);
    }
    const std::size_t count = settings_.init_count ? limit : std::min(limit ? limit : kRandomPoints, kRandomPoints);
    return gaussiansFromPoints(randomPoints(dataset_, count, random.bits()));
  }

  StageReport optimize(TrainingState& state, Stage stage, int iterations) {
    // Both versions of stage 2 see the same views in the same order.
    ViewOrder order(dataset_.indices(false),
                    stream(settings_.seed, stage == Stage::plain ? Stream::plain : Stream::textured));
    const Schedule schedule = makeSchedule(iterations);
    DensityStatistics statistics;
    statistics.reset(state.model.size());
    LearningRates rates;
    RenderSettings render;
    render.background = dataset_.background;
    RunningMean loss_mean;
    RunningMean error_mean;
    StageReport report;
    const Clock::time_point start = Clock::now();

    for (int iteration = 1; iteration <= iterations && !stopped(); iteration++) {
      const std::size_t index = order.next();
      const View& view = dataset_.views[index];
      const std::shared_ptr<const ViewPixels> photograph = dataset_.pixels(index);
      const std::vector<glm::vec3>& picture = renderer_.forward(state.model, view.camera, render);
      v_picture_.resize(picture.size());
      const LossValue loss = loss_.evaluate(view.camera.width, view.camera.height, picture, photograph->rgb, v_picture_);
      if (!std::isfinite(loss.total)) {
        throw Error(ErrorKind::badData, "training diverged: the loss is not finite at iteration " +
                                            std::to_string(iteration) + " of stage '" + std::string(name(stage)) + "'");
      }
      renderer_.backward(v_picture_, gradient_);
      rates.mean = positionLearningRate(iteration, iterations, extent_);
      adamStep(state, gradient_, rates);
      if (stage == Stage::plain) adapt(state, statistics, schedule, iteration);

      loss_mean.add(loss.total);
      error_mean.add(loss.mean_squared_error);
      report.iterations = iteration;
      if (hooks_.progress) {
        const double rate = iteration / std::max(secondsSince(start), 1e-9);
        hooks_.progress({stage, iteration, iterations, loss_mean.value(), decibels(error_mean.value()),
                         state.model.size(), rate, (iterations - iteration + later_iterations_) / rate});
      }
    }

    report.seconds = secondsSince(start);
    report.loss = loss_mean.value();
    report.train_psnr = report.iterations > 0 ? decibels(error_mean.value()) : 0;
    report.gaussians = state.model.size();
    report.test = testScore(state.model);
    return report;
  }

  void adapt(TrainingState& state, DensityStatistics& statistics, const Schedule& schedule, int iteration) {
    if (iteration < schedule.densify_until) statistics.add(gradient_);
    if (schedule.densifies(iteration)) {
      DensifySettings densify_settings;
      densify_settings.extent = extent_;
      densify_settings.prune_large = schedule.prunesLarge(iteration);
      densify_settings.max_gaussians = settings_.max_gaussians;
      densify(state, statistics, densify_settings, densify_random_);
      if (state.model.size() == 0) {
        throw Error(ErrorKind::badData, "no Gaussian is left after densification at iteration " +
                                            std::to_string(iteration) + ": do the cameras see the initial points?");
      }
    }
    // On white, half-transparent haze in the background colour is free: 3DGS clears it once more, early.
    const bool white = dataset_.background == glm::vec3(1.0f);
    if (schedule.resetsOpacity(iteration) ||
        (schedule.reset_every > 0 && white && iteration == schedule.densify_from)) {
      resetOpacity(state);
    }
    if (schedule.raisesShDegree(iteration)) {
      growShDegree(state, std::min(state.model.sh_degree + 1, settings_.sh_degree));
    }
  }

  // None without test views, or when a stop is asked for meanwhile.
  std::optional<Score> testScore(const GaussianModel& model) {
    std::vector<ViewScore> scores;
    for (const std::size_t view : dataset_.indices(true)) {
      if (stopped()) return std::nullopt;
      scores.push_back(scoreViews(dataset_, {&view, 1}, [&](const Camera& camera) {
                         return renderPicture(renderer_, model, camera, dataset_.background);
                       }).front());
    }
    return scores.empty() ? std::nullopt : std::optional(meanScore(scores));
  }

  static double decibels(double mean_squared_error) { return -10 * std::log10(std::max(mean_squared_error, 1e-12)); }

  const Dataset& dataset_;
  const TrainSettings& settings_;
  DifferentiableRenderer& renderer_;
  const TrainHooks& hooks_;
  const double extent_;
  Random densify_random_;
  int later_iterations_ = 0;  // of the stages that follow
  PhotometricLoss loss_;
  ModelGradient gradient_;
  std::vector<glm::vec3> v_picture_;
};

}  // namespace

std::string_view name(Stage stage) {
  switch (stage) {
    case Stage::plain:
      return "plain";
    case Stage::textured:
      return "textured";
    case Stage::untextured:
      return "untextured";
  }
  return "";
}

TrainResult train(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer,
                  const TrainHooks& hooks) {
  checkSettings(settings);
  return Run(dataset, settings, renderer, hooks)();
}

Image renderPicture(DifferentiableRenderer& renderer, const GaussianModel& model, const Camera& camera,
                    const glm::vec3& background) {
  RenderSettings settings;
  settings.background = background;
  const std::vector<glm::vec3>& picture = renderer.forward(model, camera, settings);
  Image image(camera.width, camera.height, 3);
  for (std::size_t i = 0; i < picture.size(); i++) {
    for (int c = 0; c < 3; c++) image.data[i * 3 + static_cast<std::size_t>(c)] = picture[i][c];
  }
  return image;
}

}  // namespace tg
