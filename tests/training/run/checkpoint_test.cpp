// SPDX-License-Identifier: Apache-2.0
// A run goes on from a checkpoint to the same bytes; a checkpoint from a stranger is refused, never trusted.
#include "training/run/checkpoint.h"

#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>

#include "core/file/file.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/run/report.h"
#include "training/run/trainer.h"
#include "training/sample_dataset.h"

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr tg::SampleOptions kScene{.size = 24, .train_views = 5, .test_views = 1, .points = 60, .supersampling = 1};
constexpr std::uint64_t kMaxBytes = 64 << 20;

Bytes bytesOf(const tg::TemporaryFolder& folder, const tg::RunState& state, const tg::CheckpointHeader& header = {}) {
  tg::writeCheckpoint(folder / "checkpoint", header, state);
  return tg::readFile(folder / "checkpoint", kMaxBytes);
}

// The state without what the clock says.
tg::RunState withoutTimes(tg::RunState state) {
  state.seconds = 0;
  state.report.plain.seconds = 0;
  for (auto* report : {&state.report.count, &state.report.textured, &state.report.untextured}) {
    if (*report) (*report)->seconds = 0;
  }
  return state;
}

tg::TrainSettings shortRun() {
  tg::TrainSettings settings;
  settings.iterations = 24;
  settings.texture_iterations = 8;
  settings.densify_every = 5;
  settings.densify_from = 4;
  settings.densify_until = 21;
  settings.sh_every = 6;
  settings.gaussians = 400;
  return settings;
}

// A state with something in every member.
tg::RunState richState(const tg::Dataset& dataset, tg::DifferentiableRenderer& renderer) {
  tg::TrainSettings settings = shortRun();
  settings.gaussians = 12;
  settings.iterations = 6;
  settings.texture_iterations = 2;
  settings.texture_size = 2;
  settings.texture_outside = tg::TextureOutside::clip;
  settings.sh_degree = 1;
  settings.filter_3d = true;
  settings.compare_untextured = true;
  tg::Trainer trainer(dataset, settings, renderer);
  while (trainer.state().stage != tg::Stage::untextured) trainer.step();
  tg::RunState state = trainer.state();
  state.untextured_start = state.training.model;
  state.report.count = state.report.quantized = state.report.plain;
  state.file_steps = 2.5f;
  state.texture_groups = std::vector<std::uint32_t>(state.training.model.size(), 0);
  state.training.model.atlas.rects.resize(state.training.model.size());
  return state;
}

// One block of a checkpoint: where its length and content lie.
struct Block {
  std::string name;
  std::size_t begin = 0;
  std::size_t content = 0;
  std::size_t end = 0;
};
std::vector<Block> blocksOf(const Bytes& bytes) {
  std::vector<Block> blocks;
  for (std::size_t at = 12; at < bytes.size();) {
    Block block;
    block.begin = at;
    std::uint16_t name_size = 0;
    std::uint64_t size = 0;
    std::memcpy(&name_size, &bytes[at], 2);
    block.name.assign(reinterpret_cast<const char*>(&bytes[at + 2]), name_size);
    std::memcpy(&size, &bytes[at + 2 + name_size], 8);
    block.content = at + 10 + name_size;
    block.end = at = block.content + size + 4;
    blocks.push_back(block);
  }
  return blocks;
}

