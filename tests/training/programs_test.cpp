// SPDX-License-Identifier: Apache-2.0
// tgtrain and tgeval as users meet them: exit codes, messages, files that are never half written.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <tuple>
#include <vector>

#include "core/bundle/bundle.h"
#include "core/file/file.h"
#include "core/system/numbers.h"
#include "program.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/dataset_files.h"

namespace fs = std::filesystem;
using tg::test::missingMount;
using tg::test::mountOf;
using tg::test::Outcome;
using tg::test::run;

namespace {

Outcome tgtrain(const tg::TemporaryFolder& folder, const std::string& arguments) {
  return run(folder, "'" TG_TGTRAIN "' " + arguments);
}
Outcome tgeval(const tg::TemporaryFolder& folder, const std::string& arguments) {
  return run(folder, "'" TG_TGEVAL "' " + arguments);
}

const std::string kSample = "make-sample scene --size 32 --views 4 --test-views 2 --points 200 --supersampling 1";
const std::string kShort = " --iterations 6 --texture-iterations 4";

// What --json holds beside training.json.
nlohmann::json outputOf(const fs::path& file, const nlohmann::json& training) {
  const std::vector<std::uint8_t> bytes = tg::readFile(file, 1 << 20);
  nlohmann::json json = nlohmann::json::parse(bytes), output = json["output"];
  json.erase("output");
  CHECK(json == training);
  return output;
}

}  // namespace

TEST_CASE("train, evaluate, and everything that must be refused on the way", "[programs]") {
  const tg::TemporaryFolder folder;
  CHECK(tgtrain(folder, kSample).output == "wrote 6 photographs to scene\n");
  const Outcome again = tgtrain(folder, kSample);
  CHECK(again.code == 4);
  CHECK_THAT(again.output, Contains("scene") && Contains("--overwrite"));

  const Outcome trained = tgtrain(folder, "scene -o model.tgz --untextured-output plain.tgz --json run.json" + kShort);
  INFO(trained.output);
  REQUIRE(trained.code == 0);
  CHECK_THAT(trained.output, Contains("4 train and 2 test views of 32 x 32 (nerf-synthetic)"));
  CHECK_THAT(trained.output, Contains("textured 4/4") && Contains("it/s") && Contains("left"));
  CHECK_THAT(trained.output, Contains("textures gain") && Contains("peak memory"));
  const tg::Bundle bundle = tg::readBundle(folder / "model.tgz");
  CHECK(bundle.model.texture_mode == tg::TextureMode::rgba);
  CHECK(bundle.cameras.size() == 6);
  CHECK(bundle.cameras[5].test);
  CHECK(bundle.background == glm::vec3(1.0f));
  CHECK(bundle.preview.width == 32);
  const nlohmann::json json = nlohmann::json::parse(bundle.training_json);
  CHECK(json["stages"]["untextured"]["iterations"] == 4);
  CHECK(json["machine"]["seconds"].get<double>() > 0);
  const nlohmann::json output = {
      {"name", "model.tgz"}, {"file_format", "tgz"}, {"bytes", fs::file_size(folder / "model.tgz")}};
  CHECK(outputOf(folder / "run.json", json) == output);
  CHECK_THAT(json["machine"]["device"].get<std::string>(),
             (Contains("CPU, ") && Contains(" threads")) || Contains("CUDA, "));
  CHECK(bundle.training_json.find(folder.path.filename().string()) == std::string::npos);
  const tg::Bundle plain = tg::readBundle(folder / "plain.tgz");
  CHECK(plain.model.texture_mode == tg::TextureMode::none);
  const nlohmann::json twin = nlohmann::json::parse(plain.training_json);
  CHECK(twin["settings"]["texture-mode"] == "none");
  CHECK_FALSE(twin["stages"].contains("textured"));
  CHECK(twin["stages"]["untextured"] == json["stages"]["untextured"]);
  CHECK(twin["texels"] == 0);

  const Outcome scored = tgeval(folder, "model.tgz scene --json scores.json --images pictures");
  INFO(scored.output);
  REQUIRE(scored.code == 0);
  CHECK_THAT(scored.output, Contains("r_0.png") && Contains("mean") && Contains("2 views"));
  CHECK(fs::exists(folder / "pictures/r_1.png"));
  const std::vector<std::uint8_t> bytes = tg::readFile(folder / "scores.json", 1 << 20);
  const nlohmann::json scores = nlohmann::json::parse(bytes.begin(), bytes.end());
  // The file's texels are half floats: the trainer's own score is met to that precision.
  CHECK(scores["psnr"].get<double>() == Approx(json["stages"]["textured"]["test_psnr"].get<double>()).margin(0.01));
  CHECK(tgeval(folder, "model.tgz scene --json scores.json").code == 4);
  CHECK(tgeval(folder, "model.tgz scene --quiet --json quiet.json").output.empty());
  CHECK_THAT(tgeval(folder, "model.tgz scene --json /dev/null").output, Contains("is not a regular file"));
  CHECK(fs::exists(folder / "quiet.json"));
  CHECK(tgeval(folder, "absent.tgz scene").code == 2);
  CHECK(tgeval(folder, "model.tgz pictures").code == 3);
  CHECK(tgeval(folder, "model.tgz").code == 1);

  const Outcome all = tgeval(folder, "model.tgz scene --split all --images every");
  CHECK(all.code == 0);
  CHECK(fs::exists(folder / "every/r_0-2.png"));  // train/r_0.png and test/r_0.png

  CHECK(tgtrain(folder, "scene").code == 1);
  CHECK(tgtrain(folder, "scene -o x.tgz --texture-mode purple").code == 1);
  CHECK(tgtrain(folder, "scene -o x.tgz --background 7").code == 1);
  CHECK(tgtrain(folder, "absent -o x.tgz").code == 2);
  const Outcome nothing = tgtrain(folder, "pictures -o x.tgz");
  CHECK(nothing.code == 3);
  CHECK_THAT(nothing.output, Contains("not a data set"));
  const Outcome above = tgtrain(folder, ". -o x.tgz");
  CHECK(above.code == 3);
  CHECK_THAT(above.output, Contains("not a data set (did you mean ./scene?)"));
  const Outcome below = tgtrain(folder, "scene/train -o x.tgz");
  CHECK(below.code == 3);
  CHECK_THAT(below.output, Contains("(did you mean scene/?)"));
  CHECK(tgtrain(folder, "--help").code == 0);
  CHECK_FALSE(fs::exists(folder / "x.tgz"));
}

