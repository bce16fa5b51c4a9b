// SPDX-License-Identifier: Apache-2.0
// Blocks of a grown sample: every point once, cameras by what they see, the same every time.
#include "training/data/plan_blocks.h"

#include <algorithm>
#include <set>

#include "core/file/file.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "training/data/sample.h"

namespace fs = std::filesystem;

namespace {

constexpr tg::SampleOptions kCity{
    .size = 24, .train_views = 54, .test_views = 18, .points = 9000, .supersampling = 1, .grid = 3};
const glm::dvec3 kUp(0, 0, 1);

// Cameras and points alone.
tg::Dataset city() {
  tg::Dataset dataset;
  dataset.name = "city";
  dataset.points = tg::samplePoints(kCity);
  for (const bool test : {false, true}) {
    for (int i = 0; i < (test ? kCity.test_views : kCity.train_views); ++i) {
      dataset.views.push_back(tg::sampleCamera(kCity, test, i));
    }
  }
  return dataset;
}

tg::BlockOptions options(int columns, int rows) {
  tg::BlockOptions options;
  options.grid = {columns, rows};
  options.least = 5;
  return options;
}

}  // namespace

TEST_CASE("blocks share the ground and the points evenly, and padding overlaps", "[blocks]") {
  const tg::Dataset dataset = city();
  const std::vector<tg::PlannedBlock> plan = tg::planBlocks(dataset, kUp, options(3, 2));
  REQUIRE(plan.size() == 6);
  std::vector<std::size_t> held(plan.size());
  for (const glm::vec3& point : dataset.points.position) {
    int owners = 0;
    for (std::size_t i = 0; i < plan.size(); ++i) {
      const bool inside = plan[i].block.cell.contains(glm::dvec3(point));
      owners += inside;
      held[i] += inside;
    }
    CHECK(owners == 1);
  }
  const std::size_t count = dataset.points.position.size();
  std::size_t held_out = 0;
  for (std::size_t i = 0; i < plan.size(); ++i) {
    CHECK(held[i] == Approx(static_cast<double>(count) / 6).epsilon(0.05));
    CHECK(plan[i].points.size() > held[i]);
    const double share = static_cast<double>(plan[i].points.size()) / static_cast<double>(count);
    CHECK(plan[i].gaussians == Approx(share * static_cast<double>(count)).margin(1));
    CHECK(plan[i].train_views >= 5);
    held_out += plan[i].views.size() - plan[i].train_views;
    CHECK(plan[i].views.size() < dataset.views.size());
    CHECK(std::ranges::is_sorted(plan[i].views));
  }
  CHECK(held_out > 0);
}

TEST_CASE("cameras belong to the blocks that they see, at least and at most so many", "[blocks]") {
  const tg::Dataset dataset = city();
  tg::BlockOptions wanted = options(3, 3);
  wanted.least = 1;
  const std::vector<tg::PlannedBlock> plan = tg::planBlocks(dataset, kUp, wanted);
  // Each camera of the sample looks at one cell of the grid: the block there has it, but where it sees more of others.
  std::size_t had = 0;
  for (std::size_t view = 0; view < dataset.views.size(); ++view) {
    const tg::Camera& camera = dataset.views[view];
    const glm::dvec3 ahead = glm::transpose(camera.rotation) * glm::dvec3(0, 0, 1);
    const glm::dvec3 target = camera.position() + 4.5 * ahead;
    for (const tg::PlannedBlock& block : plan) {
      had += block.block.cell.contains(target) && std::ranges::binary_search(block.views, view);
    }
  }
  CHECK(had > dataset.views.size() * 3 / 4);
  wanted.least = wanted.most = 20;
  for (const tg::PlannedBlock& block : tg::planBlocks(dataset, kUp, wanted)) CHECK(block.train_views == 20);
  wanted.least = 1;
  wanted.most = 3;
  for (const tg::PlannedBlock& block : tg::planBlocks(dataset, kUp, wanted)) CHECK(block.train_views == 3);
}

TEST_CASE("a plan is the same every time, for any number of threads, and written once", "[blocks]") {
  const tg::TemporaryFolder folder;
  tg::writeSample(folder / "city", kCity, false);
  tg::DatasetOptions loading;
  loading.cameras_only = true;
  const tg::Dataset dataset = tg::loadDataset(folder / "city", loading);
  tg::setThreadCount(1);
  tg::writePlan(folder / "one", folder / "city", dataset, tg::planBlocks(dataset, kUp, options(2, 2)));
  tg::setThreadCount(3);
  tg::writePlan(folder / "two", folder / "city", dataset, tg::planBlocks(dataset, kUp, options(2, 2)));
  tg::setThreadCount(0);
  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder / "one")) {
    if (!entry.is_regular_file()) continue;
    const fs::path other = folder / "two" / fs::relative(entry.path(), folder / "one");
    CHECK(tg::readFile(entry.path(), 1 << 24) == tg::readFile(other, 1 << 24));
    ++files;
  }
  CHECK(files == 1 + 4 * 2);
  CHECK_THAT(tg::test::messageOf([&] { tg::writePlan(folder / "one", folder / "city", dataset, {}); },
                                 tg::ErrorKind::cannotWrite),
             Contains("one: exists already, and is not empty"));

  // A block is a data set: its photographs, the same ones held out, its points.
  const tg::Dataset block = tg::loadDataset(folder / "one/block_0_1");
  REQUIRE(block.block);
  CHECK(block.block->name == "block_0_1");
  CHECK(block.views.size() < dataset.views.size());
  CHECK(block.points.position.size() < dataset.points.position.size());
  for (std::size_t i = 0; i < block.views.size(); ++i) {
    const auto at = std::ranges::find(dataset.files, block.files[i]) - dataset.files.begin();
    REQUIRE(static_cast<std::size_t>(at) < dataset.files.size());
    CHECK(block.views[i].test == dataset.views[static_cast<std::size_t>(at)].test);
    CHECK(block.views[i].position() == dataset.views[static_cast<std::size_t>(at)].position());
  }
  loading.validation = true;
  CHECK(tg::loadDataset(folder / "one/block_0_1", loading).validation);
  fs::remove(folder / "city" / block.files.front());
  CHECK_THAT(tg::test::messageOf([&] { tg::loadDataset(folder / "one/block_0_1"); }),
             Contains("block.json: names 1 photographs that ") && Contains("lacks (the first: "));
  fs::remove(folder / "one/block_1_1/points3d.ply");
  CHECK_THROWS_AS(tg::loadDataset(folder / "one/block_1_1"), tg::Error);
}

