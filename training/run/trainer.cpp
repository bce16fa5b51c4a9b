// SPDX-License-Identifier: Apache-2.0
// The recipe as a loop over stages: next view, forward, loss, backward, step, densify.
#include "training/run/trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>

#include "core/model/fallback.h"
#include "core/model/texture_dictionary.h"
#include "core/model/verbs.h"
#include "core/model/views.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "training/run/init.h"
#include "training/score/evaluate.h"
#include "training/step/filter_3d.h"
#include "training/step/textures.h"

namespace tg {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kRandomPoints = 100'000;  // the Blender recipe of 3DGS
constexpr int kFilterEvery = 100;               // steps between two updates of the 3D filter
constexpr std::size_t kSeenViews = 16;          // that say what a Gaussian is worth, at least
constexpr double kSwapped = 0.05;               // of the limit, a round
constexpr int kSettlingSteps = 500;             // after an opacity reset
// The position rate of 3DGS, which MCMC's noise is a multiple of, whatever the rate here.
constexpr float kNoiseRate = 1.6e-4f, kNoiseRateEnd = 1.6e-6f;

// Independent streams of one seed.
enum class Stream : std::uint64_t { points = 1, densify, plain, textured, noise, count, background, dictionary };
Random stream(std::uint64_t seed, Stream which) {
  return Random(Random(seed + 0x632be59bd9b4e019u * static_cast<std::uint64_t>(which)).bits());
}

// In which order stage quantized takes parameters from the optimizer, each for an equal part of its iterations: first
// those whose rounding the others make up for best. Opacities are stored times what texels let through, so both
// together; DC is last, and rounded by the file alone.
enum class Quantized { mean, rotation, logScale, texelsAndOpacity, shRest };
constexpr int kQuantizedPhases = kLeastQuantizeIterations;

constexpr int kSharedFrom = 4;  // a quarter of stage 2 (docs/lab/quality.md, "Textures that Gaussians share")

// After `done` of `iterations`.
Quantized phaseOf(int done, int iterations) {
  return static_cast<Quantized>(std::int64_t{done} * kQuantizedPhases / iterations);
}

// Whether a file has no texture for a Gaussian that has one, but what stands in for it.
bool isDropped(const GaussianModel& stored, const GaussianModel& model, std::size_t i) {
  if (model.atlas.rects.empty() || model.atlas.rects[i].texelCount() == 0) return false;
  return stored.atlas.rects.empty() || stored.atlas.rects[i].texelCount() == 0;
}

// Between atlases of the same textures in another order, from which some are dropped.
void copyTexels(const TextureAtlas& from, TextureAtlas& to) {
  TG_ASSERT(from.rects.empty() || from.rects.size() == to.rects.size(), "atlases of as many textures");
  for (std::size_t i = 0; i < to.rects.size(); ++i) {
    if (from.rects.empty() || from.rects[i].texelCount() == 0) {
      std::fill_n(to.texels.begin() + to.rects[i].offset, to.rects[i].texelCount(), glm::vec4(0, 0, 0, 1));
      continue;
    }
    TG_ASSERT(from.rects[i].texelCount() == to.rects[i].texelCount(), "textures of the same size");
    std::copy_n(from.texels.begin() + from.rects[i].offset, to.rects[i].texelCount(),
                to.texels.begin() + to.rects[i].offset);
  }
}

bool countsFirst(const TrainSettings& settings) { return settings.percent > 0 && settings.default_gaussians == 0; }

void requireSharing(bool shared, bool shares) {
  if (!shared || shares) return;
  throw Error(ErrorKind::usage,
              "textures that Gaussians share are trained by one process (expected tgtrain without mpirun)");
}

std::vector<glm::vec3> constantColors(const GaussianModel& model) {
  std::vector<glm::vec3> colors(model.size());
  for (std::size_t i = 0; i < colors.size(); ++i) colors[i] = model.sh[i * model.shCount()];
  return colors;
}

double decibels(double mean_squared_error) { return -10 * std::log10(std::max(mean_squared_error, 1e-12)); }

}  // namespace

int iterationsOf(const TrainSettings& settings, Stage stage) {
  if (stage == Stage::quantized) return settings.quantize_iterations;
  return stage == Stage::textured || stage == Stage::untextured ? settings.texture_iterations : settings.iterations;
}