TEST_CASE("models are written in the output's format, scored and trained on in any", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  REQUIRE(tgtrain(folder, "scene -o model.tgz" + kShort).code == 0);
  const auto psnr = [&](const std::string& model) {
    const Outcome scored = tgeval(folder, model + " scene --json scores.json --overwrite");
    INFO(scored.output);
    REQUIRE(scored.code == 0);
    const std::vector<std::uint8_t> bytes = tg::readFile(folder / "scores.json", 1 << 20);
    return nlohmann::json::parse(bytes.begin(), bytes.end())["psnr"].get<double>();
  };
  const double expected = psnr("model.tgz");
  for (const std::string output : {"model.glb", "model.sog", "model.html"}) {
    const Outcome trained = tgtrain(folder, "scene --run run --overwrite -o " + output + kShort);
    INFO(trained.output);
    REQUIRE(trained.code == 0);
    CHECK_THAT(trained.output, Contains("wrote " + output));
    CHECK(psnr(output) == Approx(expected).margin(0.05));
  }
  const Outcome on = tgtrain(folder, "scene -o on.ply --start-model model.sog --iterations 0 --texture-iterations 2");
  INFO(on.output);
  CHECK(on.code == 0);
  CHECK(psnr("on.ply") > expected - 2);
  CHECK(tgeval(folder, "log.txt scene").code == 3);
  const Outcome levels = tgtrain(folder, "scene -o new/lod-meta.json" + kShort);
  INFO(levels.output);
  CHECK(levels.code == 0);
  std::uint64_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder / "new")) {
    if (entry.is_regular_file()) bytes += entry.file_size();
  }
  CHECK_THAT(levels.output, Contains("wrote new/lod-meta.json (" + std::to_string(bytes) + " bytes"));
  CHECK(tgtrain(folder, "scene -q -o quiet.ply" + kShort).output.empty());
}

TEST_CASE("what cannot be written as it was asked for after training is kept as a bundle", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  // Somebody's file comes while it trains: one that is there before is refused then.
  const auto disturbed = [&](const std::string& flags) {
    fs::remove(folder / "scene.bin");
    return run(folder, "'" TG_TGTRAIN "' scene -o scene.gltf --iterations 10000000 --texture-iterations 0 " + flags +
                           " & while kill -0 $! && ! grep -q 'plain 1/' log.txt; do sleep 0.05; done; "
                           "echo mine > scene.bin; kill $!; wait $!");
  };
  for (const std::string kept : {"scene.gltf.tgz", "scene.gltf-2.tgz"}) {
    const Outcome refused = disturbed("");
    INFO(refused.output);
    CHECK(refused.code == 4);
    CHECK_THAT(refused.output, Contains("scene.bin: exists already") && Contains("the model is kept as " + kept));
    CHECK(tgeval(folder, kept + " scene").code == 0);
  }
  CHECK(disturbed("--run run").code == 4);
  CHECK_FALSE(fs::exists(folder / "scene.gltf-3.tgz"));  // the run folder has it
  // Training for a file writes it on the way.
  const std::string coarse = "scene --gaussians 10 --quantize-iterations 5 --steps 4" + kShort;
  const Outcome large = tgtrain(folder, coarse + " --texture-size 256 -o large.sog");
  INFO(large.output);
  CHECK(large.code == 3);
  CHECK_THAT(large.output, Contains("tgtrain: large.sog: Gaussian 0 has too large a texture for SOG"));
  CHECK(tgeval(folder, "large.sog.tgz scene").code == 0);
  // Textures that no file holds.
  const std::string random =
      "scene --start random --init-count 17000 --densification none --iterations 1 --texture-intersection plane ";
  const Outcome many = tgtrain(folder, random + "--texture-iterations 1 --texture-size 256 -o many.tgz");
  INFO(many.output);
  CHECK(many.code == 1);
  CHECK_THAT(many.output, Contains("too many texels (expected at most 1073741824, found 1114112000)") &&
                              Contains("the model is kept as many-2.tgz"));
  CHECK(tgtrain(folder, random + "--texture-iterations 0 -o plain.tgz").code == 0);
  const tg::Bundle left = tg::readBundle(folder / "many-2.tgz");
  CHECK(left.model == tg::readBundle(folder / "plain.tgz").model);
  CHECK_THAT(left.training_json, Contains("\"plain\": {") && !Contains("\"textured\": {"));
  const Outcome nowhere = run(folder, "TMPDIR=/nonexistent '" TG_TGTRAIN "' " + coarse + " -o small.sog");
  INFO(nowhere.output);
  CHECK(nowhere.code == 4);
  CHECK_THAT(nowhere.output, Contains("/nonexistent: no folder for temporary files: No such file or directory"));
  CHECK(fs::exists(folder / "small.sog.tgz"));
}

