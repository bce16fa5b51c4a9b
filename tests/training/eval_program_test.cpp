// SPDX-License-Identifier: Apache-2.0
// tgeval as users meet it: what it writes, what it refuses, and how it ends early.
#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"
#include "core/bundle/training_json.h"
#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/image/image.h"
#include "core/model/model.h"
#include "core/system/numbers.h"
#include "program.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/data/sample.h"
#include "training/run/init.h"

namespace fs = std::filesystem;
using tg::test::Outcome;
using tg::test::run;

namespace {

Outcome tgeval(const tg::TemporaryFolder& folder, const std::string& arguments) {
  return run(folder, "'" TG_TGEVAL "' " + arguments);
}

nlohmann::json readJson(const fs::path& path) {
  const std::vector<std::uint8_t> bytes = tg::readFile(path, 1 << 24);
  return nlohmann::json::parse(bytes.begin(), bytes.end());
}

// A data set and a model that was not trained: its first Gaussians.
void writeScene(const tg::TemporaryFolder& folder, int test_views) {
  const tg::SampleOptions options{
      .size = 32, .train_views = 2, .test_views = test_views, .points = 200, .supersampling = 1};
  tg::writeSample(folder / "scene", options, false);
  tg::writeSplatPly(folder / "model.ply", tg::gaussiansFromPoints(tg::samplePoints(options)));
}

}  // namespace

TEST_CASE("tgeval writes numbers, pictures and comparisons", "[programs]") {
  const tg::TemporaryFolder folder;
  writeScene(folder, 2);
  const Outcome outcome =
      tgeval(folder, "model.ply scene --json s.json --images pictures --side-by-side both --effective-rank");
  INFO(outcome.output);
  REQUIRE(outcome.code == 0);
  CHECK_THAT(outcome.output, Contains("PSNR [dB]") && Contains("FLIP") && Contains("effective rank"));
  const nlohmann::json json = readJson(folder / "s.json");
  CHECK(json["format"] == "tgeval");
  CHECK(json["version"] == 1);
  CHECK(json["interrupted"] == false);
  CHECK(json["views"].size() == 2);
  CHECK_THAT(json["device"].get<std::string>(), Contains("CPU, "));
  const std::size_t gaussians = tg::readSplatPly(folder / "model.ply").size();
  CHECK(json["gaussians"] == gaussians);
  CHECK(json["parameters"] == gaussians * 14);  // degree 0
  CHECK(json["bytes"] == fs::file_size(folder / "model.ply"));
  CHECK(json["flip"].get<double>() > 0);
  CHECK(json["effective_rank"]["round"] == 1.0);  // the first Gaussians are balls
  CHECK(tg::readImage(folder / "pictures/r_1.png").width == 32);
  CHECK(tg::readImage(folder / "both/r_1.png").width == 3 * 32 + 8);
  for (const char* name : {"pictures/r_1.png", "both/r_1.png"})
    CHECK(tg::isDrawn(tg::readFile(folder / name, 1 << 20)));

  const Outcome kept = tgeval(folder, "model.ply scene --side-by-side both");
  CHECK(kept.code == 4);
  CHECK_THAT(kept.output, Contains("both/r_0.png: exists already"));
  CHECK(tgeval(folder, "model.ply scene --side-by-side both --images both/").code == 1);
  std::filesystem::create_directory_symlink("both", folder / "link");
  CHECK(tgeval(folder, "model.ply scene --side-by-side both --images link").code == 1);
  CHECK(tgeval(folder, "model.ply scene --background random").code == 1);
  CHECK(tgeval(folder, "model.ply scene --lpips model.ply").code == 3);
  CHECK(tgeval(folder, "model.ply scene --lpips absent").code == 2);
  CHECK(tgeval(folder, "model.ply").code == 1);

  const Outcome shapes = tgeval(folder, "model.ply --effective-rank --json shapes.json");
  INFO(shapes.output);
  CHECK(shapes.code == 0);
  CHECK_FALSE(readJson(folder / "shapes.json").contains("psnr"));
}