// The file with another content of a block, and a checksum that fits.
Bytes withContent(const Bytes& bytes, const std::string& name, const Bytes& content) {
  const std::vector<Block> blocks = blocksOf(bytes);
  const auto block = std::find_if(blocks.begin(), blocks.end(), [&](const Block& b) { return b.name == name; });
  REQUIRE(block != blocks.end());
  const auto at = [&](std::size_t i) { return bytes.begin() + static_cast<std::ptrdiff_t>(i); };
  Bytes changed(at(block->begin), at(block->content - 8));
  const std::uint64_t size = content.size();
  const auto* size_bytes = reinterpret_cast<const std::uint8_t*>(&size);
  changed.insert(changed.end(), size_bytes, size_bytes + 8);
  changed.insert(changed.end(), content.begin(), content.end());
  const auto crc = static_cast<std::uint32_t>(crc32_z(0, changed.data(), changed.size()));
  const auto* crc_bytes = reinterpret_cast<const std::uint8_t*>(&crc);
  changed.insert(changed.end(), crc_bytes, crc_bytes + 4);
  Bytes result(bytes.begin(), at(block->begin));
  result.insert(result.end(), changed.begin(), changed.end());
  result.insert(result.end(), at(block->end), bytes.end());
  return result;
}
template <typename T>
Bytes asBytes(const std::vector<T>& values) {
  const auto* first = reinterpret_cast<const std::uint8_t*>(values.data());
  return {first, first + values.size() * sizeof(T)};
}