void checkTrainable(const TrainSettings& settings, const GaussianModel* start, bool shares) {
  checkSettings(settings);
  requireSharing(settings.texture_dictionary > 0, shares);
  if (start == nullptr) return;
  if (start->size() == 0) throw Error(ErrorKind::badData, "start model", "has no Gaussians");
  if (start->texture_mode == TextureMode::none) {
    if (!countsFirst(settings)) return;
    throw Error(ErrorKind::usage,
                "a start model leaves nothing to count (expected --default-gaussians with --percent)");
  }
  if (start->outside == TextureOutside::edge) {
    throw Error(ErrorKind::usage,
                "the start model has \"outside\": \"edge\", which has no gradient (expected \"base\" or \"clip\")");
  }
  if (settings.texture_mode == TextureMode::none || settings.compare_untextured ||
      settings.texture_init == TextureInit::paper) {
    throw Error(ErrorKind::usage,
                "the start model has textures already: stage 2 goes on with them, and has no twin (expected a texture "
                "mode, --texture-init neutral and no --compare-untextured)");
  }
  if (settings.texture_dictionary > 0) requireShareable(start->atlas);
}

Trainer::Trainer(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer,
                 std::optional<GaussianModel> start)
    : Trainer(dataset, settings, renderer, RunState{}) {
  state_.default_gaussians = settings.default_gaussians;
  state_.densify_random = stream(settings.seed, Stream::densify);
  state_.report.extent = extent_;
  checkTrainable(settings, start ? &*start : nullptr, engine_->sharesTextures());
  if (!start) {
    begin(countsFirst(settings) ? Stage::count : Stage::plain, {});
    return;
  }
  setShDegree(*start, std::min(start->sh_degree, settings.sh_degree));
  if (start->texture_mode == TextureMode::none) {
    start->intersection = settings.intersection;
    start->outside = TextureOutside::base;  // until there are textures
    begin(Stage::plain, std::move(*start));
    if (limit() > 0 && !swaps()) keepMostSeen(limit());
    return;
  }
  state_.report.initial_gaussians = start->size();
  begin(Stage::textured, std::move(*start));
}

Trainer::Trainer(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer,
                 RunState state)
    : dataset_(dataset),
      settings_((checkSettings(settings), settings)),
      schedule_(makeSchedule(settings)),
      traits_(traitsOf(settings.densification)),
      extent_(sceneExtent(dataset, settings.extent_distances)),
      seen_views_(viewsForAll(dataset.points.position, trainingViews(dataset), kSeenViews)),
      filter_cameras_(filterCameras(dataset)),
      renderer_(renderer),
      engine_(renderer.makeTrainingEngine(settings.ssim_weight)),
      state_(std::move(state)),
      known_losses_(state_.iteration),
      test_views_(dataset.indices(true).size()),
      time_left_(settings_, schedule_,
                 static_cast<double>(trainingPixels(dataset)) /
                     static_cast<double>(std::max<std::size_t>(dataset.indices(false).size(), 1))) {
  requireSharing(settings.texture_dictionary > 0, engine_->sharesTextures());
  beginTimes();
  time_left_.resume(state_.iteration, state_.seconds, state_.training.model.size());
}

void Trainer::takeLosses(bool wait) const {
  for (const LossValue& loss : engine_->losses(state_, wait)) {
    ++known_losses_;
    if (!std::isfinite(loss.total)) {
      throw Error(ErrorKind::badData, "training diverged: the loss is not finite at iteration " +
                                          std::to_string(known_losses_) + " of stage '" +
                                          std::string(name(state_.stage)) + "'");
    }
    state_.loss.add(loss.total);
    state_.squared_error.add(loss.mean_squared_error);
  }
}

void Trainer::pull() const {
  takeLosses(true);
  engine_->pull(state_);
}

const RunState& Trainer::state() const {
  pull();
  return state_;
}

std::size_t Trainer::limit() const {
  if (state_.stage == Stage::count) return 0;
  if (settings_.percent > 0) {
    const double share = settings_.percent / 100 * static_cast<double>(state_.default_gaussians);
    return std::max<std::size_t>(1, static_cast<std::size_t>(std::llround(share)));
  }
  return settings_.gaussians;
}

std::size_t Trainer::limitNow() const {
  const bool grows = merges() && state_.stage == Stage::plain && state_.iteration < schedule_.merge_after;
  return grows ? grownLimit(limit(), trainingPixels(dataset_)) : limit();
}

