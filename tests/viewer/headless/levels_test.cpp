// SPDX-License-Identifier: Apache-2.0
// tgview without a window on scenes with levels of detail.
#include <filesystem>

#include "converter/lod/write_lod.h"
#include "converter/registry/file_format.h"
#include "core/bundle/bundle.h"
#include "core/image/metrics.h"
#include "support/catch.h"
#include "viewer/levels.h"
#include "viewer/process.h"

using namespace tg;
using test::ProcessResult;
using test::Workshop;

namespace {

// The number before " Gaussians" of a line about a picture.
std::size_t gaussiansOf(const ProcessResult& result) {
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  const std::size_t end = result.out.find(" Gaussians");
  REQUIRE(end != std::string::npos);
  return std::stoul(result.out.substr(result.out.rfind(' ', end - 1) + 1));
}

}  // namespace

TEST_CASE("under a budget for all of it a scene with levels renders as the model of its finest level") {
  const Workshop shop;
  const LodScene scene = test::writeLevels(shop / "scene/lod-meta.json");
  writeBundle(shop / "finest.tgz", readModel(shop / "scene/lod-meta.json"));
  const std::string all = std::to_string(scene.counts.front());
  // Far enough that every leaf is in view, large enough that all are finest.
  const std::vector<std::string> flags = {"--backend", "cpu", "--size", "1200x900", "--camera", "1"};
  const auto render = [&](std::vector<std::string> more) {
    more.insert(more.end(), flags.begin(), flags.end());
    return gaussiansOf(shop.tgview(more));
  };
  CHECK(render({"scene/lod-meta.json", "--splat-budget", all, "--render", "levels.png"}) == scene.counts.front());
  CHECK(render({"finest.tgz", "--render", "plain.png"}) == scene.counts.front());
  CHECK(psnr8Bit(shop.read("levels.png"), shop.read("plain.png")) > 60);
}

TEST_CASE("a budget is obeyed by pictures, comparisons and every frame of a recording, the same each time") {
  const Workshop shop;
  const LodScene scene = test::writeLevels(shop / "scene/lod-meta.json");
  const std::size_t budget = 1000;
  REQUIRE(scene.counts.back() < budget);
  REQUIRE(scene.counts.front() > budget);
  const auto render = [&](const std::string& out) {
    return gaussiansOf(
        shop.tgview({"scene/lod-meta.json", "--splat-budget", "1000", "--render", out, "--backend", "cpu"}));
  };
  const std::size_t drawn = render("a.png");
  CHECK(drawn <= budget);
  CHECK(drawn > scene.counts.back());
  CHECK(render("b.png") == drawn);
  CHECK(shop.read("a.png").data == shop.read("b.png").data);
  const ProcessResult turn = shop.tgview({"scene/lod-meta.json", "--splat-budget", "1000", "--turntable", "3", "-o",
                                          "turn/####.png", "--backend", "cpu", "-q"});
  INFO(turn.err);
  REQUIRE(turn.exit_code == 0);
  CHECK(psnr8Bit(shop.read("turn/0000.png"), shop.read("a.png")) > 40);
  const ProcessResult compared =
      shop.tgview({"scene/lod-meta.json", "--splat-budget", "1000", "--compare", "scene/lod-meta.json",
                   "--compare-mode", "difference", "--render", "c.png", "--backend", "cpu"});
  INFO(compared.err);
  CHECK(compared.exit_code == 0);
  CHECK_THAT(compared.out, Contains("inf"));
}

TEST_CASE("a truncated file ends a picture with exit code 3, one line and nothing written, and a cut without it is drawn") {
  const Workshop shop;
  const LodScene scene = test::writeLevels(shop / "scene/lod-meta.json");
  const std::string broken = scene.files[scene.leaves[0].levels[0].file];
  std::filesystem::resize_file((shop / "scene" / broken).parent_path() / "scales.webp", 40);
  const auto render = [&](const std::string& budget) {
    return shop.tgview({"scene/lod-meta.json", "--splat-budget", budget, "--render", "a.png", "--size", "1200x900",
                        "--backend", "cpu"});
  };
  const ProcessResult whole = render(std::to_string(scene.counts.front()));
  CHECK(whole.exit_code == 3);
  CHECK(std::ranges::count(whole.err, '\n') == 1);
  CHECK_THAT(whole.err, Contains("scales.webp"));
  CHECK_FALSE(std::filesystem::exists(shop / "a.png"));
  CHECK(gaussiansOf(render(std::to_string(scene.counts.back()))) == scene.counts.back());
}

TEST_CASE("the flag --splat-budget is refused for what has no levels") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const ProcessResult result = shop.tgview({"model.tgz", "--render", "a.png", "--splat-budget", "5000"});
  CHECK(result.exit_code == 1);
  CHECK_THAT(result.err, Contains("--splat-budget"));
}