std::string refusal(const Bytes& bytes) {
  try {
    tg::parseCheckpoint(bytes, "checkpoint");
  } catch (const tg::Error& error) {
    CHECK(error.kind == tg::ErrorKind::badData);
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a checkpoint comes back as it was written", "[checkpoint]") {
  const tg::TemporaryFolder folder;
  const tg::Dataset dataset = tg::test::sampleDataset(kScene);
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const tg::RunState state = richState(dataset, *renderer);
  const tg::CheckpointHeader header{tg::runIdentity(dataset, shortRun(), "cafe"), 12.5, 77};
  const Bytes bytes = bytesOf(folder, state, header);
  const tg::Checkpoint read = tg::readCheckpoint(folder / "checkpoint");
  CHECK(read.header.identity == header.identity);
  CHECK(read.header.seconds == 12.5);
  CHECK(read.header.metrics_bytes == 77);
  CHECK(read.state.stage == tg::Stage::untextured);
  CHECK(read.state.training.model.mean == state.training.model.mean);
  CHECK(read.state.textured.outside == tg::TextureOutside::clip);
  CHECK(read.state.textured.atlas.texels == state.textured.atlas.texels);
  CHECK(read.state.min_sigma == state.min_sigma);
  CHECK(read.state.texture_groups == state.texture_groups);
  CHECK(read.state.order.views == state.order.views);
  REQUIRE(read.state.report.textured);
  CHECK(read.state.report.textured->test->psnr == state.report.textured->test->psnr);
  CHECK(bytesOf(folder, read.state, read.header) == bytes);
  // Every member is there: no array of this state is empty but texels and their moments, which this stage has not.
  for (const Block& block : blocksOf(bytes)) {
    INFO(block.name);
    const bool start = block.name.starts_with("untextured_start.");
    const bool textureless = start || block.name.starts_with("training.");
    const bool empty = block.end - block.content == 4;
    CHECK(empty == (block.name == "end" || (textureless && block.name.find("texels") != std::string::npos) ||
                    (start && block.name.find("rects") != std::string::npos)));
  }
}

TEST_CASE("a run that goes on from a checkpoint ends in the same bytes", "[checkpoint]") {
  struct Case {
    const char* name;
    std::function<void(tg::TrainSettings&)> change;
    bool random_background = false;
  };
  const Case cases[] = {
      {"clone, split and prune; the twin", [](tg::TrainSettings& s) { s.compare_untextured = true; }},
      {"opacity reset, magnitudes",
       [](tg::TrainSettings& s) {
         s.reset_every = 7;
         s.densify_score = tg::DensifyScore::magnitudes;
       }},
      {"swapping under a limit",
       [](tg::TrainSettings& s) {
         s.limit_by = tg::LimitBy::swap;
         s.densify_every = 3;
       }},
      {"pairs merged down to a limit",
       [](tg::TrainSettings& s) {
         s.gaussians = 40;  // the photographs have pixels for 90
         s.densify_every = 3;
       }},
      {"mcmc, 3D filter",
       [](tg::TrainSettings& s) {
         s.densification = tg::Densification::mcmc;
         s.filter_3d = true;
       }},
      {"3D filter with densification, random background, paper's texels",
       [](tg::TrainSettings& s) {
         s.filter_3d = true;
         s.texture_init = tg::TextureInit::paper;
       },
       true},
      {"adaptive textures", [](tg::TrainSettings& s) { s.adaptive_texels = 3; }},
      {"textures that Gaussians share", [](tg::TrainSettings& s) { s.texture_dictionary = 4; }},
      {"a share of a count that a stage finds out, textures by footprint, nothing beyond them",
       [](tg::TrainSettings& s) {
         s.texture_outside = tg::TextureOutside::clip;
         s.gaussians = 0;
         s.percent = 50;
         s.texture_sizes = tg::TextureSizes::footprint;
       }},
  };
  const tg::TemporaryFolder folder;
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  for (const Case& each : cases) {
    INFO(each.name);
    const tg::Dataset dataset = tg::test::sampleDataset(kScene, each.random_background);
    tg::TrainSettings settings = shortRun();
    each.change(settings);
    // After every step of an uninterrupted run, a checkpoint.
    std::vector<Bytes> checkpoints;
    tg::Trainer whole(dataset, settings, *renderer);
    while (!whole.finished()) {
      if (whole.step()) checkpoints.push_back(bytesOf(folder, whole.state()));
    }
    const Bytes expected = bytesOf(folder, withoutTimes(whole.state()));
    const tg::TrainReport& report = whole.state().report;
    if (settings.percent == 0 && report.initial_gaussians <= settings.gaussians) {
      CHECK(report.plain.gaussians > report.initial_gaussians);
    } else if (settings.percent == 0) {
      CHECK(report.plain.gaussians == settings.gaussians);
    }
    // First step; around the densification after step 5 and the merging after 22; around the end of each stage and in
    // the middle of the last.
    std::vector<std::size_t> stops = {1, 4, 5, 6, 21, 22, 23, 24, 25, 31, checkpoints.size() - 4, checkpoints.size()};
    for (const std::size_t stop : stops) {
      INFO("stopped after " << stop << " of " << checkpoints.size());
      // Another renderer, as after a new start.
      const auto fresh = tg::makeCpuDifferentiableRenderer();
      tg::Trainer resumed(dataset, settings, *fresh, tg::parseCheckpoint(checkpoints.at(stop - 1), "checkpoint").state);
      while (!resumed.finished()) resumed.step();
      CHECK(bytesOf(folder, withoutTimes(resumed.state())) == expected);
    }
  }
}

TEST_CASE("a checkpoint that ends early or has a wrong byte anywhere is refused", "[checkpoint]") {
  const tg::TemporaryFolder folder;
  const tg::Dataset dataset = tg::test::sampleDataset(kScene);
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const Bytes bytes = bytesOf(folder, richState(dataset, *renderer));
  REQUIRE(refusal(bytes).empty());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    if (refusal({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)}).empty()) FAIL("cut at " << size);
  }
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    Bytes wrong = bytes;
    wrong[i] ^= static_cast<std::uint8_t>(1 + i % 255);
    if (refusal(wrong).empty()) FAIL("wrong byte " << i);
  }
  Bytes longer = bytes;
  longer.push_back(0);
  CHECK_THAT(refusal(longer), Contains("1 bytes after the end"));
  Bytes newer = bytes;
  newer[8] = 9;
  CHECK_THAT(refusal(newer), Contains("another version of tgtrain (expected 4, found 9)"));
  CHECK_THAT(refusal({'n', 'o'}), Contains("not a checkpoint"));

  CHECK_THROWS_WITH(tg::readCheckpoint(folder / "absent"), Contains("cannot open"));
  CHECK_THROWS_WITH(tg::readCheckpoint(folder.path), Contains("is not a regular file"));
}