TEST_CASE("as few blocks as the memory allows", "[blocks]") {
  const tg::Dataset dataset = city();
  tg::BlockOptions wanted;
  wanted.least = 5;
  wanted.gaussians = 1'000'000;
  wanted.memory = std::uint64_t{8} << 30;
  CHECK(tg::planBlocks(dataset, kUp, wanted).size() == 1);
  wanted.memory = std::uint64_t{1} << 30;
  const std::vector<tg::PlannedBlock> plan = tg::planBlocks(dataset, kUp, wanted);
  CHECK(plan.size() > 4);
  for (const tg::PlannedBlock& block : plan) CHECK(block.memory <= wanted.memory);
  // Twice as many without textures take no more than as many with them; four times as many do.
  wanted.grown = [](std::size_t gaussians) { return 2 * gaussians; };
  CHECK(tg::planBlocks(dataset, kUp, wanted).size() == plan.size());
  wanted.grown = [](std::size_t gaussians) { return 4 * gaussians; };
  const std::vector<tg::PlannedBlock> smaller = tg::planBlocks(dataset, kUp, wanted);
  CHECK(smaller.size() > plan.size());
  for (const tg::PlannedBlock& block : smaller) CHECK(block.memory <= wanted.memory);
  wanted.memory = 1 << 20;
  const std::string refused = tg::test::messageOf([&] { tg::planBlocks(dataset, kUp, wanted); }, tg::ErrorKind::usage);
  const std::string begin = "--memory: no grid of blocks fits into it (expected at least ";
  REQUIRE_THAT(refused, Catch::Matchers::StartsWith(begin) && Contains(" GB, found 1.0 MB)"));
  wanted.memory = static_cast<std::uint64_t>(std::lround(std::stod(refused.substr(begin.size())) * 100)) * 10'000'000;
  CHECK_NOTHROW(tg::planBlocks(dataset, kUp, wanted));
  wanted.memory -= 20'000'000;
  CHECK_THROWS(tg::planBlocks(dataset, kUp, wanted));
  CHECK(tg::memoryText(50, false) == "50 bytes");
  CHECK(tg::memoryText(1000, false) == "1.0 KB");
  CHECK(tg::memoryText(100'001) == "0.2 MB");
  CHECK(tg::memoryText(99'900'001) == "100.0 MB");
  CHECK(tg::memoryText(100'000'001) == "0.11 GB");
  CHECK(tg::memoryText(7'100'000'000) == "7.10 GB");
}

TEST_CASE("what cannot be cut is said in a line", "[blocks]") {
  tg::Dataset dataset = city();
  CHECK_THAT(tg::test::messageOf([&] { tg::planBlocks(dataset, kUp, options(128, 128)); }, tg::ErrorKind::usage),
             Contains("--blocks: more cells than points"));
  std::erase_if(dataset.views, [](const tg::Camera& camera) { return camera.position().x > 0 || camera.test; });
  for (tg::Camera& camera : dataset.views) camera.size /= 8;
  for (tg::Camera& camera : dataset.views) camera.center = {1e5, 1e5};
  CHECK_THAT(tg::test::messageOf([&] { tg::planBlocks(dataset, kUp, options(2, 2)); }),
             Contains("city: block_0_0 has no cameras: no training view sees its points"));
  std::ranges::fill(dataset.points.position, glm::vec3(1.0f));
  CHECK_THAT(tg::test::messageOf([&] { tg::planBlocks(dataset, kUp, options(2, 2)); }),
             Contains("its points lie on a line or at one place"));
  dataset.points = {};
  CHECK_THAT(tg::test::messageOf([&] { tg::planBlocks(dataset, kUp, options(2, 2)); }), Contains("has no points"));
  CHECK(tg::upOfPoints({{{0, 0, 0}, {9, 0, 1}, {0, 9, 0}, {9, 9, 1}}, {}}) == kUp);
}

TEST_CASE("a view is at a seam when it sees several cells", "[blocks]") {
  const tg::Dataset dataset = city();
  const std::vector<tg::PlannedBlock> plan = tg::planBlocks(dataset, kUp, options(2, 1));
  const std::vector<tg::SceneBlock> blocks = {plan[0].block, plan[1].block};
  const std::vector<bool> at_seams = tg::viewsAtSeams(dataset, blocks);
  // The two cells share the middle column, at which a third of the cameras look.
  const auto seams = std::ranges::count(at_seams, true);
  CHECK(seams >= 18);
  CHECK(seams < 54);
  CHECK(std::ranges::count(
            tg::viewsAtSeams(dataset, std::vector{tg::SceneBlock{"all", plan[0].block.cell.padded(1e9), 0}}), true) ==
        0);
}