bool Trainer::swaps() const {
  if (limit() == 0 || !traits_.heeds_limit_by) return false;
  switch (settings_.limit_by) {
    case LimitBy::room:
      return false;
    case LimitBy::swap:
    case LimitBy::merge:
      return true;
  }
  return false;
}

bool Trainer::merges() const { return limit() > 0 && schedule_.merge_after > 0; }

// Most random points are nowhere near a surface: under a limit the first round finds out which are.
bool Trainer::picks() const {
  return limit() > 0 && (swaps() || traits_.needs_limit) &&
         (settings_.start == Start::random || dataset_.points.position.empty());
}

int Trainer::automaticTextureSize(std::size_t gaussians) const {
  const int size = settings_.percent > 0 ? textureSizeForPercent(settings_.percent) : 4;
  if (settings_.pixels_per_texel == 0 || gaussians == 0) return size;
  return std::min(size, textureSizeForPixels(trainingPixels(dataset_), gaussians, settings_.pixels_per_texel));
}

GaussianModel Trainer::firstGaussians() const {
  std::size_t count = settings_.init_count;
  if (limit() > 0 && !picks()) count = count ? std::min(count, limitNow()) : limitNow();
  Random random = stream(settings_.seed, Stream::points);
  GaussianModel model;
  if (settings_.start == Start::points && !dataset_.points.position.empty()) {
    model = gaussiansFromPoints(count ? randomSubset(dataset_.points, count, random.bits()) : dataset_.points);
  } else {
    if (!settings_.init_count) count = std::min(count ? count : kRandomPoints, kRandomPoints);
    model = gaussiansFromPoints(randomPoints(dataset_, count, random.bits()));
  }
  model.intersection = settings_.intersection;
  if (traits_.explores) {
    // Kheradmand et al., implementation: half opaque and small, so that noise can explore.
    std::fill(model.opacity_logit.begin(), model.opacity_logit.end(), 0.0f);
    for (glm::vec3& log_scale : model.log_scale) log_scale += std::log(0.1f);
  }
  return model;
}

void Trainer::begin(Stage stage, GaussianModel first) {
  pull();
  engine_->stateChanged();
  state_.stage = stage;
  state_.texture_groups.reset();
  state_.iteration = known_losses_ = 0;
  state_.seconds = 0;
  state_.loss = {};
  state_.squared_error = {};
  if (stage == Stage::count || stage == Stage::plain) {
    state_.training = {};
    state_.training.model = first.mean.empty() ? firstGaussians() : std::move(first);
    resetMoments(state_.training);
    if (stage == Stage::plain) state_.report.initial_gaussians = state_.training.model.size();
  } else if (stage == Stage::textured) {
    const bool textures_given = !first.mean.empty();
    if (textures_given) {
      state_.training.model = std::move(first);
      resetMoments(state_.training);
    } else {
      Plain plain;
      plain.intersection = state_.training.model.intersection;
      plain.min_sigma = state_.min_sigma;
      if (settings_.texture_init == TextureInit::paper) plain.constant_color = constantColors(state_.training.model);
      plain_ = std::move(plain);
    }
    growShDegree(state_.training, settings_.sh_degree);
    if (settings_.compare_untextured) state_.untextured_start = state_.training.model;
    GaussianModel& model = state_.training.model;
    if (settings_.texture_intersection != TextureIntersection::same) {
      model.intersection = settings_.texture_intersection == TextureIntersection::plane
                               ? IntersectionModel::plane
                               : IntersectionModel::maxResponse;
    }
    if (!textures_given) {
      model.outside = settings_.texture_outside;
      const int size = settings_.texture_size > 0 ? settings_.texture_size : automaticTextureSize(model.size());
      const std::size_t budget = settings_.texel_budget
                                     ? settings_.texel_budget
                                     : model.size() * static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
      addTextures(state_.training,
                  settings_.texture_sizes == TextureSizes::footprint
                      ? footprintRects(model, pixelSizes(filter_cameras_, model), budget)
                      : uniformRects(model.size(), size, settings_.texel_budget),
                  settings_.texture_mode, settings_.texture_init);
    }
  } else if (stage == Stage::quantized) {
    growShDegree(state_.training, settings_.sh_degree);
    state_.training.model = model();  // what a file would hold: the filter is baked
    state_.min_sigma.clear();
  } else {
    state_.textured = model();
    state_.training = {};
    state_.training.model = std::exchange(state_.untextured_start, {});
    resetMoments(state_.training);
  }
  state_.statistics.reset(state_.training.model.size());
  updateFilter();
  // Both versions of stage 2 see the same views in the same order.
  const std::vector<std::size_t> train = dataset_.indices(false);
  state_.order = {};
  state_.order.views.assign(train.begin(), train.end());
  const bool second = stage > Stage::plain;
  state_.order.random = stream(settings_.seed, stage == Stage::count ? Stream::count
                                               : second              ? Stream::textured
                                                                     : Stream::plain);
  beginTimes();
}