TEST_CASE("what a checkpoint says is checked even where its checksums are right", "[checkpoint]") {
  const tg::TemporaryFolder folder;
  const tg::Dataset dataset = tg::test::sampleDataset(kScene);
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const tg::RunState state = richState(dataset, *renderer);
  const Bytes bytes = bytesOf(folder, state);
  const auto refused = [&](const std::string& name, const Bytes& content) {
    return refusal(withContent(bytes, name, content));
  };
  CHECK_THAT(refused("stage", asBytes<std::uint32_t>({5})), Contains("stage: expected 0 to 4, found 5"));
  CHECK_THAT(refused("finished", {2}), Contains("finished: expected 0 or 1, found 2"));
  CHECK_THAT(refused("iteration", {1}), Contains("iteration: wrong length (expected 4 bytes, found 1)"));
  CHECK_THAT(refused("training.mean.first", {1, 2, 3}), Contains("training.mean.first: wrong length"));
  CHECK_THAT(refused("training.mean.first", {}), Contains("training.mean: wrong length"));
  CHECK_THAT(refused("training.model.mean", {}), Contains("wrong length of rotation"));
  CHECK_THAT(refused("training.model.sh_degree", asBytes<std::int32_t>({4})), Contains("wrong SH degree"));
  CHECK_THAT(refused("textured.texture_mode", asBytes<std::uint32_t>({4})), Contains("textured.texture_mode"));
  CHECK_THAT(refused("textured.outside", asBytes<std::uint32_t>({2})), Contains("textured.outside"));
  CHECK_THAT(refused("textured.texels", {}), Contains("leaves the atlas"));
  CHECK_THAT(refused("statistics.view_count", {}), Contains("statistics.view_count: wrong length"));
  CHECK_THAT(refused("min_sigma", asBytes<float>({1})), Contains("min_sigma: wrong length"));
  CHECK_THAT(refused("texture_groups", asBytes<std::uint32_t>({1})), Contains("texture_groups: wrong length"));
  std::vector<std::uint32_t> groups(state.training.model.size(), 0);
  groups.back() = static_cast<std::uint32_t>(groups.size());
  CHECK_THAT(refused("texture_groups", asBytes(groups)), Contains("texture_groups: a group of more than there are"));
  std::ranges::fill(groups, 0);
  groups.front() = 1;  // before 0
  CHECK_THAT(refused("texture_groups", asBytes(groups)), Contains("texture_groups: a group of more than there are"));
  tg::RunState two_sizes = state;
  two_sizes.training.model.atlas.rects.front() = {0, 1, 1};
  two_sizes.training.model.atlas.texels.resize(1);
  two_sizes.training.moments.texels.first.resize(4);
  two_sizes.training.moments.texels.second.resize(4);
  CHECK_THAT(refusal(bytesOf(folder, two_sizes)), Contains("texture_groups: textures of two sizes in one group"));
  CHECK_THAT(refused("training.step", asBytes<std::int64_t>({std::numeric_limits<std::int64_t>::max()})),
             Contains("training.step: expected 0 to"));
  CHECK_THAT(refused("order.position", asBytes<std::uint32_t>({5})), Contains("order.position"));
  CHECK_THAT(refused("default_gaussians", asBytes<std::uint64_t>({~std::uint64_t{0}})), Contains("default_gaussians"));
  std::vector<float> opacity = state.training.model.opacity_logit;
  opacity[0] = std::numeric_limits<float>::quiet_NaN();
  CHECK_THAT(refused("training.model.opacity_logit", asBytes(opacity)), Contains("Gaussian 0: opacity_logit"));
  tg::RunState empty = state;
  empty.training = {};
  empty.statistics.reset(0);
  empty.min_sigma = {};
  empty.texture_groups.reset();
  CHECK_THAT(refusal(bytesOf(folder, empty)), Contains("no Gaussian inside"));

  // A length that no memory could hold.
  Bytes huge = bytes;
  for (const Block& block : blocksOf(bytes)) {
    if (block.name != "training.model.mean") continue;
    const std::uint64_t size = std::uint64_t{12} << 56;
    std::memcpy(&huge[block.content - 8], &size, 8);
  }
  CHECK_THAT(refusal(huge), Contains("training.model.mean: ends early"));
}