TEST_CASE("with --json - standard output holds the JSON alone", "[programs]") {
  const tg::TemporaryFolder folder;
  writeScene(folder, 2);
  const auto said = [&](const std::string& program, const std::string& arguments) {
    const Outcome outcome = run(folder, "'" + program + "' " + arguments + " --json - 2>said.txt");
    INFO(arguments << ": " << outcome.output);
    CHECK(outcome.code == 0);
    CHECK_FALSE(fs::exists(folder / "-"));
    REQUIRE(nlohmann::json::accept(outcome.output));
    return nlohmann::json::parse(outcome.output);
  };
  CHECK(said(TG_TGEVAL, "model.ply scene --effective-rank")["views"].size() == 2);
  const std::string train = "scene --iterations 2 --texture-iterations 2 --texture-size 2 --run run -o ";
  CHECK(said(TG_TGTRAIN, train + "model.tgz")["format"] == "tgtrain-training");
  CHECK(said(TG_TGTRAIN, train + "model.tgz --resume --serve 0")["format"] == "tgtrain-training");
  CHECK_THAT(run(folder, "cat said.txt").output, Contains("serving http://"));
  CHECK_THAT(tgeval(folder, "model.ply scene --json - --overwrite").output,
             Contains("--overwrite: replaces files (expected an output with it)"));
}

TEST_CASE("tgeval tells of a model of other photographs, or of others' size", "[programs]") {
  const tg::TemporaryFolder folder;
  const auto tgtrain = [&](const std::string& arguments) { return run(folder, "'" TG_TGTRAIN "' " + arguments); };
  tg::SampleOptions sample{.size = 32, .train_views = 4, .test_views = 2, .points = 200, .supersampling = 1};
  tg::writeSample(folder / "scene", sample, false);
  sample.train_views = 7;
  sample.test_views = 3;
  tg::writeSample(folder / "other", sample, false);
  const std::string train = "scene --iterations 4 --texture-mode none -q -o ";
  REQUIRE(tgtrain(train + "model.tgz").code == 0);
  CHECK(tgeval(folder, "model.tgz scene -q").output.empty());
  CHECK(tgeval(folder, "model.tgz scene -q --split train").output.empty());
  const Outcome smaller = tgeval(folder, "model.tgz scene --downscale 2");
  CHECK(smaller.code == 0);
  CHECK_THAT(
      smaller.output,
      Contains("tgeval: model.tgz: was trained on photographs of 32 x 32, and is scored on 16 x 16 (--downscale)\n"));
  std::filesystem::copy(folder / "scene", folder / "swapped", std::filesystem::copy_options::recursive);
  std::filesystem::rename(folder / "swapped/transforms_train.json", folder / "swapped/was_train.json");
  std::filesystem::rename(folder / "swapped/transforms_test.json", folder / "swapped/transforms_train.json");
  std::filesystem::rename(folder / "swapped/was_train.json", folder / "swapped/transforms_test.json");
  CHECK_THAT(tgeval(folder, "model.tgz swapped").output,
             Contains("tgeval: model.tgz: was trained on 4 of the 4 test views (--test-every)\n"));
  const Outcome other = tgeval(folder, "model.tgz other --report figures");
  CHECK(other.code == 0);
  CHECK_THAT(
      other.output,
      Contains("tgeval: model.tgz: none of its 6 cameras is among the views of other: was it trained on others?\n"));
  CHECK(tgeval(folder, "model.tgz other -q").output.empty());
  CHECK(tgeval(folder, "model.tgz other -q --report more").output.empty());
  REQUIRE(tgtrain(train + "choice.tgz --validation").code == 0);
  CHECK(tgeval(folder, "choice.tgz scene -q").output.empty());
  const Outcome moved = tgtrain(train + "moved.tgz --normalize");
  REQUIRE(moved.code == 0);
  CHECK_THAT(moved.output,
             Contains("scene: normalized: ") && Contains(" (tgconvert brings a model back with --scale "));
  const std::string with = "was trained with --normalize, and the data set is read without it";
  const std::string without = "was trained without --normalize, and the data set is read with it";
  CHECK_THAT(tgeval(folder, "moved.tgz scene").output,
             Contains("tgeval: moved.tgz: " + with + "\n") && !Contains("none of its"));
  CHECK_THAT(tgeval(folder, "moved.tgz scene --normalize").output,
             !Contains("none of its") && !Contains("was trained"));
  CHECK_THAT(tgeval(folder, "model.tgz scene --normalize").output, Contains("tgeval: model.tgz: " + without + "\n"));

  const Outcome from_moved = tgtrain(train + "on.tgz --start-model moved.tgz");
  CHECK(from_moved.code == 1);
  CHECK(from_moved.output == "tgtrain: moved.tgz: " + with + " (expected both of one world)\n");
  const Outcome from_there = tgtrain(train + "on.tgz --normalize --start-model model.tgz");
  CHECK(from_there.code == 1);
  CHECK(from_there.output == "tgtrain: model.tgz: " + without + " (expected both of one world)\n");
  CHECK(tgtrain(train + "on.tgz --normalize --start-model moved.tgz").code == 0);

  // The record says the way back, as the line printed does.
  const tg::Bundle bundle = tg::readBundle(folder / "moved.tgz");
  const auto known = tg::normalizationOf(bundle.training_json);
  REQUIRE((known && *known));
  const glm::dvec3 origin = (*known)->origin;
  const std::string back = " --scale " + tg::numberText(1 / (*known)->scale) + " --translate " +
                           tg::numberText(origin.x) + "," + tg::numberText(origin.y) + "," + tg::numberText(origin.z);
  CHECK_THAT(moved.output, Contains("(tgconvert brings a model back with" + back + ")"));
  REQUIRE(run(folder, "'" TG_TGCONVERT "' moved.tgz home.tgz" + back).code == 0);
  CHECK_THAT(tgeval(folder, "home.tgz scene").output, !Contains("none of its") && !Contains("was trained"));
}