bool Trainer::shareTextures(const std::atomic<bool>* stop) {
  const bool now = state_.stage == Stage::textured && settings_.texture_dictionary > 0 &&
                   state_.iteration == settings_.texture_iterations / kSharedFrom;
  if (!now) return true;
  pull();
  engine_->stateChanged();
  GaussianModel& model = state_.training.model;
  const auto entries = static_cast<std::size_t>(settings_.texture_dictionary);
  const std::uint64_t seed = stream(settings_.seed, Stream::dictionary).bits();
  if (!tg::shareTextures(model, entries, seenWeights(), kBitCost, seed, stop)) return false;
  resetMoments(state_.training);
  state_.texture_groups.reset();
  return true;
}

// What is the same stays the same from here on. Of a model that was trained without a dictionary textures may be the
// same by chance, as clamped ones are: only one that is fitted as it came keeps what it shares.
void Trainer::findTextureGroups() {
  if (state_.texture_groups) return;
  state_.texture_groups.emplace();
  const bool dictionary =
      settings_.texture_dictionary > 0 &&
      (state_.stage == Stage::quantized ||
       (state_.stage == Stage::textured && state_.iteration >= settings_.texture_iterations / kSharedFrom));
  if (!dictionary && (state_.stage != Stage::quantized || settings_.texture_iterations > 0)) return;
  pull();
  if (!isTextured(state_.training.model)) return;
  std::vector<std::uint32_t> groups = textureGroups(state_.training.model.atlas);
  if (!dictionary && !areShared(state_.training.model.atlas, groups)) return;
  requireSharing(true, engine_->sharesTextures());
  state_.texture_groups = std::move(groups);
}

bool Trainer::resetsOpacity(int iteration) const {
  if (schedule_.resetsOpacity(iteration)) return true;
  // On white, half-transparent haze in the background colour is free: 3DGS clears it once more, early.
  const bool white = dataset_.background == glm::vec3(1.0f);
  return white && schedule_.reset_every > 0 && iteration == schedule_.densify_from &&
         iteration < schedule_.densify_until;
}

// More views are looked at in fewer rounds: together they cost as much, and newcomers are seen as often before they
// are judged as in a scene that every view shows. In one round at least.
bool Trainer::swapsAfter(int iteration) const {
  if (!swaps()) return false;
  const int every = schedule_.densify_every;
  const auto swapsIn = [&](int at, int rounds) { return at / every % rounds == 0 && opacitiesSettled(at); };
  const auto hasOne = [&](int rounds) {
    for (int at = every; at < schedule_.densify_until; at += every) {
      if (schedule_.densifies(at) && swapsIn(at, rounds)) return true;
    }
    return false;
  };
  auto rounds = static_cast<int>((seen_views_ + kSeenViews / 2) / kSeenViews);
  rounds = std::clamp(rounds, 1, std::max(schedule_.densify_until / every, 1));
  while (rounds > 1 && !hasOne(rounds)) --rounds;
  return swapsIn(iteration, rounds);
}

// Where opacities were just reset they do not say yet what a Gaussian is worth.
bool Trainer::opacitiesSettled(int iteration) const {
  for (int past = std::max(1, iteration - kSettlingSteps); past < iteration; ++past) {
    if (resetsOpacity(past)) return false;
  }
  return true;
}

void Trainer::updateFilter() {
  if (!settings_.filter_3d || state_.stage == Stage::quantized) return;
  state_.min_sigma.clear();  // of as many Gaussians as there were
  engine_->updateFilter(state_, filter_cameras_);
}

