// SPDX-License-Identifier: Apache-2.0
// A scene in blocks from one end to the other: split, farm, merge-blocks, seams.
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/bundle/blocks.h"
#include "core/bundle/bundle.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/child.h"

namespace fs = std::filesystem;
using namespace tg::test;

namespace {

const std::string kCity =
    "make-sample city --grid 2 --size 24 --views 24 --test-views 8 --points 800 --supersampling 1";
const std::string kTrain = "--iterations 12 --texture-iterations 4 --densification none ";

Outcome program(const tg::TemporaryFolder& folder, const std::string& name, const std::string& arguments) {
  return run(folder, "'" + name + "' " + arguments);
}

}  // namespace

TEST_CASE("a scene that has reduced photographs alone is split and trained from them", "[blocks]") {
  const tg::TemporaryFolder folder;
  REQUIRE(
      tgtrain(folder, "make-sample sample --size 24 --views 8 --test-views 1 --points 200 --supersampling 1").code ==
      0);
  REQUIRE(tgtrain(folder, "undistort sample city").code == 0);
  fs::rename(folder / "city/images", folder / "city/images_2");
  const std::string split = "split city blocks --blocks 1x1 --gaussians 50";
  const Outcome without = program(folder, TG_TGTRAIN, split);
  CHECK(without.code == 3);
  CHECK_THAT(without.output, Contains("--image-folder names another folder"));
  const Outcome twice =
      program(folder, TG_TGTRAIN, split + " --image-folder images_2 --train '--image-folder images_4'");
  CHECK(twice.code == 1);
  CHECK_THAT(twice.output, Contains("--image-folder is split's own to choose"));
  const Outcome made = program(folder, TG_TGTRAIN, split + " --image-folder images_2 --train '" + kTrain + "'");
  INFO(made.output);
  REQUIRE(made.code == 0);
  CHECK_THAT(contents(folder / "blocks/jobs.jsonl"), Contains("\"--image-folder\",\"images_2\""));
  const Outcome farm = tgtrain(folder, "farm blocks/jobs.jsonl --out farm");
  INFO(farm.output);
  CHECK(farm.code == 0);
}