TEST_CASE("tgeval draws beyond textures what it is told to, and says so", "[programs]") {
  const tg::TemporaryFolder folder;
  writeScene(folder, 1);
  tg::Bundle bundle;
  bundle.model = tg::readSplatPly(folder / "model.ply");
  bundle.model.texture_mode = tg::TextureMode::rgba;
  std::fill(bundle.model.opacity_logit.begin(), bundle.model.opacity_logit.end(), 6.0f);
  for (std::uint32_t i = 0; i < bundle.model.size(); ++i) {
    bundle.model.atlas.rects.push_back({i, 1, 1});
    bundle.model.atlas.texels.emplace_back(0.3f, 0.1f, -0.1f, 0.9f);
  }
  bundle.model.outside = tg::TextureOutside::clip;
  tg::writeBundle(folder / "clip.tgz", bundle);
  REQUIRE(tgeval(folder, "clip.tgz scene --json own.json").code == 0);
  REQUIRE(tgeval(folder, "clip.tgz scene --json clip.json --outside clip").code == 0);
  REQUIRE(tgeval(folder, "clip.tgz scene --json base.json --outside base").code == 0);
  const nlohmann::json own = readJson(folder / "own.json"), base = readJson(folder / "base.json");
  CHECK_FALSE(own.contains("outside"));
  CHECK(base["outside"] == "base");
  CHECK(own["psnr"] == readJson(folder / "clip.json")["psnr"]);
  CHECK(own["psnr"] != base["psnr"]);
  const Outcome wrong = tgeval(folder, "clip.tgz scene --outside skip");
  CHECK(wrong.code == 1);
  CHECK_THAT(wrong.output, Contains("--outside: expected base, clip or edge, found \"skip\""));
}