TEST_CASE("a size is planned around what flags, a file of settings and the start model say", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string train = "scene --overwrite --iterations 20 --texture-iterations 4 --target-size 6KB -o ";
  const std::string quick = "scene --overwrite --preset quick --target-size 6KB -o ";
  REQUIRE(run(folder, "'" TG_TGTRAIN "' --print-config --preset quick > quick.toml").code == 0);
  CHECK_THAT(tgtrain(folder, quick + "a.sog").output, Contains("SH degree 1, 309 Gaussians\n"));
  CHECK_THAT(tgtrain(folder, quick + "a.sog --config quick.toml").output, Contains("SH degree 1, 309 Gaussians\n"));
  // Too short to grow them, and without growth.
  const std::string short_run = "scene --overwrite --iterations 20 --texture-mode none --target-size 60KB -o a.sog ";
  CHECK_THAT(tgtrain(folder, short_run).output,
             Contains("\n199 of 5088 planned Gaussians grew: more iterations may fill the file\n"));
  CHECK_THAT(tgtrain(folder, short_run + "--gaussians 1000").output, !Contains("grew"));  // nothing was planned
  CHECK_THAT(tgtrain(folder, short_run + "-q").output, !Contains("grew"));
  CHECK_THAT(tgtrain(folder, short_run + "--densification none").output, !Contains("grew"));
  // More grow where the photographs have pixels for them, 32 a Gaussian.
  REQUIRE(tgtrain(folder, "make-sample wide --size 64 --views 4 --test-views 1 --points 200 --supersampling 1").code ==
          0);
  const std::string small = "wide --overwrite --preset quick --target-size 4KB -o a.sog ";
  CHECK_THAT(tgtrain(folder, small).output,
             Contains("132 Gaussians (up to 512 until pairs are merged)\n") && !Contains("grew"));
  CHECK_THAT(tgtrain(folder, small + "--limit-by swap").output, !Contains("merged"));
  const std::string paper = "wide --overwrite --preset paper --iterations 20 --texture-iterations 4 -o a.sog ";
  CHECK_THAT(tgtrain(folder, paper + "--target-size 4KB").output, Contains("planned for") && !Contains("merged"));
  // A flag that says what the preset says is said.
  REQUIRE(run(folder, "'" TG_TGTRAIN "' --print-config --iterations 20 --texture-iterations 4 > short.toml").code == 0);
  const Outcome named = tgtrain(folder,
                                "scene --overwrite --target-size 20KB --config short.toml --sh-degree 3 "
                                "--quantize-iterations 0 -o a.sog");
  CHECK_THAT(named.output, Contains("planned for 20000 bytes: SH degree 3") && !Contains("quantized"));
  CHECK_THAT(tgtrain(folder, quick + "a.sog --densification mcmc").output, Contains("SH degree 1, 309 Gaussians\n"));
  CHECK_THAT(tgtrain(folder, train + "a.sog --gaussians 100").output,
             Contains("SH degree 1, no textures, for which so small a file has no room") && !Contains("coarser"));
  CHECK_THAT(tgtrain(folder, train + "a.sog --adaptive-texels 4").output, !Contains("no textures"));
  CHECK_THAT(tgtrain(folder, train + "a.sog --texture-size 4").output, Contains("textures that they share\n"));
  CHECK_THAT(
      tgtrain(folder, quick + "a.sog --gaussians 500").output,
      Contains("SH degree 1, 500 Gaussians, whose numbers will be coarser than those of the 309 it has room for\n"));
  CHECK_THAT(tgtrain(folder, quick + "a.sog --gaussians 0").output,
             Contains("SH degree 1, no limit of Gaussians, of which it has room for 309\n"));
  CHECK_THAT(tgtrain(folder, quick + "a.sog --gaussians 0 --densification none").output, Contains("SH degree 1\n"));
  CHECK_THAT(tgtrain(folder, quick + "a.sog --percent 50").output,
             Contains("SH degree 1, 50 % of the Gaussians that stage 1 reaches, of which it has room for 309\n"));
  CHECK_THAT(
      tgtrain(folder, quick + "a.sog --percent 50 --default-gaussians 800").output,
      Contains("SH degree 1, 50 % of 800 Gaussians, whose numbers will be coarser than those of the 309 it has room for"
               "\n"));
  CHECK_THAT(tgtrain(folder, quick + "a.sog --percent 50 --default-gaussians 600").output, Contains("SH degree 1\n"));
  const std::string large = "scene --overwrite --iterations 20 --texture-iterations 4 --target-size 60KB -o a.sog ";
  CHECK_THAT(tgtrain(folder, large + "--texture-mode rgba").output,
             Contains(" Gaussians, 64 textures that they share\n"));
  CHECK_THAT(tgtrain(folder, large + "--adaptive-texels 4").output, !Contains("share"));
  CHECK_THAT(tgtrain(folder, large + "--texture-mode none").output, !Contains("share"));
  const std::string for_glb = "scene --overwrite --iterations 20 --texture-iterations 4 --target-size 60KB -o b.glb ";
  CHECK_THAT(tgtrain(folder, for_glb + "--texture-mode rgba").output,
             Contains("share; in a .glb as many bytes of Gaussians without textures show more\n"));
  CHECK_THAT(tgtrain(folder, for_glb + "--texture-mode none").output, !Contains("show more"));
  const Outcome twin = tgtrain(folder, train + "a.sog --untextured-output plain.tgz");
  CHECK_THAT(twin.output, Contains(" texels each\n"));
  CHECK(fs::exists(folder / "plain.tgz"));
  // A start model with textures keeps them and its Gaussians, one without its SH degree.
  const std::string textured = "scene --iterations 20 --texture-iterations 4 --sh-degree 1 --texture-size 2 -o t.tgz";
  REQUIRE(tgtrain(folder, textured).code == 0);
  CHECK_THAT(tgtrain(folder, quick + "b.sog --start-model t.tgz").output,
             Contains("planned for 6000 bytes: SH degree 1\n") && Contains("quantized       40 iterations"));
  CHECK_THAT(tgtrain(folder, "scene --preset quick --target-size 20KB -o c.sog --start-model plain.tgz").output,
             Contains("planned for 20000 bytes: SH degree 1, "));
  REQUIRE(tgtrain(folder, "scene --iterations 9 --sh-degree 2 --texture-mode none -o two.tgz").code == 0);
  CHECK_THAT(tgtrain(folder, "scene --preset quick --target-size 20KB -o d.sog --start-model two.tgz").output,
             Contains("planned for 20000 bytes: SH degree 2, "));
  REQUIRE(tgtrain(folder,
                  "scene --iterations 0 --texture-iterations 0 --quantize-iterations 5 --steps 4 -o e.glb "
                  "--start-model two.tgz")
              .code == 0);
  const std::vector<std::uint8_t> glb = tg::readFile(folder / "e.glb", 1 << 20);
  CHECK_THAT(std::string(glb.begin(), glb.end()), Contains("SH_DEGREE_2_COEF_4") && !Contains("SH_DEGREE_3"));
  CHECK_THAT(tgtrain(folder, train + "b.glb --sh-degree 3").output, Contains("at least 6720 bytes, found 6000"));
}