bool Trainer::step(const std::atomic<bool>* stop) {
  while (!state_.finished && state_.iteration >= iterationsOf(state_.stage)) {
    if (!end(stop)) return false;
  }
  if (state_.finished) return false;
  if (state_.stage == Stage::quantized) quantizeNext();  // writes files, which is no part of a step's time
  const auto secondsSince = [](Clock::time_point then) {
    return std::chrono::duration<double>(Clock::now() - then).count();
  };
  const Clock::time_point start = Clock::now();
  if (!shareTextures(stop)) return false;
  const Clock::time_point shared = Clock::now();
  iterate();
  state_.seconds += secondsSince(start);
  time_left_.add(secondsSince(shared), engine_->gaussians(state_));
  return true;
}

void Trainer::beginTimes() { time_left_.beginStage(plan()); }

double Trainer::texelsEach() const {
  const auto gaussians = static_cast<double>(std::max<std::size_t>(engine_->gaussians(state_), 1));
  if (const std::size_t texels = engine_->texels(state_); texels > 0) return static_cast<double>(texels) / gaussians;
  if (settings_.texel_budget > 0) return static_cast<double>(settings_.texel_budget) / gaussians;
  const int side =
      settings_.texture_size > 0 ? settings_.texture_size : automaticTextureSize(engine_->gaussians(state_));
  return static_cast<double>(side) * side;
}

RunPlan Trainer::plan() const {
  const int iterations = iterationsOf(state_.stage), second = settings_.texture_iterations;
  const bool textures = settings_.texture_mode != TextureMode::none;
  const bool before = state_.stage < Stage::textured;
  RunPlan plan;
  plan.densifies = before && settings_.densification != Densification::none;
  plan.grows_sh = before;
  plan.iteration = state_.iteration;
  plan.left = iterations - state_.iteration;
  plan.gaussians = engine_->gaussians(state_);
  plan.limit = limitNow();
  if (plan.densifies && merges()) {
    plan.merge_after = schedule_.merge_after;
    plan.merged = limit();
  }
  plan.swaps = plan.densifies && swaps();
  if (traits_.grows_by_share) plan.growth = mcmcGrowth();
  plan.textured = engine_->texels(state_) > 0;
  plan.texels = texelsEach();
  if (state_.stage == Stage::count) {
    plan.first_left = settings_.iterations;
    plan.first_share = settings_.percent / 100;
    if (schedule_.merge_after > 0) plan.first_pixels = trainingPixels(dataset_);
  }
  if (textures && before) plan.textured_left = second;
  if (textures && settings_.adaptive_texels > 0 &&
      (before || (state_.stage == Stage::textured && state_.iteration <= second / 2))) {
    plan.texels_cut = settings_.adaptive_texels;
    plan.cut_left = second - second / 2;
  }
  const bool twin = textures && settings_.compare_untextured && state_.stage < Stage::untextured;
  if (twin) plan.untextured_left = second;
  if (state_.stage != Stage::quantized) plan.quantized_left = settings_.quantize_iterations;
  plan.test_views = test_views_;
  plan.scorings = 1 + (textures && before && second > 0) + twin + (plan.quantized_left > 0);
  return plan;
}

TrainProgress Trainer::progress() const {
  const int iterations = iterationsOf(state_.stage);
  const double rate = std::max(state_.iteration, 1) / std::max(state_.seconds, 1e-9);
  return {state_.stage,
          state_.iteration,
          iterations,
          state_.loss.value(),
          state_.iteration > 0 ? decibels(state_.squared_error.value()) : 0,
          engine_->gaussians(state_),
          rate,
          time_left_.seconds(plan())};
}