TEST_CASE("a checkpoint of other settings or data is refused by the first difference", "[checkpoint]") {
  const tg::Dataset dataset = tg::test::sampleDataset(kScene);
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const tg::TrainSettings settings = shortRun();
  const std::string fingerprint = tg::datasetFingerprint(dataset);
  tg::Trainer trainer(dataset, settings, *renderer);
  for (int i = 0; i < 3; ++i) trainer.step();
  tg::Checkpoint checkpoint{{tg::runIdentity(dataset, settings, fingerprint), 0, 0}, trainer.state()};
  const auto check = [&](const tg::Dataset& data, const tg::TrainSettings& other) {
    tg::checkResumable(checkpoint, tg::runIdentity(data, other, tg::datasetFingerprint(data)), data, other, "c");
  };
  CHECK_NOTHROW(check(dataset, settings));
  for (const tg::Stage stage : {tg::Stage::count, tg::Stage::textured, tg::Stage::untextured, tg::Stage::quantized}) {
    tg::Stage& at = checkpoint.state.stage;
    const tg::Stage before = std::exchange(at, stage);
    INFO(tg::name(stage));
    CHECK_THROWS_WITH(check(dataset, settings), Contains("c: stage: no run with these settings is at"));
    at = before;
  }

  tg::TrainSettings other = settings;
  other.rate_sh_dc = 0.5f;
  other.compare_untextured = true;
  CHECK_THROWS_WITH(check(dataset, other), Contains("c: is of a run with other settings: --rate-sh-dc (expected 0.0025,"
                                                    " found 0.5)"));
  tg::Dataset fewer = dataset;
  fewer.views.pop_back();
  CHECK_THROWS_WITH(check(fewer, settings), Contains("other data: test-views (expected 1, found 0)"));
  tg::Dataset black = dataset;
  black.background = glm::vec3(0.0f);
  CHECK_THROWS_WITH(check(black, settings), Contains("background (expected 1,1,1, found 0,0,0)"));
  tg::Dataset moved = dataset;
  moved.views[2].translation.x += 1e-6;
  CHECK_THROWS_WITH(check(moved, settings), Contains("other data: fingerprint"));

  // A newer program with one more setting.
  checkpoint.header.identity.settings += "invented 1\n";
  CHECK_THROWS_WITH(check(dataset, settings), Contains("--invented (not known to this program)"));
  checkpoint.header.identity.settings = "seed 1\n";
  CHECK_THROWS_WITH(check(dataset, settings), Contains("--iterations (expected 7000, found 24)"));
  checkpoint.header.identity.settings = tg::runIdentity(dataset, settings, "").settings;

  checkpoint.state.iteration = 25;
  CHECK_THROWS_WITH(check(dataset, settings), Contains("iteration: expected 0 to 24, found 25"));
  checkpoint.state.iteration = 3;
  checkpoint.state.order.views[0] = 5;  // a test view
  CHECK_THROWS_WITH(check(dataset, settings), Contains("order.views: expected every training view once"));
}