TEST_CASE("tgeval leaves masked pixels out, and says that there are masks", "[programs]") {
  const tg::TemporaryFolder folder;
  writeScene(folder, 1);
  tg::Image photograph = tg::readImage(folder / "scene/test/r_0.png");
  REQUIRE(tgeval(folder, "model.ply scene --json whole.json").code == 0);
  tg::Image mask(32, 32, 1, 1.0f);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 16; ++x) mask.at(x, y, 0) = 0;
  }
  fs::create_directories(folder / "scene/masks/test");
  tg::writeImage(folder / "scene/masks/test/r_0.png", mask);
  const Outcome masked = tgeval(folder, "model.ply scene --json masked.json");
  CHECK_THAT(masked.output, Contains("scene: 1 of 1 photographs have a mask"));
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 16; ++x) photograph.at(x, y, 0) = 1 - photograph.at(x, y, 0);
  }
  tg::writeImage(folder / "scene/test/r_0.png", photograph);
  REQUIRE(tgeval(folder, "model.ply scene --json changed.json").code == 0);
  CHECK(readJson(folder / "changed.json")["views"] == readJson(folder / "masked.json")["views"]);
  CHECK(readJson(folder / "whole.json")["views"] != readJson(folder / "masked.json")["views"]);
}

TEST_CASE("an interrupt ends tgeval after the current view, with what was scored", "[programs]") {
  const tg::TemporaryFolder folder;
  writeScene(folder, 400);
  const Outcome outcome = run(folder, "'" TG_TGEVAL
                                      "' model.ply scene --images out --json s.json & "
                                      "until [ -e out/r_0.png ]; do sleep 0.01; done; kill -TERM $!; wait $!");
  INFO(outcome.output);
  CHECK(outcome.code == 128 + 15);
  CHECK_THAT(outcome.output, Contains("interrupted: ") && Contains("of 400 views were scored"));
  const nlohmann::json json = readJson(folder / "s.json");
  CHECK(json["interrupted"] == true);
  CHECK(json["views"].size() >= 1);
  CHECK(json["views"].size() < 400);
  CHECK(json["psnr"].get<double>() > 0);
}

TEST_CASE("tgeval compares several models on several data sets in a report, the same bytes for any number of threads",
          "[programs]") {
  const tg::TemporaryFolder folder;
  writeScene(folder, 2);
  tg::Bundle bundle;
  bundle.model = tg::readSplatPly(folder / "model.ply");
  bundle.model.texture_mode = tg::TextureMode::rgba;
  for (std::uint32_t i = 0; i < bundle.model.size(); ++i) {
    bundle.model.atlas.rects.push_back({i, 1, 1});
    bundle.model.atlas.texels.emplace_back(0.1f, 0.0f, -0.1f, 0.9f);
  }
  bundle.background = glm::vec3(1);
  tg::writeBundle(folder / "textured.tgz", bundle);
  fs::create_directory(folder / "other");
  fs::copy(folder / "model.ply", folder / "other/model.ply");
  fs::copy(folder / "scene", folder / "second", fs::copy_options::recursive);
  const std::string command =
      "model.ply textured.tgz scene model.ply other/model.ply second --crop 4,4,8,8@r_1 --crops 1";
  const Outcome outcome = tgeval(folder, command + " --report a --threads 1");
  INFO(outcome.output);
  REQUIRE(outcome.code == 0);
  CHECK_THAT(outcome.output, Contains("scene, test split, 2 views") && Contains("base only"));
  const auto bytes = [&](const std::string& name) {
    const std::vector<std::uint8_t> data = tg::readFile(folder / name, 1 << 24);
    return std::string(data.begin(), data.end());
  };
  const std::string csv = bytes("a/results.csv");
  CHECK_THAT(csv, Contains("scene,test,textured,texture only,2,") && Contains("second,test,model,full,2,") &&
                      Contains("second,test,other/model,full,2,"));
  REQUIRE(tgeval(folder, "model.ply scene --json s.json").code == 0);
  CHECK_THAT(csv, Contains("scene,test,model,full,2," + readJson(folder / "s.json")["psnr"].dump().substr(0, 12)));
  CHECK(tg::readImage(folder / "a/crops/1-1-model-2.png").width == 8);
  CHECK(tg::readImage(folder / "a/crops/2-2-flip-2.png").width == 16);

  REQUIRE(tgeval(folder, command + " --report b --threads 2").code == 0);
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder / "a")) {
    if (!entry.is_regular_file()) continue;
    const std::string name = entry.path().lexically_relative(folder / "a").string();
    INFO(name);
    CHECK(bytes("a/" + name) == bytes("b/" + name));
    CHECK(bytes("a/" + name).find(folder.path.string()) == std::string::npos);
  }

  const auto refuses = [&](const std::string& arguments, int code, const std::string& words) {
    const Outcome refused = tgeval(folder, arguments);
    INFO(arguments << ": " << refused.output);
    CHECK(refused.code == code);
    CHECK_THAT(refused.output, Contains(words));
    CHECK(std::count(refused.output.begin(), refused.output.end(), '\n') == 1);
  };
  refuses("model.ply scene --report a", 4, "a: exists already (--overwrite replaces it)");
  refuses("model.ply textured.tgz scene", 1, "textured.tgz: is a second model (expected --report with several)");
  refuses("model.ply scene second --report c", 1, "second: is a folder without a model before it");
  refuses("scene model.ply --report c", 1, "scene: is a folder without a model before it");
  refuses("model.ply --report c", 1, "model.ply: has no data set after it");
  refuses("model.ply scene --report c --label a --label b", 1,
          "--label: expected one for each model (expected 1, found 2)");
  refuses("model.ply scene --report c --crop 0,0,99,99", 1, "--crop 0,0,99,99: no view holds it");
  refuses("model.ply scene --report c --crop 1,2", 1, "--crop: expected x,y,w,h");
  CHECK_FALSE(fs::exists(folder / "c"));
}

