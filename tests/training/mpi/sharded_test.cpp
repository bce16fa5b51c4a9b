// SPDX-License-Identifier: Apache-2.0
// Training over several ranks ends in the bytes of training by one: every kind of step and round, at any number.
#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/every_setting.h"
#include "training/mpi/engine.h"
#include "training/mpi/part.h"
#include "training/mpi/thread_channel.h"
#include "training/run/checkpoint.h"
#include "training/run/trainer.h"
#include "training/sample_dataset.h"

using tg::test::atRanks;
using tg::test::ThreadRanks;

namespace {

constexpr tg::SampleOptions kScene{.size = 80, .train_views = 5, .test_views = 1, .points = 400, .supersampling = 1};

tg::TrainSettings shortRun() {
  tg::TrainSettings settings;
  settings.iterations = 40;
  settings.texture_iterations = 12;
  settings.densify_every = 8;
  settings.densify_from = 4;
  settings.densify_until = 34;
  settings.sh_every = 10;
  settings.gaussians = 500;
  settings.limit_by = tg::LimitBy::swap;
  settings.pixels_per_texel = 0;
  return settings;
}

// A run's state at its end, without times, as a checkpoint holds it, and what it scored.
using Bytes = std::vector<std::uint8_t>;
Bytes stateOf(const tg::Trainer& trainer) {
  tg::RunState state = trainer.state();
  state.seconds = 0;
  state.report.plain.seconds = 0;
  for (auto* report :
       {&state.report.count, &state.report.textured, &state.report.untextured, &state.report.quantized}) {
    if (*report) (*report)->seconds = 0;
  }
  const tg::TemporaryFolder folder;
  tg::writeCheckpoint(folder / "checkpoint", {}, state);
  return tg::readFile(folder / "checkpoint", 1 << 26);
}

// The states on the way and at the end.
std::vector<Bytes> trained(const tg::Dataset& dataset, const tg::TrainSettings& settings,
                           tg::DifferentiableRenderer& renderer) {
  tg::Trainer trainer(dataset, settings, renderer);
  trainer.onQuantizing([](const tg::GaussianModel& model, float& steps) {
    steps = 1;
    return model;
  });
  std::vector<Bytes> states;
  while (!trainer.finished()) {
    trainer.step();
    // In the middle of a stage, too: whoever looks at a state changes nothing.
    if (trainer.progress().iteration == 11) states.push_back(stateOf(trainer));
  }
  states.push_back(stateOf(trainer));
  return states;
}

std::vector<Bytes> trainedBy(int ranks, const tg::Dataset& dataset, const tg::TrainSettings& settings) {
  ThreadRanks shared(ranks);
  std::vector<Bytes> states;
  atRanks(shared, [&](tg::Channel& channel) {
    if (channel.rank() > 0) {
      if (tg::serveRank(channel, dataset) != 7) throw std::logic_error("a rank has ended with another code");
      return;
    }
    const auto renderer = tg::makeShardedRenderer(channel, dataset);
    states = trained(dataset, settings, *renderer);
    tg::endRanks(channel, 7);
  });
  return states;
}

void checkSame(const tg::TrainSettings& settings, const tg::Dataset& dataset) {
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const std::vector<Bytes> alone = trained(dataset, settings, *renderer);
  for (const int ranks : {1, 2, 3, 4}) {
    INFO(ranks << " ranks");
    const bool same = trainedBy(ranks, dataset, settings) == alone;
    CHECK(same);
  }
}

}  // namespace

TEST_CASE("training has the same bytes by any number of ranks: densification, resets, SH, textures of 4 x 4") {
  tg::TrainSettings settings = shortRun();
  settings.reset_every = 15;
  settings.texture_outside = tg::TextureOutside::clip;
  checkSame(settings, tg::test::sampleDataset(kScene));
}

TEST_CASE("training has the same bytes by any number of ranks: no limit, 3D filter, wide textures, a twin") {
  tg::TrainSettings settings = shortRun();
  settings.iterations = 25;
  settings.texture_iterations = 5;
  settings.gaussians = 0;
  settings.densify_threshold = 5e-5f;
  settings.densify_score = tg::DensifyScore::magnitudes;
  settings.filter_3d = true;
  settings.texture_size = 9;
  settings.texture_mode = tg::TextureMode::rgb;
  settings.compare_untextured = true;
  checkSame(settings, tg::test::sampleDataset(kScene));
}

TEST_CASE("training has the same bytes by any number of ranks: 3D filter, wide Gaussians that are split") {
  tg::TrainSettings settings = shortRun();
  settings.filter_3d = true;
  settings.wide_sigma = 0.01f;
  settings.gaussians = 0;
  checkSame(settings, tg::test::sampleDataset(kScene));
}

TEST_CASE("training has the same bytes by any number of ranks: 3D filter, a count first, merged pairs") {
  tg::TrainSettings settings = shortRun();
  settings.filter_3d = true;
  settings.gaussians = 0;
  settings.percent = 60;
  settings.limit_by = tg::LimitBy::merge;
  checkSame(settings, tg::test::sampleDataset(kScene));
}

TEST_CASE("training has the same bytes by any number of ranks: MCMC from random points, cut textures, stage 3") {
  tg::TrainSettings settings = shortRun();
  settings.densification = tg::Densification::mcmc;
  settings.start = tg::Start::random;
  settings.init_count = 700;
  settings.adaptive_texels = 5;
  settings.quantize_iterations = 12;
  settings.texture_init = tg::TextureInit::paper;
  checkSame(settings, tg::test::sampleDataset(kScene, true));
}