void Trainer::iterate() {
  TG_ASSERT(state_.iteration < iterationsOf(state_.stage), "the stage has an iteration left");
  if (state_.stage == Stage::textured && settings_.adaptive_texels > 0 &&
      state_.iteration == settings_.texture_iterations / 2) {
    cutTextures();
  }
  findTextureGroups();
  const int iteration = ++state_.iteration;
  const bool first_stage = state_.stage == Stage::count || state_.stage == Stage::plain;
  const std::size_t view = state_.order.next();
  glm::vec3 background = dataset_.background;
  if (dataset_.random_background) {
    Random random = stream(settings_.seed + static_cast<std::uint64_t>(iteration), Stream::background);
    for (int c = 0; c < 3; ++c) background[c] = static_cast<float>(random.uniform());
  }
  const std::optional<std::size_t> following = state_.order.following();
  const auto lacks = [&](std::size_t v) { return !engine_->hasPhotograph(v, dataset_.random_background); };
  std::shared_ptr<const ViewPixels> photograph;
  if (lacks(view)) photograph = dataset_.composited(view, background);
  if (following && lacks(*following)) dataset_.prefetch(*following);
  LearningRates rates;
  const bool own = !first_stage && settings_.rate_position_texture >= 0;
  rates.mean =
      static_cast<float>(extent_ * decayedRate(own ? settings_.rate_position_texture : settings_.rate_position,
                                               settings_.rate_position_end, iteration, iterationsOf(state_.stage)));
  rates.rotation = settings_.rate_rotation;
  rates.log_scale = settings_.rate_scale;
  rates.opacity_logit = settings_.rate_opacity;
  rates.sh = {settings_.rate_sh_dc, settings_.rate_sh_rest};
  const bool own_end = settings_.rate_texels > 0 && settings_.rate_texels_end >= 0;
  const float texels_end = own_end ? settings_.rate_texels_end : settings_.rate_texels;
  rates.texels =
      static_cast<float>(decayedRate(settings_.rate_texels, texels_end, iteration, iterationsOf(state_.stage)));
  rates.texel_decay = settings_.texel_decay;
  if (state_.stage == Stage::quantized) {
    const Quantized phase = phaseOf(iteration - 1, settings_.quantize_iterations);
    rates.mean = 0;
    if (phase >= Quantized::rotation) rates.rotation = 0;
    if (phase >= Quantized::logScale) rates.log_scale = 0;
    if (phase >= Quantized::texelsAndOpacity) rates.opacity_logit = 0;
    rates.texels = phase >= Quantized::texelsAndOpacity ? 0 : texels_end;
    rates.texel_decay = 0;
    if (phase >= Quantized::shRest) rates.sh.rest = 0;
  }
  StepChoices choices{
      .view = view,
      .following = following,
      .background = background,
      .background_varies = dataset_.random_background,
      .iteration = iteration,
      .gradient = {},
      .gather_statistics = first_stage && traits_.gathers_statistics && iteration < schedule_.densify_until,
      .rates = rates,
      .mcmc = first_stage && traits_.explores,
      .opacity_weight = settings_.mcmc_opacity_weight,
      .scale_weight = settings_.mcmc_scale_weight,
      .noise = static_cast<float>(settings_.mcmc_noise * extent_ *
                                  decayedRate(kNoiseRate, kNoiseRateEnd, iteration, iterationsOf(state_.stage))),
      .noise_seed = stream(settings_.seed, Stream::noise).bits(),
      .clamp_colors = settings_.texture_init == TextureInit::paper};
  choices.gradient.statistics = choices.gather_statistics;
  choices.gradient.texture_to_geometry = settings_.texture_gradient_geometry;
  choices.gradient.texture_in_suffix = settings_.texture_gradient_suffix;
  engine_->step(state_, {choices, dataset_.views[view], photograph, *state_.texture_groups});
  plain_.reset();
  if (first_stage) densifyAndSchedule(iteration);
  const int left = iterationsOf(state_.stage) - iteration;
  if (iteration % kFilterEvery == 0 && left >= kFilterEvery) updateFilter();
  // The stage's time counts to the end of its last step.
  takeLosses(left == 0);
}

void Trainer::densify(int iteration) {
  switch (settings_.densification) {
    case Densification::none:
      return;
    case Densification::adc: {
      DensifySettings densify_settings;
      densify_settings.extent = extent_;
      densify_settings.score_threshold = settings_.densify_threshold;
      densify_settings.score = settings_.densify_score;
      densify_settings.prune_opacity = settings_.prune_opacity;
      densify_settings.prune_radius = settings_.prune_radius;
      densify_settings.prune_large = schedule_.prunesLarge(iteration);
      densify_settings.max_gaussians = limitNow();
      if (swapsAfter(iteration)) {
        keepMostSeen(limitNow() - static_cast<std::size_t>(kSwapped * static_cast<double>(limitNow())));
      }
      if (settings_.wide_sigma > 0) splitWideOnes();
      engine_->densify(state_, densify_settings);
      return;
    }
    case Densification::mcmc: {
      if (limit() > 0) keepMostSeen(limit());
      McmcSettings mcmc_settings;
      mcmc_settings.max_gaussians = limit();
      mcmc_settings.dead_opacity = settings_.prune_opacity;
      mcmc_settings.growth = mcmcGrowth();
      engine_->relocateAndGrow(state_, mcmc_settings);
      return;
    }
  }
}