TEST_CASE("an interrupted report is of what was scored, and says so", "[programs]") {
  const tg::TemporaryFolder folder;
  writeScene(folder, 400);
  const Outcome outcome = run(folder, "'" TG_TGEVAL
                                      "' model.ply scene --report r --crop 0,0,4,4@r_399 --threads 1 & "
                                      "for i in $(seq 1000); do grep -Eq '^SigCgt:.[0-9a-f]{12}[4-7c-f]' "
                                      "/proc/$!/status && break; sleep 0.01; done; kill -TERM $!; wait $!");
  INFO(outcome.output);
  CHECK(outcome.code == 128 + 15);
  CHECK_THAT(outcome.output, Contains("interrupted: "));
  const std::vector<std::uint8_t> page = tg::readFile(folder / "r/index.html", 1 << 24);
  CHECK_THAT(std::string(page.begin(), page.end()), Contains("views of 400: interrupted"));
}

TEST_CASE("tgeval refuses flags that would do nothing", "[programs]") {
  const tg::TemporaryFolder folder;
  writeScene(folder, 1);
  const auto refuses = [&](const std::string& arguments, const std::string& words) {
    const Outcome refused = tgeval(folder, arguments);
    INFO(arguments << ": " << refused.output);
    CHECK(refused.code == 1);
    CHECK_THAT(refused.output, Contains(words));
  };
  refuses("model.ply scene --label x", "--label: is of a report (expected --report with it)");
  refuses("model.ply scene --crop 0,0,4,4", "--crop: is of a report");
  refuses("model.ply scene --crops 2", "--crops: is of a report");
  refuses("model.ply scene --lpips-range unit", "--lpips-range: says how (expected --lpips with it)");
  refuses("model.ply scene --overwrite", "--overwrite: replaces files (expected an output with it)");
  refuses("model.ply scene --report r --images i", "--images: is not of a report");
  refuses("model.ply --effective-rank --split train", "--split: is about photographs");
  refuses("model.ply --effective-rank --images i", "--images: is about photographs");
  refuses("model.ply --effective-rank --device cpu", "--device: is about photographs");
}