TEST_CASE("training has the same bytes by any number of ranks: masks that hide pixels") {
  tg::TrainSettings settings = shortRun();
  settings.texture_iterations = 0;
  settings.texture_mode = tg::TextureMode::none;
  tg::Dataset dataset = tg::test::sampleDataset(kScene);
  std::vector<tg::Photograph> photographs;
  for (std::size_t view = 0; view < dataset.views.size(); ++view) {
    tg::Photograph& photograph = photographs.emplace_back();
    photograph.pixels = *dataset.pixels(view);
    photograph.pixels.mask.assign(photograph.pixels.rgb.size() / 3, 255);
    std::fill_n(photograph.pixels.mask.begin() + 2000 + static_cast<std::ptrdiff_t>(view) * 80, 900, std::uint8_t{0});
  }
  dataset.photographs = tg::storeInMemory(std::move(photographs));
  checkSame(settings, dataset);
}

// A part of a step that does not cross to the others changes these bytes.
TEST_CASE("two ranks train the bytes of one with any setting off its default") {
  const tg::Dataset dataset = tg::test::tinyDataset();
  for (const tg::SettingEntry& entry : tg::settingEntries()) {
    if (entry.name == "texture-dictionary") continue;  // refused: not under mpirun
    for (const auto& [usual, settings] : tg::test::runsOf(entry)) {
      INFO(entry.name << " " << entry.get(settings));
      const tg::TrainResult alone = tg::test::trainOn(dataset, settings, *tg::makeCpuDifferentiableRenderer());
      ThreadRanks shared(2);
      atRanks(shared, [&, &settings = settings](tg::Channel& channel) {
        if (channel.rank() > 0) {
          tg::serveRank(channel, dataset);
          return;
        }
        const auto renderer = tg::makeShardedRenderer(channel, dataset);
        const bool same = tg::test::sameModels(tg::test::trainOn(dataset, settings, *renderer), alone);
        tg::endRanks(channel, 0);
        CHECK(same);
      });
    }
  }
}

TEST_CASE("textures that do not lie in the order of their Gaussians are refused with a line") {
  const tg::Dataset dataset = tg::test::sampleDataset(kScene);
  ThreadRanks shared(1);
  atRanks(shared, [&](tg::Channel& channel) {
    tg::RunState state;
    tg::resizeGaussians(state.training.model, 2, 0);
    state.training.model.texture_mode = tg::TextureMode::rgba;
    state.training.model.atlas.rects = {{1, 1, 1}, {0, 1, 1}};
    state.training.model.atlas.texels.resize(2);
    tg::resetMoments(state.training);
    state.statistics.reset(2);
    tg::Part part(channel, dataset);
    CHECK_THROWS_WITH(part.scatter(&state), Contains("texels in the order of their Gaussians"));
  });
}

TEST_CASE("of shared photographs each part keeps its own in memory, and only the first has all cameras") {
  const tg::TemporaryFolder folder;
  tg::writeSample(folder / "scene", {.size = 16, .train_views = 5, .test_views = 2, .points = 10, .supersampling = 1},
                  false);
  std::size_t kept = 0;
  for (const int part : {0, 1}) {
    tg::DatasetOptions options;
    options.part = part;
    options.parts = 2;
    const tg::Dataset dataset = tg::loadDataset(folder / "scene", options);
    CHECK(dataset.views.size() == 7);
    CHECK(dataset.photographs->keptViews() == (part == 0 ? 3 : 2));
    kept += dataset.photographs->keptViews();
    for (std::size_t view = 0; view < 7; ++view) {
      const bool own = view < 5 && tg::photographOwner(view, 2) == part;
      CHECK((dataset.views[view].size.x == 16) == (own || part == 0));
      CHECK(dataset.pixels(view)->width == 16);
    }
  }
  CHECK(kept == 5);
}

TEST_CASE("rows of tiles are shared out by their cost, top to bottom, and all of them") {
  const auto shared = [](const std::vector<std::uint64_t>& costs, int ranks) {
    std::string text;
    for (const tg::cpu::TileRows& band : tg::shareRows(costs, ranks)) {
      text += std::to_string(band.first) + "-" + std::to_string(band.end) + " ";
    }
    return text;
  };
  CHECK(shared({1, 1, 1, 1}, 1) == "0-4 ");
  CHECK(shared({1, 1, 1, 1}, 2) == "0-2 2-4 ");
  CHECK(shared({9, 1, 1, 1}, 2) == "0-1 1-4 ");
  CHECK(shared({1, 1, 1, 9}, 2) == "0-3 3-4 ");
  CHECK(shared({1, 1}, 4) == "0-1 1-2 2-2 2-2 ");
  CHECK(shared({}, 2) == "0-0 0-0 ");
  CHECK(shared({0, 0, 0}, 2) == "0-1 1-3 ");
}

TEST_CASE("a shard of a million million Gaussians begins where the one before it ends") {
  for (const std::size_t gaussians : {std::size_t{0}, std::size_t{2}, std::size_t{1'000'000'000'000}}) {
    const tg::Shards shards = tg::Shards::even(gaussians, 7);
    CHECK(shards.first(0) == 0);
    CHECK(shards.total() == gaussians);
    for (int rank = 0; rank < 7; ++rank) {
      CHECK(shards.count(rank) <= gaussians / 7 + 1);
      CHECK(shards.count(rank) >= gaussians / 7);
    }
  }
}