void Trainer::densifyAndSchedule(int iteration) {
  if (schedule_.densifies(iteration)) {
    takeLosses(true);
    densify(iteration);
    if (engine_->gaussians(state_) == 0) {
      const bool pruned = settings_.prune_opacity > kFirstOpacity;
      throw Error(ErrorKind::badData,
                  "no Gaussian is left after densification at iteration " + std::to_string(iteration) +
                      (pruned ? ": --prune-opacity " + numberText(settings_.prune_opacity) +
                                    " prunes what is less opaque (points begin at " + numberText(kFirstOpacity) + ")"
                              : ": do the cameras see what it began with?"));
    }
    updateFilter();
  }
  if (merges() && iteration == schedule_.merge_after) mergePairs();
  if (resetsOpacity(iteration)) engine_->resetOpacity(state_);
  const int degree = state_.training.model.sh_degree;
  if (schedule_.raisesShDegree(iteration) && degree < settings_.sh_degree) engine_->growShDegree(state_, degree + 1);
}

void Trainer::quantizeNext() {
  const Quantized turn = phaseOf(state_.iteration, settings_.quantize_iterations);
  if (state_.iteration > 0 && turn == phaseOf(state_.iteration - 1, settings_.quantize_iterations)) return;
  TG_ASSERT(stored_, "the trainer knows what the file holds");
  pull();
  engine_->stateChanged();
  GaussianModel& model = state_.training.model;
  GaussianModel stored = stored_(model, state_.file_steps);
  TG_ASSERT(stored.size() == model.size() && stored.sh_degree == model.sh_degree, "the file has the model's Gaussians");
  switch (turn) {
    case Quantized::mean:
      model.mean = std::move(stored.mean);
      break;
    case Quantized::rotation:
      model.rotation = std::move(stored.rotation);
      break;
    case Quantized::logScale:
      for (std::size_t i = 0; i < model.size(); ++i) {
        if (!isDropped(stored, model, i)) model.log_scale[i] = stored.log_scale[i];
      }
      break;
    case Quantized::texelsAndOpacity: {
      model.opacity_logit = std::move(stored.opacity_logit);
      // A .sog's steps of these follow from which textures are left, and which are the same (converter/sog).
      model.rotation = std::move(stored.rotation);
      model.log_scale = std::move(stored.log_scale);
      // What rounding takes from a texture's mean a file leaves in DC, which it rounds as well: it goes there here.
      const std::vector<glm::vec3> before = meanTextureColors(model);
      copyTexels(stored.atlas, model.atlas);
      const std::vector<glm::vec3> after = meanTextureColors(model);
      for (std::size_t i = 0; i < model.size(); ++i) {
        glm::vec3& dc = model.sh[i * model.shCount()];
        dc = isDropped(stored, model, i) ? stored.sh[i * model.shCount()] : dc + (before[i] - after[i]);
      }
      break;
    }
    case Quantized::shRest:
      for (std::size_t i = 0; i < model.sh.size(); ++i) {
        if (i % model.shCount() > 0) model.sh[i] = stored.sh[i];
      }
      break;
  }
}

float Trainer::mcmcGrowth() const {
  if (settings_.mcmc_growth >= 0) return settings_.mcmc_growth;
  constexpr float kPublished = 0.05f;
  const double rounds = (schedule_.densify_until - schedule_.densify_from) / (2.0 * schedule_.densify_every);
  const double factor = static_cast<double>(limit()) / static_cast<double>(state_.report.initial_gaussians);
  return std::max(kPublished, static_cast<float>(std::pow(std::max(factor, 1.0), 1 / std::max(rounds, 1.0)) - 1));
}

StageReport Trainer::stageReport() const {
  takeLosses(true);
  StageReport report;
  report.iterations = state_.iteration;
  report.seconds = state_.seconds;
  report.loss = state_.loss.value();
  report.train_psnr = state_.iteration > 0 ? decibels(state_.squared_error.value()) : 0;
  report.gaussians = engine_->gaussians(state_);
  return report;
}