TEST_CASE("a scene is split, trained by a farm around a context, and merged, and its seams are scored", "[blocks]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kCity).code == 0);
  REQUIRE(tgtrain(folder, "city -o coarse.tgz --gaussians 60 --texture-mode none " + kTrain).code == 0);
  const Outcome split =
      program(folder, TG_TGTRAIN,
              "split city blocks --blocks 2x1 --gaussians 400 --context coarse.tgz --train '" + kTrain + "'");
  INFO(split.output);
  REQUIRE(split.code == 0);
  CHECK_THAT(split.output, Contains("block_0_0: ") && Contains(" MB\n") && Contains("wrote 2 blocks to blocks"));
  CHECK_THAT(contents(folder / "blocks/jobs.jsonl"), Contains("\"--context\",\"../coarse.tgz\""));
  for (const auto& [train, why] : std::initializer_list<std::pair<std::string, std::string>>{
           {"--gausians 3", "no such option: --gausians (did you mean --gaussians?)"},
           {"--iterations 3 --seed", "--seed: expected a value, found none"},
           {"--layout colmap", "--layout is split's own to choose"},
           {"--points p.ply", "--points is split's own to choose"},
           {"--start-model m.tgz", "--start-model is split's own to choose"},
           {"elsewhere", "unexpected argument: elsewhere"},
           {"-h", "no such option: -h"},
           {"--iterations many", "--iterations"}}) {
    const Outcome refused = program(folder, TG_TGTRAIN, "split city no --blocks 2x1 --train '" + train + "'");
    INFO(refused.output);
    CHECK(refused.code == 1);
    CHECK_THAT(refused.output, Contains("--train: ") && Contains(why));
    CHECK_FALSE(fs::exists(folder / "no"));
  }
  // What grows before it is merged counts where the jobs merge.
  int splits = 0;
  const auto wanted = [&](const std::string& train) {
    const std::string name = "split_" + std::to_string(++splits);
    const Outcome outcome =
        program(folder, TG_TGTRAIN, "split city " + name + " --memory 700KB --gaussians 100 --train '" + train + "'");
    INFO(outcome.output);
    REQUIRE(outcome.code == 0);
    return tg::readBlocks(folder / name).size();
  };
  const std::size_t swapping = wanted("--limit-by swap");
  for (const std::string train :
       {"--limit-by=room", "--preset paper", "--densification mcmc", "--densify-until 7000"}) {
    CHECK(wanted(train) == swapping);
  }
  const std::size_t merging = wanted("--iterations 100");
  CHECK(merging > swapping);
  CHECK(wanted("--limit-by merge") == merging);

  const Outcome farm = tgtrain(folder, "farm blocks/jobs.jsonl --out farm");
  INFO(farm.output);
  REQUIRE(farm.code == 0);

  const Outcome merged = program(folder, TG_TGCONVERT, "merge-blocks blocks farm/results city.tgz");
  INFO(merged.output);
  REQUIRE(merged.code == 0);
  const std::vector<tg::SceneBlock> blocks = tg::readBlocks(folder / "blocks");
  const tg::Bundle whole = tg::readBundle(folder / "city.tgz");
  std::size_t expected = 0;
  for (const tg::SceneBlock& block : blocks) {
    const tg::Bundle part = tg::readBundle(folder / "farm/results" / block.name / "model.tgz");
    const auto inside = std::ranges::count_if(
        part.model.mean, [&](const glm::vec3& mean) { return block.cell.contains(glm::dvec3(mean)); });
    CHECK(static_cast<std::size_t>(inside) < part.model.size());
    expected += static_cast<std::size_t>(inside);
  }
  CHECK(whole.model.size() == expected);
  CHECK(whole.model.atlas.rects.size() == expected);
  CHECK(whole.cameras.size() == 32);
  CHECK_THAT(merged.output, !Contains("and its padding"));
  fs::create_directory(folder / "mixed");
  for (const char* name : {"mixed/block_0_0.tgz", "mixed/block_1_0.tgz"}) {
    fs::copy(folder / "farm/results/block_1_0/model.tgz", folder / name);
  }
  const Outcome mixed = program(folder, TG_TGCONVERT, "merge-blocks blocks mixed mixed.tgz");
  CHECK(mixed.code == 0);
  CHECK_THAT(mixed.output, Contains("warning: mixed/block_0_0.tgz: lies outside of block_0_0 and its padding, more of "
                                    "it in those of block_1_0 (is it the model of another block or scene?)"));
  CHECK_THAT(merged.output, Contains("wrote city.tgz: " + std::to_string(expected) + " Gaussians"));

  const Outcome seams =
      program(folder, TG_TGEVAL, "city.tgz city --blocks blocks --whole coarse.tgz --json seams.json");
  INFO(seams.output);
  REQUIRE(seams.code == 0);
  CHECK_THAT(seams.output, Contains("at seams: ") && Contains("inside blocks: ") && Contains("; unsplit "));
  const nlohmann::json json = nlohmann::json::parse(contents(folder / "seams.json"));
  const nlohmann::json& at = json["blocks"]["at_seams"];
  const nlohmann::json& inside = json["blocks"]["inside"];
  CHECK(at["views"].get<int>() + inside["views"].get<int>() == 8);
  CHECK(at["unsplit_psnr"].is_number());

  // The context is part of what a run is.
  REQUIRE(tgtrain(folder, "blocks/block_0_0 --run run " + kTrain + "-q").code == 0);
  const Outcome other = tgtrain(folder, "blocks/block_0_0 --run run --resume --context coarse.tgz " + kTrain);
  CHECK(other.code == 1);
  CHECK_THAT(other.output, Contains("other data"));

  // What is not there, or cut short.
  const auto refused = [&](const std::string& name, const std::string& arguments, int code, const std::string& words) {
    const Outcome outcome = program(folder, name, arguments);
    INFO(arguments << '\n' << outcome.output);
    CHECK(outcome.code == code);
    CHECK_THAT(outcome.output, Contains(words));
    CHECK(std::ranges::count(outcome.output, '\n') == 1);
  };
  refused(TG_TGCONVERT, "merge-blocks blocks farm/results city.tgz", 4, "city.tgz: exists already");
  refused(TG_TGCONVERT, "merge-blocks blocks blocks new.tgz", 2, "block_0_0/model.tgz: the block's model is not there");
  refused(TG_TGCONVERT, "merge-blocks farm farm/results new.tgz", 2, "farm/blocks.json: cannot open");
  refused(TG_TGCONVERT, "in.ply merge-blocks blocks blocks new.tgz", 1, "\"in.ply\" does nothing before merge-blocks");
  fs::resize_file(folder / "farm/results/block_1_0/model.tgz", 900);
  refused(TG_TGCONVERT, "merge-blocks blocks farm/results new.tgz", 3, "block_1_0/model.tgz: ");
  CHECK_FALSE(fs::exists(folder / "new.tgz"));
  refused(TG_TGTRAIN, "split city blocks --blocks 2x2", 4, "blocks: exists already, and is not empty");
  refused(TG_TGTRAIN, "split city new", 1, "expected --blocks NxM or --memory SIZE");
  refused(TG_TGTRAIN, "split city new --blocks 1x1 --gaussians 65000000", 1, "too many Gaussians for one training");
  refused(TG_TGTRAIN, "split city new --blocks 2x2 --least-cameras 9 --most-cameras 8", 1,
          "--least-cameras is more than --most-cameras (expected at most 8, found 9)");
  refused(TG_TGTRAIN, "split city new --memory 1KB", 1, " MB, found 1.0 KB)");
  refused(TG_TGTRAIN, "split city new --blocks 2y2", 1, "--blocks: expected columns x rows");
  refused(TG_TGTRAIN, "split city new --blocks 2x2 --train '-o x'", 1, "is the farm's own");
  refused(TG_TGTRAIN, "split city new --blocks 2x2 --train '--target-size=25KB'", 1, "--target-size is for one file");
  refused(TG_TGTRAIN, "split city new --blocks 2x2 --train '--gaussians 9'", 1, "--gaussians is split's own");
  refused(TG_TGTRAIN, "split city new --memory 1GB --train '--image-memory 9'", 1, "--image-memory is split's own");
  refused(TG_TGTRAIN, "split blocks/block_0_0 new --blocks 2x2", 3, "is a block already");
  refused(TG_TGTRAIN, "split absent new --blocks 2x2", 2, "absent: no such folder");
  refused(TG_TGEVAL, "city.tgz city --whole coarse.tgz", 1, "--whole: is compared at seams");
  fs::create_directories(folder / "elsewhere/blocks");
  fs::copy(folder / "blocks/block_0_0", folder / "elsewhere/blocks/block_0_0");
  refused(TG_TGTRAIN, "elsewhere/blocks/block_0_0 -o new.tgz", 2,
          "block_0_0/block.json: its data set ../../city is not there");
  fs::resize_file(folder / "blocks/block_0_0/block.json", 300);
  refused(TG_TGTRAIN, "blocks/block_0_0 -o new.tgz", 3, "block.json: not valid JSON");
}