TEST_CASE("a size that is named is met by what is trained and by how it is written", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const Outcome first = tgtrain(folder,
                                "scene --iterations 60 --texture-iterations 0 --quantize-iterations 0 "
                                "--target-size 5000 -o first.sog");  // nothing is replaced, nor may be
  INFO(first.output);
  CHECK(first.code == 0);
  CHECK(std::filesystem::file_size(folder / "first.sog") <= 5000);
  const std::string train = "scene --overwrite --iterations 60 --texture-iterations 20 --target-size ";
  for (const auto& [bytes, flags] :
       std::initializer_list<std::pair<std::uint64_t, std::string>>{{5'000, ""},
                                                                    {6'800, " --sh-degree 3"},
                                                                    {5'400, " --sh-degree 0 --adaptive-texels 8"},
                                                                    {7'000, " --texture-dictionary 8 --texture-size 4"},
                                                                    {5'400, " --json run.json --run run"}}) {
    const Outcome trained = tgtrain(folder, train + std::to_string(bytes) + " -o scene.sog" + flags);
    INFO(flags << '\n' << trained.output);
    REQUIRE(trained.code == 0);
    const std::uint64_t size = fs::file_size(folder / "scene.sog");
    CHECK(size <= bytes);
    // So small a file jumps by per cents from step to step, and by textures of which nothing is left.
    CHECK(size >= bytes * 95 / 100);
    CHECK_THAT(trained.output, Contains("wrote scene.sog (" + std::to_string(size) + " bytes, "));
    if (!flags.ends_with(" --run run")) continue;
    const std::string own = tg::readBundle(folder / "run/model.tgz").training_json;
    const nlohmann::json output = outputOf(folder / "run.json", nlohmann::json::parse(own));
    CHECK(output["name"] == "scene.sog");
    CHECK(output["file_format"] == "sog");
    CHECK(output["bytes"] == size);
    CHECK(output["target_bytes"] == bytes);
    CHECK(output["steps"].get<double>() >= 0.125);
    CHECK_THAT(trained.output, Contains(tg::formatted(" bytes, %.1f dB to the model)", output["psnr"].get<double>())));
  }
  const std::string coarse = "scene --overwrite --iterations 60 --texture-iterations 20 --gaussians 200 -o ";
  for (const std::string name : {"coarse.sog", "coarse.glb"}) {
    const Outcome trained = tgtrain(folder, coarse + name + " --steps 6");
    INFO(trained.output);
    CHECK(trained.code == 0);
    CHECK_THAT(trained.output, Contains("quantized        8 iterations"));
  }
  CHECK_THAT(tgtrain(folder, coarse + "fine.sog --quantize-iterations 5").output, Contains("coarser numbers"));
  CHECK_THAT(tgtrain(folder, coarse + "fine.tgz --steps 2").output,
             Contains("fine.tgz: --target-size and --steps are only"));
  CHECK_THAT(tgtrain(folder, train + "20KB -o scene.ply").output,
             Contains("scene.ply: --target-size and --steps are only"));
  CHECK_THAT(tgtrain(folder, train + "20KB --run run").output, Contains("(expected -o scene.sog or"));
  CHECK_THAT(tgtrain(folder, train + "20KB -o foo").output, Contains("foo: ") && Contains(".sog") && !Contains(".png"));
  CHECK_THAT(tgtrain(folder, train + "1KB -o scene.sog").output, Contains("--target-size is out of reach"));
  // Chosen by hand and too many: there is no such file, and the model is kept before it is rounded for one.
  const Outcome large = tgtrain(folder, train + "5.2KB --start random --init-count 3000 --gaussians 3000 -o large.sog");
  INFO(large.output);
  CHECK(large.code == 1);
  CHECK_THAT(large.output, Contains("large.sog: --target-size is out of reach") && Contains("found 5200") &&
                               Contains("the model is kept as large.sog.tgz"));
  CHECK_FALSE(fs::exists(folder / "large.sog"));
  CHECK(tg::readBundle(folder / "large.sog.tgz").model.size() == 3000);
}

TEST_CASE("a model that finds no room is kept where temporary files have some", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  fs::create_directory(folder / "other");
  TG_SKIP_IF(missingMount(folder));
  const std::string mount = mountOf("4k");
  for (const std::string name : {"model.tgz", "model.sog"}) {
    const Outcome full = run(folder, "TMPDIR=$PWD/other unshare -rm sh -c '" + mount +
                                         " && \"" TG_TGTRAIN "\" scene -o disk/" + name + kShort + "'");
    INFO(full.output);
    CHECK(full.code == 4);
    const std::string kept = name == "model.tgz" ? "model-2.tgz" : "model.sog.tgz";
    CHECK_THAT(full.output, Contains("the model is kept as " + (folder / "other" / kept).string()) &&
                                Contains("No space left on device"));
    CHECK(tg::readBundle(folder / "other" / kept).model.size() > 0);
  }
}

TEST_CASE("a run whose last checkpoint finds no room leaves its model and says how to go on", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  fs::create_directory(folder / "other");
  // Room for checkpoints of stage plain, not for texels with their moments.
  TG_SKIP_IF(missingMount(folder));
  const std::string mount = mountOf("400k");
  const std::string train = "\"" TG_TGTRAIN "\" scene --run disk/run --gaussians 100 --texture-size 16" + kShort;
  const auto inRoom = [&](const std::string& commands) {
    return run(folder, "TMPDIR=$PWD/other unshare -rm sh -c '" + mount + " && " + commands + "'");
  };
  const std::string why = "disk/run/checkpoint: cannot write: No space left on device";
  const std::string last =
      "; the last checkpoint is of plain 6/6, from which the same command with --resume goes on "
      "(the model is kept as ";

  const Outcome named = inRoom(train + " --resume -o model.tgz --json run.json");
  INFO(named.output);
  CHECK(named.code == 4);
  CHECK_THAT(named.output, Contains(why + " (training goes on; the last checkpoint is of plain 6/6)\n") &&
                               Contains(", from which the same command goes on (the model is kept as model.tgz)\n"));
  CHECK(tg::readBundle(folder / "model.tgz").model.texture_mode == tg::TextureMode::rgba);
  CHECK(fs::exists(folder / "run.json"));

  const Outcome unnamed = inRoom(train + "; head -c 300000 /dev/zero >disk/fill; " + train + " --resume; mount -o " +
                                 "remount,size=8m disk; " + train + " --resume -o resumed.tgz");
  INFO(unnamed.output);
  CHECK(unnamed.code == 0);
  CHECK_THAT(unnamed.output, Contains(why + last + "disk/run/model-2.tgz)\n"));
  CHECK(tg::readBundle(folder / "resumed.tgz").model.texture_mode == tg::TextureMode::rgba);

  const Outcome neither =
      inRoom("mount -o remount,size=80k disk; \"" TG_TGTRAIN "\" scene --run disk/run" + kShort + " -o disk/model.tgz");
  INFO(neither.output);
  CHECK(neither.code == 4);
  CHECK_THAT(neither.output, Contains("disk/model.tgz: cannot write: No space left on device (the model is kept as ") &&
                                 Contains("model-2.tgz); " + why + "; the last checkpoint is of plain ") &&
                                 Contains(", from which the same command with --resume goes on\n"));
}

TEST_CASE("what was begun and finds no room leaves nothing that the same command is refused for", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  fs::create_directory(folder / "there");
  const std::string runs = kShort + " --preview-every 1 --run ";
  const std::string sample = kSample.substr(kSample.find(" --"));
  const std::vector<std::string> commands = {"scene" + runs + "new",     "undistort scene new",
                                             "make-sample new" + sample, "scene" + runs + "there",
                                             "undistort scene there",    "make-sample there" + sample};
  for (const std::string& command : commands) {
    CAPTURE(command);
    for (int time = 0; time < 2; ++time) {
      const Outcome full = run(folder, "(ulimit -f 4; '" TG_TGTRAIN "' " + command + ")");
      INFO(full.output);
      CHECK(full.code == 4);
      CHECK_THAT(full.output, Contains("File too large"));
      CHECK_FALSE(fs::exists(folder / "new"));
      CHECK(fs::is_empty(folder / "there"));
    }
  }
}

TEST_CASE("a run with room for its first checkpoint and not for its model leaves no folder", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  TG_SKIP_IF(missingMount(folder));
  const std::string mount = mountOf("68k");
  const std::string train = "\"" TG_TGTRAIN "\" scene --run disk/run" + kShort;
  const std::string room = "mount -o remount,size=8m disk";
  const Outcome full = run(folder, "unshare -rm sh -c '" + mount + "; " + train + "; " + room + "; " + train + "'");
  INFO(full.output);
  CHECK(full.code == 0);
  CHECK_THAT(full.output, Contains("disk/run/model.tgz: cannot write: No space left on device\n") &&
                              Contains("wrote disk/run/model.tgz"));
}

TEST_CASE("without a CUDA device --device cuda ends with code 5, auto trains on the CPU", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string hidden = "CUDA_VISIBLE_DEVICES= '" TG_TGTRAIN "' scene -o model.tgz --device ";
  const Outcome refused = run(folder, hidden + "cuda" + kShort);
  CHECK(refused.code == 5);
  CHECK_THAT(refused.output, Contains("tgtrain: CUDA"));
  CHECK(run(folder, "CUDA_VISIBLE_DEVICES= '" TG_TGTRAIN "' scene --run new --device cuda").code == 5);
  CHECK_FALSE(std::filesystem::exists(folder / "new"));  // nothing came into it
  CHECK_FALSE(std::filesystem::exists(folder / "model.tgz"));
  const Outcome trained = run(folder, hidden + "auto" + kShort);
  INFO(trained.output);
  CHECK(trained.code == 0);
  CHECK(std::filesystem::exists(folder / "model.tgz"));
  CHECK(tgtrain(folder, "scene -o other.tgz --device gpu").code == 1);
  const std::string scored = "CUDA_VISIBLE_DEVICES= '" TG_TGEVAL "' model.tgz scene --device ";
  CHECK(run(folder, scored + "cuda").code == 5);
  CHECK(run(folder, scored + "auto").code == 0);
}

TEST_CASE("photographs of several sizes are announced from the smallest to the largest", "[programs]") {
  const tg::TemporaryFolder folder;
  std::vector<tg::test::Json> frames;
  for (const int size : {40, 24, 96}) {
    const std::string file = "images/" + std::to_string(size) + ".png";
    tg::test::writePicture(folder / "scene" / file, size, size / 2);
    frames.push_back(tg::test::frame(file));
    frames.back().update({{"w", size}, {"h", size / 2}, {"fl_x", size}, {"cx", size / 2}, {"cy", size / 4}});
  }
  tg::test::writeText(folder / "scene/transforms.json", tg::test::pinhole(frames).dump());
  const Outcome trained = tgtrain(folder, "scene -o model.tgz --test-every 0 --init-count 100" + kShort);
  CHECK_THAT(trained.output, Contains("scene: 3 train and 0 test views of 24 x 12 to 96 x 48 (transforms)"));
}

TEST_CASE("an existing model is kept unless --overwrite, and when writing fails", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  REQUIRE(tgtrain(folder, "scene -o model.tgz --reproducible -q" + kShort).code == 0);
  const std::vector<std::uint8_t> bytes = tg::readFile(folder / "model.tgz", 1 << 24);
  const Outcome kept = tgtrain(folder, "scene -o model.tgz" + kShort);
  CHECK(kept.code == 4);
  CHECK_THAT(kept.output, Contains("model.tgz: exists already"));
  CHECK(tgtrain(folder, "scene -o missing/model.tgz" + kShort).code == 4);
  // A limit of 8 blocks on file sizes makes the write fail halfway.
  const Outcome full = run(folder, "(ulimit -f 8; '" TG_TGTRAIN "' scene -o model.tgz --overwrite -q" + kShort + ")");
  CHECK(full.code == 4);
  CHECK_THAT(full.output, Contains("model.tgz: cannot write: File too large") && !Contains("kept"));
  CHECK(tg::readFile(folder / "model.tgz", 1 << 24) == bytes);
  for (const auto& entry : fs::directory_iterator(folder.path)) {
    const std::string name = entry.path().filename().string();
    CHECK((name == "model.tgz" || name == "scene" || name == "log.txt"));
  }
  // What a run folder holds goes when the new run can begin, not before.
  REQUIRE(tgtrain(folder, "scene --run run -q" + kShort).code == 0);
  const Outcome unfit =
      tgtrain(folder, "scene --run run --overwrite --start-model run/model.tgz --compare-untextured" + kShort);
  CHECK(unfit.code == 1);
  CHECK_THAT(unfit.output, Contains("the start model has textures already"));
  CHECK(std::filesystem::exists(folder / "run/model.tgz"));
  fs::remove_all(folder / "run");
  SECTION("same seed, same bytes") {
    REQUIRE(tgtrain(folder, "scene -o model.tgz --overwrite --reproducible --threads 1 -q" + kShort).code == 0);
    CHECK(tg::readFile(folder / "model.tgz", 1 << 24) == bytes);
  }
}

TEST_CASE("what cannot be written is refused before training", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string forever = "scene --iterations 10000000 ";
  fs::create_symlink("m.tgz", folder / "link.tgz");  // to nothing yet
  fs::create_symlink("run/model.tgz", folder / "own.tgz");
  fs::create_symlink("scene/m.gltf", folder / "link.gltf");
  std::ofstream(folder / "scene/old.bin") << "of an earlier one";
  for (const auto& [outputs, code, message] : std::initializer_list<std::tuple<std::string, int, std::string>>{
           {"-o missing/m.tgz", 4, "missing/m.tgz: cannot write here"},
           {"-o m.tgz --json missing/m.json", 4, "missing/m.json: cannot write here"},
           {"-o m.tgz --untextured-output missing/p.tgz", 4, "missing/p.tgz: cannot write here"},
           {"-o m.tgz --json /dev/full --overwrite", 4, "/dev/full: exists and is not a regular file"},
           {"-o m.tgz --json /dev/full", 4, "/dev/full: exists and is not a regular file"},
           {"-o " + std::string(300, 'x') + ".tgz", 4, "cannot write here"},
           {"-o missing/deep/lod-meta.json", 4, "missing/deep: cannot write here"},
           {"-o m.obj", 1, "m.obj: is no model format (expected .compressed.ply, "},
           {"-o m.png", 1, "m.png: is no model format (expected .compressed.ply, "},
           {"-o m.tgz --json ./m.tgz", 1, "is named for two outputs"},
           {"-o m.tgz --json ../" + folder.path.filename().string() + "/m.tgz", 1, "is named for two outputs"},
           {"-o m.tgz --untextured-output link.tgz", 1, "link.tgz: is named for two outputs"},
           {"-o m.gltf --json m.bin", 1, "m.bin: is written beside m.gltf, too (expected another name)"},
           {"-o m.tgz --untextured-output m.gltf --json ./m_atlas_0_color.png", 1, "is written beside m.gltf, too"},
           {"-o scene/old.gltf", 4, "scene/old.bin: exists already"},
           {"-o own.tgz --run run", 1, "own.tgz: is written in any case, by the run folder"},
           {"-o link.gltf", 4, "link.gltf: is a symbolic link into another folder"},
           {"-o m.tgz --preview-every 5", 1, "--preview-every expects a run folder (--run FOLDER)"},
           {"-o m.tgz --serve 0 --checkpoint-every 5", 1, "--checkpoint-every expects a run folder"},
           {"-o m.tgz --eval-every 5", 1, "--eval-every expects --run FOLDER or --serve"}}) {
    const Outcome outcome = tgtrain(folder, forever + outputs);
    INFO(outputs << '\n' << outcome.output);
    CHECK(outcome.code == code);
    CHECK_THAT(outcome.output, Contains(message));
  }
  for (const auto& entry : fs::directory_iterator(folder.path)) {
    const std::string name = entry.path().filename().string();
    CHECK((name == "scene" || name == "log.txt" || entry.is_symlink()));
  }
  for (const std::string output :
       {"--json r/../r/checkpoint", "-o r/live.tgz", "--json r/live.json", "--json r/control"}) {
    CHECK_THAT(tgtrain(folder, forever + "--run r " + output).output,
               Contains("is written in any case, by the run folder"));
  }
}

TEST_CASE("a plain start model keeps its intersection, and test views are scored without the others", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string none = " --texture-iterations 0 -q --iterations ";
  REQUIRE(tgtrain(folder, "scene -o plane.tgz --intersection plane" + none + "2").code == 0);
  REQUIRE(tgtrain(folder, "scene -o same.tgz --start-model plane.tgz" + none + "0").code == 0);
  REQUIRE(tgtrain(folder, "scene -o other.tgz --start-model plane.tgz --intersection maxResponse" + none + "0").code ==
          0);
  CHECK(tg::readBundle(folder / "same.tgz").model.intersection == tg::IntersectionModel::plane);
  CHECK(tg::readBundle(folder / "other.tgz").model.intersection == tg::IntersectionModel::maxResponse);
  // --resume would read it again.
  CHECK_THAT(tgtrain(folder, "scene --run r --overwrite --start-model same.tgz -o r/../same.tgz" + none + "0").output,
             Contains("is what training starts from"));
  const std::string scored = tgeval(folder, "same.tgz scene").output;
  fs::remove_all(folder / "scene/train");
  CHECK_THAT(tgeval(folder, "same.tgz scene").output, Contains("4 of 6 listed images are missing") && Contains(scored));
  CHECK_THAT(tgtrain(folder, "scene -o no.tgz").output, Contains("no image of the training split exists"));
}

TEST_CASE("what is missing is named, and nothing else", "[programs]") {
  const tg::TemporaryFolder folder;
  for (const auto& [arguments, message] : std::initializer_list<std::pair<std::string, std::string>>{
           {"", "expected a data set and -o model.tgz or --run FOLDER (see --help)"},
           {"scene", "scene: expected -o model.tgz or --run FOLDER (see --help)"},
           {"-o m.tgz", "expected a data set (see --help)"},
           {"'' -o m.tgz", "dataset: an empty file name"},
           {"scene -o ''", "--output: an empty file name"},
           {"photos photos -o ''", "--output: an empty file name"},
           {"photos '' -o m.tgz", "dataset: an empty file name"},
           {"plot", "plot: expected a run folder and -o curves.svg (see tgtrain plot --help)"},
           {"plot run", "plot: expected -o curves.svg (see tgtrain plot --help)"},
           {"plot -o a.svg", "plot: expected a run folder (see tgtrain plot --help)"},
           {"scene -o m.tgz --resume", "--resume expects a run folder (--run FOLDER)"},
           {"scene -o m.tgz --watch", "--watch expects a run folder (--run FOLDER)"},
           {"scene -o m.tgz --watch --resume", "--resume and --watch expect a run folder (--run FOLDER)"},
           {"photos . -o m.tgz --frames 10", "--frames expects a film (. is a folder)"}}) {
    const Outcome outcome = tgtrain(folder, arguments);
    CHECK(outcome.code == 1);
    CHECK(outcome.output == "tgtrain: " + message + "\n");
  }
  CHECK(tgeval(folder, "'' scene").output == "tgeval: models: an empty file name\n");
}

TEST_CASE("a setting that nothing uses is warned of where a flag names it", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string quick = "scene -o m.tgz --overwrite -q --iterations 2 ";
  const auto said = [&](const std::string& arguments) { return tgtrain(folder, quick + arguments).output; };
  CHECK(said("--texture-iterations 0 --texture-size 4 --rate-texels 1e-3") ==
        "tgtrain: --texture-size, --rate-texels: does nothing with --texture-iterations 0\n");
  CHECK(said("--texture-mode none --texture-size 4") ==
        "tgtrain: --texture-size: does nothing with --texture-mode none\n");
  CHECK(said("--texture-iterations 2 --texture-size 4").empty());
  CHECK(said("--texture-iterations 2 --texture-size 4 --pixels-per-texel 9") ==
        "tgtrain: --pixels-per-texel: does nothing with --texture-size\n");
  CHECK(said("--texture-iterations 2 --texel-budget 900 --texture-size 4") ==
        "tgtrain: --texture-size: does nothing with --texel-budget\n");
  CHECK(said("--texture-iterations 0 --densification none --limit-by swap --mcmc-noise 1") ==
        "tgtrain: --limit-by: does nothing with --densification none\n"
        "tgtrain: --mcmc-noise: does nothing with --densification none\n");
  CHECK(said("--texture-iterations 0 --densification none --densify-every 9 --default-gaussians 50") ==
        "tgtrain: --default-gaussians: does nothing with a limit that is no share (--percent)\n"
        "tgtrain: --densify-every: does nothing with --densification none\n");
  CHECK(said("--texture-iterations 0 --limit-by swap") ==
        "tgtrain: --limit-by: does nothing with no limit (--gaussians, --percent or --target-size)\n");
  CHECK(said("--texture-iterations 0 --limit-by swap --gaussians 50").empty());
  CHECK(said("--start random --points scene/points3d.ply") ==
        "tgtrain: --points expects no --start random, which has its own\n");
  // A file names them all.
  REQUIRE(run(folder, "'" TG_TGTRAIN "' --print-config --texture-iterations 0 > all.toml").code == 0);
  CHECK(said("--config all.toml").empty());
  CHECK_THAT(said("--config all.toml --texture-size 4"), Contains("--texture-size: does nothing with"));
  REQUIRE(tgtrain(folder, "scene -o start.tgz -q --iterations 2 --texture-iterations 2 --texture-size 4").code == 0);
  CHECK(said("--texture-iterations 2 --start-model start.tgz --start random --init-count 7") ==
        "tgtrain: --start, --init-count: does nothing with --start-model\n"
        "tgtrain: --iterations: does nothing with a start model that has textures\n");
  CHECK(said("--texture-iterations 2 --start-model start.tgz --texture-mode rgb --gaussians 9") ==
        "tgtrain: --iterations, --gaussians, --texture-mode: does nothing with a start model that has textures\n");
  CHECK(said("--texture-iterations 2 --start-model start.tgz --prune-opacity 0.1 --limit-by swap") ==
        "tgtrain: --iterations, --limit-by, --prune-opacity: does nothing with a start model that has textures\n");
  CHECK(said("--texture-iterations 0 --prune-opacity 0.1") ==
        "tgtrain: --prune-opacity: does nothing with a schedule without a round of densification\n");
  REQUIRE(tgtrain(folder, "scene -o plain.tgz -q --iterations 2 --texture-iterations 0").code == 0);
  CHECK(said("--texture-iterations 0 --start-model plain.tgz --filter-3d").empty());
  CHECK(said("--texture-iterations 0 --start-model plain.tgz --texture-size 4 --init-count 7") ==
        "tgtrain: --init-count: does nothing with --start-model\n"
        "tgtrain: --texture-size: does nothing with --texture-iterations 0\n");
  REQUIRE(tgtrain(folder, "scene -o filtered.tgz -q --iterations 2 --texture-iterations 0 --filter-3d").code == 0);
  CHECK(said("--texture-iterations 0 --start-model filtered.tgz").empty());
  CHECK(said("--texture-iterations 0 --start-model filtered.tgz --filter-3d") ==
        "tgtrain: --filter-3d: the start model is as the filter of its own training left it, and is filtered once "
        "more\n");
  CHECK(said("--start-model start.tgz --points scene/points3d.ply") ==
        "tgtrain: --points expects no --start-model, which is a start of its own\n");
}

TEST_CASE("a wrong command line is one line that names the program", "[programs]") {
  const tg::TemporaryFolder folder;
  for (const std::string arguments : {"scene -o m.tgz --gaussians -1", "scene -o m.tgz --seed -1",
                                      "scene -o m.tgz --unknown", "scene -o m.tgz --iterations many"}) {
    const Outcome outcome = tgtrain(folder, arguments);
    INFO(outcome.output);
    CHECK(outcome.code == 1);
    CHECK(outcome.output.rfind("tgtrain: ", 0) == 0);
    CHECK(std::count(outcome.output.begin(), outcome.output.end(), '\n') == 1);
  }
}

TEST_CASE("programs have a version, and fail where what they print is lost", "[programs]") {
  const tg::TemporaryFolder folder;
  for (const std::string program : {TG_TGTRAIN, TG_TGEVAL}) {
    const Outcome version = run(folder, "'" + program + "' --version");
    CHECK(version.code == 0);
    CHECK_THAT(version.output, Contains(fs::path(program).filename().string() + " "));
    const Outcome lost = run(folder, "'" + program + "' --help >/dev/full");
    CHECK(lost.code == 4);
    CHECK_THAT(lost.output, Contains("standard output: cannot write: No space left on device"));
    for (const std::string what : {" --version", " --man", " --completion=bash"}) {
      CHECK(run(folder, "'" + program + "'" + what + " >/dev/full").output == lost.output);
    }
  }
  CHECK(run(folder, "'" TG_TGTRAIN "' photos --completion bash").code == 1);
  CHECK(run(folder, "'" TG_TGTRAIN "' photos --version").output == tgtrain(folder, "--version").output);
}

TEST_CASE("a value that is none is named with what was expected", "[programs]") {
  const tg::TemporaryFolder folder;
  for (const auto& [arguments, message] : std::initializer_list<std::pair<std::string, std::string>>{
           {"--steps", "--steps: expected a value, found none"},
           {"--steps abc", "--steps: expected a number from 0.125 to 64, found \"abc\""},
           {"--threads 1.5", "--threads: expected an integer from 0 to 4096, found \"1.5\""},
           {"--downscale two", "--downscale: expected a number, found \"two\""},
           {"--target-size foo",
            "--target-size: expected bytes, such as 900KB (900,000) or 1.5MiB (1,572,864), found \"foo\""},
           {"--target-size 0.5",
            "--target-size: expected bytes, such as 900KB (900,000) or 1.5MiB (1,572,864), found \"0.5\""},
           {"--target-size 3PB",
            "--target-size: expected bytes, such as 900KB (900,000) or 1.5MiB (1,572,864), found \"3PB\""}}) {
    const Outcome outcome = tgtrain(folder, "scene -o m.sog " + arguments);
    CHECK(outcome.code == 1);
    CHECK(outcome.output == "tgtrain: " + message + " (see --help)\n");
  }
  // However long it is.
  for (const char* flag : {"--steps ", "--threads ", "--downscale "}) {
    const Outcome outcome = tgtrain(folder, "scene -o m.sog " + (flag + std::string(60000, 'x')));
    CHECK(outcome.code == 1);
    CHECK(outcome.output.starts_with("tgtrain: --"));
  }
}

TEST_CASE("a file of settings is refused by the name of what is wrong in it", "[programs]") {
  const tg::TemporaryFolder folder;
  const Outcome absent = tgtrain(folder, "scene -o m.tgz --config none.toml");
  CHECK(absent.code == 2);
  CHECK_THAT(absent.output, Contains("none.toml was not readable"));
  const Outcome unknown = run(folder, "echo 'iteratons = 5' >a.toml; '" TG_TGTRAIN "' scene -o m.tgz --config a.toml");
  CHECK(unknown.code == 1);
  CHECK_THAT(unknown.output, Contains("tgtrain: --config: no such setting: iteratons"));
  // What belongs to one training only, and what would be a command's.
  for (const char* other : {"output = \"b.tgz\"", "json = \"b.json\"", "overwrite = true", "[make-sample]\nsize = 3",
                            "make-sample.size = 3", "[farm]"}) {
    INFO(other);
    std::ofstream(folder / "a.toml") << other << "\n";
    const Outcome refused = tgtrain(folder, "scene -o m.tgz --config a.toml");
    CHECK(refused.code == 1);
    CHECK_THAT(refused.output, Contains(": no such setting: ") && !Contains("++"));
  }
  std::ofstream(folder / "a.toml") << "iterations = 5k\n";
  CHECK_THAT(tgtrain(folder, "scene -o m.tgz --config a.toml").output,
             Contains("tgtrain: a.toml: iterations: expected an integer"));
  CHECK_THAT(tgtrain(folder, "scene -o m.tgz --config a.toml --iterations 6k").output,
             Contains("tgtrain: --iterations: expected an integer"));
  std::ofstream(folder / "a.toml") << "preset = \"fast\"\n";
  CHECK_THAT(tgtrain(folder, "scene -o m.tgz --config a.toml").output, Contains("tgtrain: a.toml: preset: expected"));
  std::ofstream(folder / "a.toml") << "iterations =\n";
  CHECK_THAT(tgtrain(folder, "scene -o m.tgz --config a.toml").output,
             Contains("a.toml: iterations: expected a value, found none"));
  for (const char* number : {"010", "0x10", "1.5"}) {
    INFO(number);
    CHECK(tgtrain(folder, std::string("scene -o m.tgz --threads ") + number).code == 1);
  }
  CHECK_THAT(tgtrain(folder, "scene -o m.tgz --serve ''").output, Contains("--serve: an empty address"));
}

TEST_CASE("an interrupt ends training early and writes the model", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const Outcome outcome = run(folder, "'" TG_TGTRAIN
                                      "' scene -o model.tgz --run run --iterations 1000000 & "
                                      "until [ -e run/model.tgz ]; do sleep 0.01; done; kill -TERM $!; wait $!");
  INFO(outcome.output);
  CHECK(outcome.code == 128 + 15);
  CHECK_THAT(outcome.output, Contains("interrupted; wrote model.tgz"));
  const tg::Bundle bundle = tg::readBundle(folder / "model.tgz");
  CHECK(nlohmann::json::parse(bundle.training_json)["interrupted"] == true);
  CHECK(bundle.model.size() > 0);
}

TEST_CASE("a distorted data set is trained, and written without its lens", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  for (const std::string split : {"train", "test"}) {
    const auto file = folder / ("scene/transforms_" + split + ".json");
    std::string text;
    std::getline(std::ifstream(file), text, '\0');
    std::ofstream(file) << "{ \"k1\": -0.3, " << text.substr(text.find('{') + 1);
  }
  const Outcome trained = tgtrain(folder, "scene -o model.tgz" + kShort);
  CHECK(trained.code == 0);
  CHECK_THAT(trained.output, Contains("6 of 6 photographs are undistorted as they are read (the first: OPENCV, to "));
  const Outcome written = tgtrain(folder, "undistort scene flat");
  CHECK(written.code == 0);
  CHECK_THAT(written.output, Contains("wrote 6 photographs to flat"));
  CHECK(tgtrain(folder, "undistort scene flat").code == 4);
  const Outcome onto_itself = tgtrain(folder, "undistort scene ./scene --overwrite");
  CHECK(onto_itself.code == 1);
  CHECK_THAT(onto_itself.output, Contains("./scene: is the data set itself (expected another folder)"));
  std::filesystem::create_directories(folder / "colmap/sparse");
  const Outcome beside = tgtrain(folder, "undistort scene colmap --overwrite");
  CHECK(beside.code == 4);
  CHECK_THAT(beside.output, Contains("colmap: holds sparse, which this would not replace"));
  CHECK(tgtrain(folder, "undistort absent other").code == 2);
  // The same cameras, split and pixels, which were composited before they were rounded, and after: the same score.
  const Outcome before = tgeval(folder, "model.tgz scene");
  const Outcome after = tgeval(folder, "model.tgz flat --background white");
  REQUIRE(before.code == 0);
  REQUIRE(after.code == 0);
  const auto psnr = [](const std::string& output) {
    const std::size_t line = output.rfind("mean ");
    return line == std::string::npos ? 0.0 : std::stod(output.substr(line + 5));
  };
  CHECK(psnr(before.output) > 5.0);
  CHECK(psnr(after.output) == Approx(psnr(before.output)).margin(0.01));
}

TEST_CASE("what is printed goes into no file where streams are closed", "[programs]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  CHECK(run(folder, "'" TG_TGTRAIN "' scene --run r -o m.tgz" + kShort + " <&- 2>&-").code == 0);
  std::ifstream metrics(folder / "r/metrics.jsonl");
  std::string line;
  int lines = 0;
  for (; std::getline(metrics, line); ++lines) {
    INFO(line);
    CHECK(nlohmann::json::accept(line));
  }
  CHECK(lines > 0);
}