void Trainer::keepToLimit() {
  if (!swaps()) {
    if (picks()) keepMostSeen(limit());
    return;
  }
  switch (settings_.limit_by) {
    case LimitBy::room:
      return;
    case LimitBy::swap:
      keepMostSeen(limit());
      return;
    case LimitBy::merge:
      mergePairs();
      return;
  }
}

bool Trainer::end(const std::atomic<bool>* stop) {
  if (state_.stage == Stage::plain) keepToLimit();
  StageReport report = stageReport();
  if (state_.stage != Stage::count && !dataset_.indices(true).empty()) {
    report.test = testScore(stop);
    if (!report.test) return false;
  }
  const bool textured = settings_.texture_mode != TextureMode::none && settings_.texture_iterations > 0;
  const bool quantized = settings_.quantize_iterations > 0;
  setReport(state_.report, state_.stage, report);
  if (state_.stage == Stage::count) {
    state_.default_gaussians = report.gaussians;
    begin(Stage::plain, {});
  } else if (state_.stage == Stage::plain && textured) {
    begin(Stage::textured, {});
  } else if (state_.stage == Stage::textured && settings_.compare_untextured) {
    begin(Stage::untextured, {});
  } else if (quantized && state_.stage != Stage::quantized) {
    begin(Stage::quantized, {});
  } else {
    state_.finished = true;
  }
  return true;
}

GaussianModel Trainer::asDrawn(GaussianModel model) const {
  setShDegree(model, std::max(model.sh_degree, settings_.sh_degree));
  if (!state_.min_sigma.empty()) {
    EffectiveParameters effective;
    applyFilter(model, state_.min_sigma, effective);
    model.log_scale = std::move(effective.log_scale);
    model.opacity_logit = std::move(effective.opacity_logit);
  }
  return model;
}

GaussianModel Trainer::model() const {
  pull();
  return asDrawn(state_.training.model);
}

Image Trainer::picture(const Camera& camera) const {
  TG_ASSERT(camera.size.x > 0 && camera.size.y > 0, "a picture has pixels");
  return imageOf(engine_->picture(state_, camera, dataset_.background), camera);
}

std::optional<Score> Trainer::testScore(const std::atomic<bool>* stop) const {
  std::vector<ViewScore> scores;
  const std::vector<std::size_t> views = dataset_.indices(true);
  if (views.empty()) return std::nullopt;
  if (scoring_) scoring_(0, views.size());
  for (const std::size_t view : views) {
    if (stop && stop->load(std::memory_order_relaxed)) return std::nullopt;
    scores.push_back(scoreViews(dataset_, {&view, 1}, [&](const Camera& camera) { return picture(camera); }).front());
    if (scoring_) scoring_(scores.size(), views.size());
  }
  return meanScore(scores);
}

TrainResult Trainer::result() const {
  TrainResult result;
  result.report = state_.report;
  result.report.interrupted = !state_.finished;
  // The stage that was cut short, so far.
  if (!state_.finished) setReport(result.report, state_.stage, stageReport());
  if (state_.stage == Stage::untextured) {
    result.model = state_.textured;
    result.untextured = model();
  } else {
    result.model = model();
  }
  return result;
}

// Without a pull: the stage began with one, and a device that has no room may have done half of a step. An engine that
// keeps no copy here leaves nothing.
std::optional<TrainResult> Trainer::takePlain() {
  GaussianModel& model = state_.training.model;
  if (!plain_ || model.size() == 0) return std::nullopt;
  state_.training.moments = {};
  state_.untextured_start = {};
  model.atlas = {};
  model.texture_mode = TextureMode::none;
  model.outside = TextureOutside::base;
  model.intersection = plain_->intersection;
  for (std::size_t i = 0; i < plain_->constant_color.size(); ++i) {
    model.sh[i * model.shCount()] = plain_->constant_color[i];
  }
  state_.min_sigma = std::move(plain_->min_sigma);
  plain_.reset();
  TrainResult result;
  result.report = state_.report;
  result.report.interrupted = true;
  result.model = asDrawn(std::move(model));
  return result;
}

TrainResult train(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer,
                  const TrainHooks& hooks, std::optional<GaussianModel> start) {
  Trainer trainer(dataset, settings, renderer, std::move(start));
  while (!trainer.finished() && !(hooks.stop && hooks.stop->load(std::memory_order_relaxed))) {
    if (trainer.step(hooks.stop) && hooks.after_step) hooks.after_step(trainer);
  }
  return trainer.result();
}

}  // namespace tg