TEST_CASE("a checkpoint is of the transparency that training on random backgrounds sees", "[checkpoint]") {
  tg::Dataset dataset = tg::test::sampleDataset(kScene, true);
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const tg::TrainSettings settings = shortRun();
  const auto identityOf = [&](const tg::Dataset& data) {
    return tg::runIdentity(data, settings, tg::datasetFingerprint(data));
  };
  const auto lineOf = [](const tg::RunIdentity& identity) {
    const std::size_t begin = identity.data.find("transparency ");
    REQUIRE(begin != std::string::npos);
    return identity.data.substr(begin, identity.data.find('\n', begin) + 1 - begin);
  };
  tg::Checkpoint checkpoint{{identityOf(dataset), 0, 0}, {}};
  {
    tg::Trainer trainer(dataset, settings, *renderer);
    trainer.step();
    checkpoint.state = trainer.state();
  }
  const auto check = [&](const tg::Dataset& data) {
    tg::checkResumable(checkpoint, identityOf(data), data, settings, "c");
  };
  CHECK_NOTHROW(check(dataset));
  // The same over white.
  std::vector<tg::Photograph> opaque;
  for (std::size_t i = 0; i < dataset.views.size(); ++i) opaque.push_back({*dataset.pixels(i), {}});
  tg::Dataset other = dataset;
  other.photographs = tg::storeInMemory(std::move(opaque));
  REQUIRE(tg::datasetFingerprint(other) == tg::datasetFingerprint(dataset));
  CHECK_THROWS_WITH(check(other), Contains("c: is of a run with other data: transparency (expected "));
  // An alpha that is opaque throughout is as none, and test views are not trained on.
  const auto withAlpha = [&](const auto& alphaOf) {
    std::vector<tg::Photograph> photographs;
    for (std::size_t i = 0; i < dataset.views.size(); ++i) photographs.push_back({*dataset.pixels(i), alphaOf(i)});
    tg::Dataset made = dataset;
    made.photographs = tg::storeInMemory(std::move(photographs));
    return identityOf(made);
  };
  const auto alphaOf = [&](std::size_t view, std::uint8_t value) {
    return std::vector<std::uint8_t>(dataset.pixels(view)->rgb.size() / 3, value);
  };
  CHECK(withAlpha([&](std::size_t view) { return alphaOf(view, 255); }) == identityOf(other));
  const auto ofTestViews = [&](bool test, std::uint8_t value) {
    return withAlpha([&](std::size_t view) {
      return dataset.views[view].test == test ? alphaOf(view, value) : std::vector<std::uint8_t>{};
    });
  };
  REQUIRE_FALSE(dataset.indices(true).empty());
  CHECK(ofTestViews(true, 7).data.find(lineOf(identityOf(other))) != std::string::npos);
  CHECK(ofTestViews(false, 254).data.find(lineOf(identityOf(other))) == std::string::npos);
  // Of a program that did not look at it.
  std::string& data = checkpoint.header.identity.data;
  const std::size_t line = data.find("transparency ");
  REQUIRE(line != std::string::npos);
  data.erase(line, data.find('\n', line) + 1 - line);
  CHECK_NOTHROW(check(dataset));
  CHECK_NOTHROW(check(other));
  // On one background it is no part of what is trained on.
  dataset.random_background = other.random_background = false;
  CHECK(identityOf(other) == identityOf(dataset));
}

TEST_CASE("a checkpoint from before a setting is that of its default", "[checkpoint]") {
  const tg::Dataset dataset = tg::test::sampleDataset(kScene);
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const tg::TrainSettings settings = shortRun();
  tg::Checkpoint checkpoint{{tg::runIdentity(dataset, settings, ""), 0, 0}, {}};
  {
    tg::Trainer trainer(dataset, settings, *renderer);
    for (int i = 0; i < 3; ++i) trainer.step();
    checkpoint.state = trainer.state();
  }
  std::string& known = checkpoint.header.identity.settings;
  const std::string line = "ssim-weight 0.2\n";
  const std::size_t at = known.find(line);
  REQUIRE(at != std::string::npos);
  known.erase(at, line.size());
  const auto check = [&](const tg::TrainSettings& other) {
    tg::checkResumable(checkpoint, tg::runIdentity(dataset, other, ""), dataset, other, "c");
  };
  CHECK_NOTHROW(check(settings));
  tg::Trainer resumed(dataset, settings, *renderer, checkpoint.state);
  CHECK(resumed.step());
  tg::TrainSettings other = settings;
  other.ssim_weight = 0.5f;
  CHECK_THROWS_WITH(check(other),
                    Contains("c: is of a run with other settings: --ssim-weight (expected 0.2, found 0.5)"));
}

TEST_CASE("a checkpoint that cannot be written leaves the old one", "[checkpoint]") {
  const tg::TemporaryFolder folder;
  const tg::Dataset dataset = tg::test::sampleDataset(kScene);
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  const tg::RunState state = richState(dataset, *renderer);
  CHECK_THROWS_WITH(tg::writeCheckpoint(folder / "no/checkpoint", {}, state), Contains("cannot write here"));
  CHECK_THROWS_WITH(tg::writeCheckpoint("/dev/full", {}, state), Contains("not a regular file"));
}
