// SPDX-License-Identifier: Apache-2.0
// The program's exit codes, outputs and what it leaves behind.
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "converter/gltf/write_gltf.h"
#include "converter/registry/file_format.h"
#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"
#include "core/bundle/training_json.h"
#include "glb.h"
#include "scenes.h"
#include "scratch.h"
#include "support/catch.h"
#include "support/sanitizers.h"

using namespace tg;

namespace {

struct Result {
  int code = 0;
  std::string out;
  std::string err;
};

// `before`: shell commands that set limits.
Result tgconvert(const Scratch& scratch, const std::string& arguments, const std::string& before = "") {
  const auto out = scratch.folder() / "out.txt", err = scratch.folder() / "err.txt";
  const std::string command = before + "cd '" + scratch.folder().string() + "' && '" TG_CONVERT_PROGRAM "' " +
                              arguments + " >'" + out.string() + "' 2>'" + err.string() + "'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, Glb::slurp(out), Glb::slurp(err)};
}

}  // namespace

TEST_CASE("the help and the manual name every format that is read or written") {
  const Scratch scratch;
  const auto words = [](std::istream&& text) {  // lines are broken anywhere
    std::string all;
    for (std::string word; text >> word;) all += " " + word;
    return all;
  };
  const auto needs = [](const std::string& place, const std::string& text, const std::string& what) {
    INFO(place << " needs: " << what);
    CHECK((text.find(what) != std::string::npos));
  };
  const std::string help = words(std::istringstream(tgconvert(scratch, "--help").out));
  needs("tgconvert --help", help, "IN: model to read, " + listed(inputNames()) + ";");
  needs("docs/converter.md", words(std::ifstream("docs/converter.md")),
        "IN is told apart by its content: " + listed(inputNames()) + " ([formats.md]");
  for (const Format& format : formats()) {
    if (format.write) needs("tgconvert --help", help, "." + std::string(format.name));
  }
}

TEST_CASE("tgconvert looks without writing: null, --stats and --dry-run") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(test::SceneKind::ordinary, 42, 50).model;
  model.texture_mode = TextureMode::none;
  model.atlas = {};
  writeSplatPly(scratch.folder() / "in.ply", model);

  const Result null = tgconvert(scratch, "in.ply null --stats --json");
  REQUIRE(null.code == 0);
  const auto json = nlohmann::json::parse(null.out);
  CHECK(json["gaussians"] == 50);
  const auto& opacity = *std::find_if(json["statistics"].begin(), json["statistics"].end(),
                                      [](const auto& entry) { return entry["name"] == "opacity"; });
  CHECK(opacity["count"] == 50);
  CHECK(opacity["low"].get<double>() <= opacity["median"].get<double>());
  CHECK(opacity["high"].get<double>() <= 1.0);
  CHECK(tgconvert(scratch, "in.ply --stats").out.find("longest scale") != std::string::npos);

  for (const char* name : {"a.ply", "a.spz", "a.glb", "a.tgz"}) {
    CAPTURE(name);
    const Result dry = tgconvert(scratch, std::string("in.ply ") + name + " --dry-run --json");
    REQUIRE(dry.code == 0);
    CHECK(!std::filesystem::exists(scratch.folder() / name));
    REQUIRE(tgconvert(scratch, std::string("in.ply ") + name + " --quiet").code == 0);
    CHECK(nlohmann::json::parse(dry.out)["output"]["bytes"] == std::filesystem::file_size(scratch.folder() / name));
  }
  CHECK(readModel(scratch.folder() / "a.spz").model.size() == 50);
  writeSplatPly(scratch.folder() / "none.ply", GaussianModel());
  CHECK(tgconvert(scratch, "none.ply a.sog --dry-run").err == "tgconvert: a.sog: the model has no Gaussians\n");
}

TEST_CASE("a signal ends tgconvert with nothing half written, and one that it was started to ignore does not") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(test::SceneKind::ordinary, 43, 100'000).model;
  model.texture_mode = TextureMode::none;
  model.atlas = {};
  writeSplatPly(scratch.folder() / "in.ply", model);
  const auto interrupted = [&](const std::string& before, const std::string& signal) {
    const std::string script = "cd '" + scratch.folder().string() + "'; " + before +
                               " '" TG_CONVERT_PROGRAM
                               "' in.ply out.tgz --quiet & "
                               "until ls -A | grep -q '^[.]tg-'; do kill -0 $! || exit 1; done; "
                               "kill -" +
                               signal + " $!; wait $!";
    const int status = std::system(script.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  const auto files = [&] {
    return std::distance(std::filesystem::directory_iterator(scratch.folder()), std::filesystem::directory_iterator());
  };
  CHECK(interrupted("", "TERM") == 128 + 15);
  CHECK(interrupted("", "HUP") == 128 + 1);
  CHECK(files() == 1);
  CHECK(interrupted("nohup", "HUP") == 0);
  CHECK(readModel(scratch.folder() / "out.tgz").model.size() == 100'000);
  CHECK(files() == 2);
}

TEST_CASE("a long conversion says on a terminal how far it is and nowhere else") {
  const Scratch scratch;
  Bundle bundle;
  bundle.model = test::makeScene(test::SceneKind::ordinary, 29, 300).model;
  writeBundle(scratch.folder() / "a.tgz", bundle);
  const auto shown = [&](const std::string& arguments) {
    const auto screen = scratch.folder() / "screen.txt";
    const std::string command = "cd '" + scratch.folder().string() + "' && script -qec \"" TG_CONVERT_PROGRAM " " +
                                arguments + "\" '" + screen.string() + "' >out.txt";
    REQUIRE(std::system(command.c_str()) == 0);
    return Glb::slurp(screen);
  };
  CHECK_THAT(shown("a.tgz b.glb --for three"), Contains("fitting to three, 50 %, ") && Contains(" s left"));
  CHECK_THAT(shown("a.tgz b.sog --target-size 20KB"), Contains("steps for its size, 23 %, "));
  CHECK_THAT(shown("a.tgz c.sog --target-psnr 30"), Contains("steps for its pictures, 100 %, "));
  CHECK_THAT(shown("a.tgz d.glb --for three -q"), !Contains("fitting"));
  CHECK(tgconvert(scratch, "a.tgz e.glb --for three").err.empty());
}

TEST_CASE("the option --for knows its viewers, and the formats that they read") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 10, 3.0, 46));
  const Result json = tgconvert(scratch, "in.ply tileset.json --for cesium --json");
  REQUIRE(json.code == 0);
  const auto report = nlohmann::json::parse(json.out)["for"];
  CHECK(report["viewer"] == "cesium");
  CHECK(report["psnr"].get<double>() >= report["psnr_before"].get<double>());
  CHECK(tgconvert(scratch, "in.ply again.tileset.json --for cesium").out.find("for CesiumJS") != std::string::npos);
  CHECK(Glb::slurp(scratch.folder() / "content.glb") == Glb::slurp(scratch.folder() / "again.content.glb"));
  const Result unknown = tgconvert(scratch, "in.ply x.glb --for threejs");
  CHECK(unknown.code == 1);
  CHECK(unknown.err.find("playcanvas") != std::string::npos);
  for (const char* name : {"x.tgz", "x.html"}) {
    const Result refused = tgconvert(scratch, std::string("in.ply ") + name + " --for three");
    CHECK(refused.code == 1);
    CHECK(refused.err.find("--for does nothing here: it is only for .ply") != std::string::npos);
    CHECK(!std::filesystem::exists(scratch.folder() / name));
  }
  CHECK(tgconvert(scratch, "in.ply x.glb --for spark").err ==
        "tgconvert: --for spark: Spark 2.2.0 opens no .glb (expected .ply, .compressed.ply, .splat, .spz or .sog)\n");
  CHECK(tgconvert(scratch, "in.ply x.glb --for cesium").err.ends_with(" opens no .glb (expected tileset.json)\n"));
  CHECK(tgconvert(scratch, "in.ply x.glb --for playcanvas --steps 1").err ==
        "tgconvert: --for playcanvas: PlayCanvas 2.23.3 opens no .glb packed by EXT_meshopt_compression (expected no "
        "--steps)\n");
  CHECK(tgconvert(scratch, "in.ply x.spz --for spark --spz-version 4").err ==
        "tgconvert: --for spark: Spark 2.2.0 opens no .spz of version 4 (expected 3)\n");
  std::filesystem::create_directory(scratch.folder() / "models");
  std::filesystem::copy(scratch.folder() / "in.ply", scratch.folder() / "models/a.ply");
  CHECK(tgconvert(scratch, "models made --to glb --for spark").code == 1);
  for (const char* name : {"x.glb", "x.spz", "made"}) CHECK(!std::filesystem::exists(scratch.folder() / name));
  // The version that it opens.
  REQUIRE(tgconvert(scratch, "in.ply three.spz --for three --quiet").code == 0);
  CHECK(Glb::slurp(scratch.folder() / "three.spz").substr(0, 4) == "NGSP");
  REQUIRE(tgconvert(scratch, "in.ply spark.spz --for spark --quiet").code == 0);
  CHECK(Glb::slurp(scratch.folder() / "spark.spz").substr(0, 2) == "\x1f\x8b");
  writeGlb(scratch.folder() / "textured.glb",
           {test::makeScene(test::SceneKind::ordinary, 47, 10).model, {}, glm::vec3(0.0f)});
  // It is fitted to the cameras also where they are not written.
  Bundle seen;
  seen.model = randomSplats(1, 10, 3.0, 46);
  seen.cameras.assign(9, lookAt({0, 0, -9}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48));
  writeBundle(scratch.folder() / "seen.tgz", seen);
  const auto fitted = [&](const std::string& more) {
    return nlohmann::json::parse(
        tgconvert(scratch, "seen.tgz seen.glb --overwrite --for three --json" + more).out)["for"];
  };
  const nlohmann::json without = fitted(" --no-cameras");
  CHECK(readModel(scratch.folder() / "seen.glb").cameras.empty());
  CHECK(fitted("") == without);
  CHECK(readModel(scratch.folder() / "seen.glb").cameras.size() == 9);
  const Result lost = tgconvert(scratch, "textured.glb out.splat --for three --no-psnr");
  CHECK(lost.code == 0);
  CHECK(lost.err.find(" holds no textures: ") != std::string::npos);
}

TEST_CASE("the summary counts texels in every format that holds textures, and atlases where there are any") {
  const Scratch scratch;
  const GaussianModel model = test::makeScene(test::SceneKind::ordinary, 48, 10).model;
  std::size_t texels = 0;
  for (const TextureRect& rect : model.atlas.rects) texels += rect.texelCount();
  REQUIRE(texels > 0);
  writeGlb(scratch.folder() / "in.glb", {model, {}, glm::vec3(0.0f)});
  for (const Format& format : formats()) {
    if (!format.write || !format.read) continue;
    CAPTURE(format.name);
    const std::string out = "out." + std::string(format.name);
    const Result json = tgconvert(scratch, "in.glb " + out + " --no-psnr --json");
    REQUIRE(json.code == 0);
    const auto textures = nlohmann::json::parse(json.out)["textures"];
    CHECK(textures["texels"] == (format.holds(kKeepsTextures) ? texels : 0));
    CHECK((textures["atlases"] > 0) == format.is_gltf);
    const std::string said = tgconvert(scratch, "in.glb " + out + " --no-psnr --overwrite").out;
    CHECK((said.find(", " + std::to_string(texels) + " texels") != said.npos) == format.holds(kKeepsTextures));
  }
}

TEST_CASE("an empty file name is refused as such") {
  const Scratch scratch;
  for (const char* arguments : {"''", "'' out.ply", "in.ply ''", "check ''", "in.ply out.glb --views ''"}) {
    CAPTURE(arguments);
    const Result refused = tgconvert(scratch, arguments);
    CHECK(refused.code == 1);
    CHECK(refused.err.find(": an empty file name\n") != std::string::npos);
    CHECK(std::count(refused.err.begin(), refused.err.end(), '\n') == 1);
  }
}

TEST_CASE("a texel step for a model without textures is said to do nothing") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 10, 3.0, 49));
  const Result done = tgconvert(scratch, "in.ply a.sog --texture-step 0.1");
  CHECK(done.code == 0);
  CHECK_THAT(done.err, Contains("--texture-step does nothing: the model has no textures"));
}

TEST_CASE("a model without Gaussians has no bounds") {
  const Scratch scratch;
  writeBundle(scratch.folder() / "empty.tgz", Bundle());
  const Result info = tgconvert(scratch, "empty.tgz --info");
  CHECK(info.code == 0);
  CHECK(info.out.find("bounds: ") == std::string::npos);
  CHECK_FALSE(nlohmann::json::parse(tgconvert(scratch, "empty.tgz --info --json").out).contains("bounds"));
}

TEST_CASE("a background that a file does not say is not known, and no black one") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 10, 3.0, 49));
  CHECK_THAT(tgconvert(scratch, "in.ply --info").out, Contains("\nbackground: not known\n"));
  CHECK(nlohmann::json::parse(tgconvert(scratch, "in.ply --info --json").out)["background"].is_null());
  Bundle white;
  white.background = glm::vec3(1);
  writeBundle(scratch.folder() / "white.tgz", white);
  CHECK_THAT(tgconvert(scratch, "white.tgz --info").out, Contains("\nbackground: (1, 1, 1)\n"));
  CHECK(nlohmann::json::parse(tgconvert(scratch, "white.tgz --info --json").out)["background"].size() == 3);
}

TEST_CASE("a slip in an expression is told what it may have meant") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 10, 3.0, 49));
  const Result refused = tgconvert(scratch, "in.ply out.ply --keep 'opacty > 0.1'");
  CHECK(refused.code == 1);
  CHECK(refused.err.find("unknown value opacty, did you mean opacity? (expected NAME") != std::string::npos);
}

TEST_CASE("of a folder that is given for a model the file is named that is one") {
  const Scratch scratch;
  std::filesystem::create_directory(scratch.folder() / "in");
  const auto said = [&] { return tgconvert(scratch, "in out.ply").err; };
  writeBundle(scratch.folder() / "in/model.tgz", Bundle());
  scratch.write("in/meta.json", R"({"name": "a data set"})");
  scratch.write("in/lod-meta.json", "");
  CHECK_THAT(said(), Contains("in: is a folder (did you mean in/model.tgz?)"));
  scratch.write("in/meta.json", R"({"means": {}, "scales": {}})");
  CHECK_THAT(said(), Contains("(did you mean in/meta.json?)"));
  scratch.write("in/lod-meta.json", R"({"lodLevels": 1})");
  CHECK_THAT(said(), Contains("(did you mean in/lod-meta.json?)"));
  for (const char* name : {"model.tgz", "meta.json", "lod-meta.json"}) {
    scratch.write(std::string("in/") + name, "what a reader knows nothing of");
  }
  CHECK_THAT(said(), Contains("--to is missing"));
}

TEST_CASE("tgconvert writes SPZ 4, and 3 where it is asked for") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 50, 3.0, 45));
  REQUIRE(tgconvert(scratch, "in.ply new.spz --quiet").code == 0);
  REQUIRE(tgconvert(scratch, "in.ply old.spz --quiet --spz-version 3").code == 0);
  CHECK(Glb::slurp(scratch.folder() / "new.spz").starts_with(std::string("NGSP\4\0\0\0", 8)));
  CHECK(Glb::slurp(scratch.folder() / "old.spz").starts_with("\x1f\x8b"));
  const Result none = tgconvert(scratch, "in.ply none.spz --spz-version 5");
  CHECK(none.code == 1);
  CHECK(none.err.find("--spz-version") != std::string::npos);
}

TEST_CASE("tgconvert edits in the order of its options, merges inputs and refuses what splats cannot follow") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::mixed, 44, 50);
  Bundle bundle;
  bundle.model = scene.model;
  bundle.cameras = {scene.camera};
  writeBundle(scratch.folder() / "in.tgz", bundle);

  // The same format, negative numbers, one option twice.
  const Result edited = tgconvert(
      scratch, "in.tgz out.tgz --translate -1,0,2 --keep 'index < 40' --translate 1,0,-2 --keep 'index < 20' --json");
  REQUIRE(edited.code == 0);
  const auto json = nlohmann::json::parse(edited.out);
  REQUIRE(json["edits"].size() == 4);
  CHECK(json["edits"][1]["before"] == 50);
  CHECK(json["edits"][1]["after"] == 40);
  CHECK(json["edits"][3]["after"] == 20);
  const Bundle out = readBundle(scratch.folder() / "out.tgz");
  REQUIRE(out.model.size() == 20);
  CHECK(glm::distance(out.model.mean[7], scene.model.mean[7]) < 1e-5f);
  REQUIRE(out.cameras.size() == 1);

  const Result merged = tgconvert(scratch, "in.tgz out.tgz in.tgz all.glb");
  CHECK(merged.code == 0);
  CHECK(merged.out.find("--merge out.tgz: 50 -> 70 Gaussians") != std::string::npos);
  CHECK(merged.out.find("120 Gaussians, SH degree 3, 2 cameras") != std::string::npos);
  CHECK(tgconvert(scratch, "in.tgz none.tgz --texel-budget 0").out.find("textures: none") != std::string::npos);
  CHECK(tgconvert(scratch, "in.tgz few.ply --decimate 10 --no-textures --sh-degree 1").out.find(" dB against before") !=
        std::string::npos);
  CHECK(readModel(scratch.folder() / "few.ply").model.size() == 10);

  CHECK(tgconvert(scratch, "in.tgz b.glb --scale -1").err ==
        "tgconvert: --scale -1: the transform mirrors (expected a rotation, one positive scale, a translation)\n");
  CHECK(tgconvert(scratch, "in.tgz b.glb --scale 1,1,2").code == 1);
  CHECK(tgconvert(scratch, "in.tgz b.glb --keep 'weight > 3'").code == 1);
  CHECK(tgconvert(scratch, "in.tgz b.glb --crop-sphere 100,100,100,1").code == 3);
  CHECK(tgconvert(scratch, "in.tgz b.glb --merge missing.ply").code == 2);
  CHECK(tgconvert(scratch, "in.tgz b.glb --decimate 120%").code == 1);
  CHECK(!std::filesystem::exists(scratch.folder() / "b.glb"));
}

TEST_CASE("tgconvert turns a folder of models into another, and says which failed") {
  const Scratch scratch;
  std::filesystem::create_directory(scratch.folder() / "in");
  for (const unsigned seed : {1u, 2u, 3u}) {
    GaussianModel model = test::makeScene(test::SceneKind::ordinary, seed, 20).model;
    writeSplatPly(scratch.folder() / "in" / (std::to_string(seed) + ".ply"), model);
  }
  scratch.write("in/readme.txt", "no model");
  scratch.write("in/notes.json", "{\"a\": 1}");  // what a .gltf may begin like, and a .sog
  scratch.write("in/papers.zip", "PK\3\4");
  const Result good = tgconvert(scratch, "in out --to glb --keep 'index < 10'");
  CHECK(good.code == 0);
  CHECK(good.err.empty());  // no progress where there is no terminal
  CHECK(good.out.find("2.ply: 10 Gaussians, ") != std::string::npos);
  CHECK(good.out.find("3 models written, 0 failed") != std::string::npos);
  CHECK(readModel(scratch.folder() / "out" / "3.glb").model.size() == 10);

  scratch.write("in/4.ply", "ply\nformat ascii 1.0\nend_header\n");
  const Result again = tgconvert(scratch, "in out --to glb --json");
  CHECK(again.code == 4);  // the first failure: 1.glb exists
  CHECK(nlohmann::json::parse(again.out)["models"].size() == 4);
  const Result broken = tgconvert(scratch, "in out --to glb --overwrite --quiet");
  CHECK(broken.code == 3);
  CHECK(broken.out.empty());
  CHECK(broken.err.find("4.ply") != std::string::npos);
  CHECK(readModel(scratch.folder() / "out" / "3.glb").model.size() == 20);

  const Result cropped = tgconvert(scratch, "in out --to glb --overwrite --quiet --crop-sphere 1000,0,0,1");
  CHECK(cropped.err.find("3.ply: --crop-sphere 1000,0,0,1: no Gaussian is left") != std::string::npos);

  CHECK(tgconvert(scratch, "in out").code == 1);
  CHECK(tgconvert(scratch, "in out --to obj").code == 1);
  std::filesystem::create_directory(scratch.folder() / "empty");
  CHECK(tgconvert(scratch, "empty out --to glb").code == 2);
}

TEST_CASE("names of files reach the terminal without their control characters and are said once") {
  const Scratch scratch;
  const std::string name = "\x1b[31mred", shown = "?[31mred";
  std::filesystem::create_directories(scratch.folder() / "in" / name);
  const GaussianModel model = test::makeScene(test::SceneKind::ordinary, 1, 20).model;
  writeSplatPly(scratch.folder() / "in" / (name + ".ply"), model);
  scratch.write("in/" + name + "2.ply", "ply\nformat ascii 1.0\nend_header\n");
  const std::string folder = "\"in/$(printf '\\033[31mred')\"";
  const Result written = tgconvert(scratch, "in out --to splat");
  CHECK(written.code == 3);
  CHECK(written.out.find(shown + ".ply: 20 Gaussians, ") != std::string::npos);
  CHECK(written.out.find("\n" + shown + "2.ply: failed: in/" + shown + "2.ply: ") != std::string::npos);
  const Result again = tgconvert(scratch, "in " + folder + " --to tgz --quiet");
  CHECK(again.err.find("tgconvert: in/" + shown + "2.ply: ") == 0);
  const Result single = tgconvert(scratch, folder + ".ply " + folder + "/a.splat");
  CHECK(single.code == 0);
  for (const Result& result : {written, again, single}) {
    CHECK((result.out + result.err).find('\x1b') == std::string::npos);
    CHECK(result.err.find("2.ply: in/") == std::string::npos);
    CHECK(result.out.find("2.ply: in/" + shown + "2.ply: in/") == std::string::npos);
  }
  CHECK(single.err.find("warning: in/" + shown + ".ply: ") == 0);
  writeBundle(scratch.folder() / "none.tgz", {});
  for (const auto& [output, flags] : {std::pair<std::string, std::string>{"/none.html", ""}, {".glb", " --dry-run"}}) {
    const Result none = tgconvert(scratch, "none.tgz " + folder + output + flags);
    CHECK(none.code == 3);
    CHECK(none.err == "tgconvert: in/" + shown + output + ": the model has no Gaussians\n");
  }
}

TEST_CASE("what is named as a model in a folder and is none fails and other files are left aside") {
  const Scratch scratch;
  const std::filesystem::path in = scratch.folder() / "in";
  std::filesystem::create_directories(in / "folder.ply");
  writeSplatPly(in / "good.ply", randomSplats(1, 10, 3.0, 45));
  scratch.write("in/empty.spz", "");
  scratch.write("in/Missing.SOG", "<html>404");
  scratch.write("in/lod-meta.json", "404");
  Bundle bundle;
  bundle.model = randomSplats(1, 10, 3.0, 45);
  writeBundle(in / "bundle.splat", bundle);
  std::filesystem::create_symlink("nowhere", in / "link.ply");
  std::filesystem::create_symlink("circle.ply", in / "circle.ply");
  for (const char* other : {"index.html", "._good.ply", "meta.json", "atlas.png", "buffer.bin", "ply"}) {
    scratch.write(std::string("in/") + other, "404");
  }
  const Result result = tgconvert(scratch, "in out --to spz");
  const std::string expected = "Missing.SOG: failed: in/Missing.SOG: is no splat model (expected a " +
                               listed(inputNames()) +
                               " file)\n"
                               "bundle.splat: 10 Gaussians, ";
  CHECK(result.out.starts_with(expected));
  CHECK(result.out.find("circle.ply: failed: in/circle.ply: cannot open: ") != std::string::npos);
  CHECK(result.out.find("empty.spz: failed: in/empty.spz: the file is empty\n") != std::string::npos);
  CHECK(result.out.find("link.ply: failed: in/link.ply: no such file\n") != std::string::npos);
  CHECK(result.out.find("lod-meta.json: failed: in/lod-meta.json: is no splat model") != std::string::npos);
  CHECK(result.out.find("2 models written, 5 failed") != std::string::npos);
  CHECK(result.code == 3);  // the first one's: of an unknown content
}

TEST_CASE("a folder with a tileset and its content holds one model") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 10, 3.0, 45));
  REQUIRE(tgconvert(scratch, "in.ply t/tileset.json").code == 0);
  REQUIRE(tgconvert(scratch, "in.ply t/near.tileset.json").code == 0);
  scratch.write("t/far.tileset.json",
                R"({"asset": {"version": "1.1"}, "geometricError": 1, "root": {"contents": [{"uri": "content.glb"},)"
                R"( {"uri": "near.content.glb"}]}})");
  std::filesystem::remove(scratch.folder() / "t/near.content.glb");
  const Result result = tgconvert(scratch, "t out --to ply");
  CHECK(result.code == 0);
  CHECK(result.out.find("1 models written, 0 failed") != std::string::npos);
  CHECK(std::filesystem::exists(scratch.folder() / "out/content.ply"));
  CHECK(!std::filesystem::exists(scratch.folder() / "out/tileset.ply"));
}

TEST_CASE("a tileset of textured content is read with its textures and with its base alone") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 8, 20);
  writeGlb(scratch.folder() / "content.glb", {scene.model, {}, glm::vec3(0.0f), {}});
  scratch.write("tileset.json",
                R"({"asset": {"version": "1.0"}, "geometricError": 1, "root": {"content": {"uri": "content.glb"}}})");
  CHECK(tgconvert(scratch, "tileset.json all.tgz --no-psnr").code == 0);
  CHECK(tgconvert(scratch, "tileset.json base.tgz --no-psnr --base-only").code == 0);
  CHECK(isTextured(readModel(scratch.folder() / "all.tgz").model));
  CHECK(!isTextured(readModel(scratch.folder() / "base.tgz").model));
}

TEST_CASE("two models of a folder that differ by their format's name alone are two files, and warnings are told") {
  const Scratch scratch;
  std::filesystem::create_directory(scratch.folder() / "in");
  writeSplatPly(scratch.folder() / "in" / "a.ply", randomSplats(1, 50, 3.0, 45));
  REQUIRE(tgconvert(scratch, "in/a.ply in/a.compressed.ply --quiet").code == 0);
  const Result both = tgconvert(scratch, "in out --to splat");
  CHECK(both.code == 0);
  CHECK(std::filesystem::exists(scratch.folder() / "out" / "a.splat"));
  CHECK(std::filesystem::exists(scratch.folder() / "out" / "a.compressed.splat"));
  CHECK(both.err ==
        "warning: in/a.compressed.ply: .splat holds no SH: colours are those of degree 0\n"
        "warning: in/a.ply: .splat holds no SH: colours are those of degree 0\n");
  CHECK(tgconvert(scratch, "in out --to splat --overwrite --quiet").err.empty());
  const Result one = tgconvert(scratch, "in plain --to ply");  // a.compressed.ply is no PLY
  CHECK(one.code == 1);
  CHECK(one.err.find("a.ply: two models would become plain/a.ply") != std::string::npos);
  std::filesystem::remove(scratch.folder() / "out" / "a.splat");
  std::filesystem::create_symlink("a.compressed.splat", scratch.folder() / "out" / "a.splat");
  const Result linked = tgconvert(scratch, "in out --to splat --overwrite");
  CHECK(linked.code == 1);
  CHECK(linked.err.find("a.ply: two models would become out/a.splat") != std::string::npos);
}

TEST_CASE("a model of a folder that does not fit into memory is no broken file") {
  const Scratch scratch;
  const std::string limit = "ulimit -v 1000000; ";
  TG_SKIP_IF(tgconvert(scratch, "--version", limit).code != 0 ? "the program itself needs more memory" : "");
  // Sparse: 20 million Gaussians of 14 floats take no room on the disk.
  std::filesystem::create_directory(scratch.folder() / "in");
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex 20000000\n";
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
                           "rot_0", "rot_1", "rot_2", "rot_3"}) {
    header += std::string("property float ") + name + "\n";
  }
  header += "end_header\n";
  std::filesystem::resize_file(scratch.write("in/large.ply", header), header.size() + 20'000'000ull * 14 * 4);
  const Result refused = tgconvert(scratch, "in out --to spz", limit);
  CHECK(refused.code == 5);
  CHECK(refused.out.find("large.ply: the model does not fit into memory") != std::string::npos);
}

TEST_CASE("a level of detail takes no memory for Gaussians whose images are not there") {
  const Scratch scratch;
  const std::string limit = "ulimit -v 1000000; ";
  TG_SKIP_IF(tgconvert(scratch, "--version", limit).code != 0 ? "the program itself needs more memory" : "");
  constexpr int kCount = 20'000'000;
  const nlohmann::json range = {{"file", 0}, {"offset", 0}, {"count", kCount}};
  const nlohmann::json box = {{"min", {0, 0, 0}}, {"max", {1, 1, 1}}};
  scratch.write("lod-meta.json", nlohmann::json{{"lodLevels", 1},
                                                {"filenames", {"a/meta.json"}},
                                                {"tree", {{"bound", box}, {"lods", {{"0", range}}}}}}
                                     .dump());
  std::filesystem::create_directory(scratch.folder() / "a");
  const auto of = [](const std::vector<std::string>& files) {
    return nlohmann::json{{"codebook", {0}}, {"files", files}, {"mins", {0, 0, 0}}, {"maxs", {1, 1, 1}}};
  };
  nlohmann::json meta = {{"version", 2},
                         {"count", kCount},
                         {"means", of({"l.webp", "u.webp"})},
                         {"scales", of({"s.webp"})},
                         {"quats", of({"q.webp"})},
                         {"sh0", of({"c.webp"})},
                         {"shN", of({"p.webp", "n.webp"})}};
  meta["shN"]["bands"] = 3;
  scratch.write("a/meta.json", meta.dump());
  const Result refused = tgconvert(scratch, "check lod-meta.json", limit);
  CHECK(refused.code == 3);
  CHECK(refused.out.find("l.webp") != std::string::npos);
}

TEST_CASE("tgconvert check lists what is wrong, with JSON pointers and an exit code") {
  const Scratch scratch;
  writeGlb(scratch.folder() / "good.glb",
           {test::makeScene(test::SceneKind::ordinary, 43, 12).model, {}, glm::vec3(0.0f)});
  const Result good = tgconvert(scratch, "check good.glb");
  CHECK(good.code == 0);
  CHECK(good.out == "good.glb: valid, 0 errors, 0 warnings\n");
  scratch.write("text.md", "no model");
  CHECK(tgconvert(scratch, "check text.md").out.find("text.md: not valid, 1 error, 0 warnings\n") != std::string::npos);
  CHECK(tgconvert(scratch, "check good.glb --quiet").out.empty());

  Glb glb = Glb::read(scratch.folder() / "good.glb");
  glb.textures()["mode"] = "rgbx";
  glb.json["extensionsUsed"] = {"KHR_gaussian_splatting"};
  glb.json["extensionsRequired"] = {"KHR_gaussian_splatting"};
  glb.accessor("POSITION").erase("min");
  scratch.write("bad.glb", glb.bytes());
  const Result bad = tgconvert(scratch, "check bad.glb --json");
  CHECK(bad.code == 3);
  const auto json = nlohmann::json::parse(bad.out);
  CHECK(json["valid"] == false);
  REQUIRE(json["errors"].size() == 3);
  CHECK(json["errors"][0]["pointer"] ==
        "/meshes/0/primitives/0/extensions/KHR_gaussian_splatting/extensions/TG_gaussian_splatting_texture");
  CHECK(json["errors"][0]["message"].get<std::string>().find("unknown \"mode\"") == 0);
  CHECK(json["errors"][1]["pointer"] == "/extensionsUsed");
  CHECK(json["errors"][2]["pointer"] == "/meshes/0/primitives/0/attributes/POSITION");
  REQUIRE(json["warnings"].size() == 1);
  CHECK(json["warnings"][0]["pointer"] == "/extensionsRequired");

  // All that is wrong, not the first of it.
  glb.textures()["extent"] = -1;
  glb.textures()["filter"] = "cubic";
  glb.primitive()["attributes"].erase("KHR_gaussian_splatting:SCALE");
  glb.primitive()["attributes"].erase("TG_gaussian_splatting_texture:RECT");
  glb.primitive()["mode"] = 4;
  glb.json["extensionsUsed"] = {"KHR_gaussian_splatting", "TG_gaussian_splatting_texture"};
  scratch.write("worse.glb", glb.bytes());
  const Result worse = tgconvert(scratch, "check worse.glb");
  CHECK(worse.code == 3);
  for (const char* part : {"unknown \"mode\"", "\"extent\" is not supported", "\"filter\" is not supported",
                           "KHR_gaussian_splatting:SCALE is missing", "TG_gaussian_splatting_texture:RECT is missing",
                           "/meshes/0/primitives/0/mode: wrong mode", "worse.glb: not valid, 7 errors"}) {
    CAPTURE(part);
    CHECK(worse.out.find(part) != std::string::npos);
  }

  scratch.write("cut.spz", std::string("NGSP\3\0\0\0", 8));
  CHECK(tgconvert(scratch, "check cut.spz").code == 3);
  CHECK(tgconvert(scratch, "check missing.glb").code == 2);
  CHECK(tgconvert(scratch, "check").code == 1);
}

TEST_CASE("a disk that is full keeps the files of a .gltf and of pictures as they were") {
  const Scratch scratch;
  const auto saved = [&](const char* name, std::uint32_t seed) {
    Bundle bundle;
    bundle.model = test::makeScene(test::SceneKind::ordinary, seed, 2000).model;
    REQUIRE(bundle.model.texture_mode == TextureMode::rgba);
    writeBundle(scratch.folder() / name, bundle);
  };
  saved("old.tgz", 44);
  saved("new.tgz", 45);
  const auto contents = [&] {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(scratch.folder() / "out")) {
      files[entry.path().filename().string()] = Glb::slurp(entry.path());
    }
    return files;
  };
  // Writes beyond 24 KiB fail: the pictures of the textures fit, the numbers of the Gaussians do not.
  const std::string full = "ulimit -f 48; ";
  for (const std::string out : {"out/a.gltf", "out/a.png", "out/a.html"}) {
    CAPTURE(out);
    std::filesystem::remove_all(scratch.folder() / "out");
    std::filesystem::create_directory(scratch.folder() / "out");
    const Result first = tgconvert(scratch, "new.tgz --texture-size 1x1 " + out, full);
    CHECK(first.code == 4);
    CHECK(first.err.find("out/a.") != std::string::npos);  // no temporary name
    CHECK(contents().empty());
    REQUIRE(tgconvert(scratch, "old.tgz --texture-size 1x1 " + out).code == 0);
    const auto before = contents();
    CHECK(tgconvert(scratch, "new.tgz --texture-size 1x1 --overwrite " + out, full).code == 4);
    CHECK(contents() == before);
  }
}

TEST_CASE("a trial that finds no room is told of the folder for temporary files") {
  const Scratch scratch;
  Bundle bundle;
  bundle.model = test::makeScene(test::SceneKind::ordinary, 48, 2000).model;
  writeBundle(scratch.folder() / "in.tgz", bundle);
  const std::filesystem::path place = scratch.folder() / "temporary";
  std::filesystem::create_directory(place);
  for (const std::string arguments : {"a.sog --target-size 60KB", "a.html --target-psnr 30",
                                      "a.gltf --target-size 60KB", "a.ply --dry-run", "a: b.ply --dry-run"}) {
    CAPTURE(arguments);
    const std::string output = arguments.substr(0, arguments.find(" --"));
    const Result result = tgconvert(scratch, "in.tgz '" + output + "'" + arguments.substr(output.size()),
                                    "export TMPDIR='" + place.string() + "'; ulimit -f 8; ");
    CHECK(result.code == 4);
    CHECK_THAT(result.err, Catch::Matchers::StartsWith("tgconvert: " + place.string() + ": cannot ") &&
                               Catch::Matchers::EndsWith(" (a trial of " + output + ", in the temporary folder)\n"));
  }
}

TEST_CASE("what an earlier .gltf referred to and the new one does not is named and stays") {
  const Scratch scratch;
  const std::string sample = std::filesystem::absolute("docs/sample.tgz").string() + " out/a.gltf --no-psnr ";
  std::filesystem::create_directory(scratch.folder() / "out");
  const Result first = tgconvert(scratch, sample);
  REQUIRE(first.code == 0);
  REQUIRE(std::filesystem::exists(scratch.folder() / "out/a_atlas_0_color.png"));
  const std::string stays = " stays beside a.gltf, which referred to it before\n";
  CHECK(tgconvert(scratch, sample + "--overwrite").err == first.err);  // by files of the same names
  const Result dry = tgconvert(scratch, sample + "--overwrite --no-textures --dry-run");
  CHECK_THAT(dry.err, !Contains(stays));
  const Result bare = tgconvert(scratch, sample + "--overwrite --no-textures");
  CHECK(bare.code == 0);
  CHECK_THAT(bare.err, Contains("a_atlas_0_color.png" + stays) && !Contains("a.bin"));
  CHECK(std::filesystem::exists(scratch.folder() / "out/a_atlas_0_color.png"));
  CHECK_THAT(tgconvert(scratch, sample + "--overwrite --no-textures").err, !Contains(stays));
  const std::string buffers = R"([{"uri": "./a.bin"}, {"uri": "."}, {"uri": "none.bin"}, {"uri": "./in.bin"}, 3])";
  scratch.write("out/a.gltf", R"({"asset": {"version": "2.0"}, "buffers": )" + buffers + "}");
  scratch.write("out/in.bin", "");
  const Result other = tgconvert(scratch, sample + "--overwrite --no-textures");
  CHECK_THAT(other.err, Contains(": in.bin" + stays) && !Contains("a.bin") && !Contains("none.bin"));
  CHECK_THAT(other.err, !Contains(": ." + stays));
  scratch.write("out/a.gltf", "no glTF");
  CHECK(tgconvert(scratch, sample + "--overwrite").code == 0);
}

TEST_CASE("files beside a .gltf or a picture are replaced by --overwrite only") {
  const Scratch scratch;
  Bundle bundle;
  bundle.model = test::makeScene(test::SceneKind::ordinary, 47, 20).model;
  writeBundle(scratch.folder() / "in.tgz", bundle);
  for (const auto& [out, beside] : std::map<std::string, std::string>{{"a.gltf", "a.bin"},
                                                                      {"b.gltf", "b_atlas_0_color.png"},
                                                                      {"c.png", "c.json"},
                                                                      {"d.png", "d_alpha.png"},
                                                                      {"e.tileset.json", "e.content.glb"}}) {
    CAPTURE(out);
    scratch.write(beside, "mine");
    const Result refused = tgconvert(scratch, "in.tgz " + out);
    CHECK(refused.code == 4);
    CHECK(refused.err == "tgconvert: " + beside + ": exists already (--overwrite replaces it)\n");
    CHECK(Glb::slurp(scratch.folder() / beside) == "mine");
    CHECK(!std::filesystem::exists(scratch.folder() / out));
    CHECK(tgconvert(scratch, "in.tgz --dry-run " + out).code == 0);
    CHECK(tgconvert(scratch, "in.tgz --overwrite " + out).code == 0);
    CHECK(Glb::slurp(scratch.folder() / beside) != "mine");
  }
}

TEST_CASE("a link into another folder is no name for what is written as several files") {
  const Scratch scratch;
  namespace fs = std::filesystem;
  Bundle bundle;
  bundle.model = test::makeScene(test::SceneKind::ordinary, 48, 20).model;
  writeBundle(scratch.folder() / "in.tgz", bundle);
  fs::create_directory(scratch.folder() / "far");
  fs::create_directory(scratch.folder() / "near");
  const auto countIn = [&](const std::string& folder) {
    return std::distance(fs::recursive_directory_iterator(scratch.folder() / folder), {});
  };
  for (const std::string name : {"a.gltf", "b.tileset.json", "c.png", "lod-meta.json"}) {
    CAPTURE(name);
    REQUIRE(tgconvert(scratch, "in.tgz far/" + name).code == 0);
    const std::string older = Glb::slurp(scratch.folder() / "far" / name);
    fs::create_symlink("../far/" + name, scratch.folder() / "near" / name);
    const auto far = countIn("far"), near = countIn("near");
    const Result refused = tgconvert(scratch, "in.tgz --overwrite --quiet near/" + name);
    CHECK(refused.code == 4);
    CHECK(refused.err == "tgconvert: near/" + name +
                             ": is a symbolic link into another folder, and its other files lie beside it (expected "
                             "near/../far/" +
                             name + ")\n");
    CHECK(Glb::slurp(scratch.folder() / "far" / name) == older);
    CHECK(countIn("far") == far);
    CHECK(countIn("near") == near);
  }
  // A .gltf names its files, those of a .png are found by its name.
  fs::create_symlink("d.png", scratch.folder() / "link.png");
  const Result other_name = tgconvert(scratch, "in.tgz link.png");
  CHECK(other_name.code == 4);
  CHECK(other_name.err.find("link.png: is a symbolic link to another name, by which its other files are called") !=
        std::string::npos);
  fs::create_symlink("d.gltf", scratch.folder() / "link.gltf");
  CHECK(tgconvert(scratch, "in.tgz link.gltf").code == 0);
  CHECK(tgconvert(scratch, "check d.gltf").code == 0);
  CHECK(tgconvert(scratch, "check link.gltf").code == 0);
}

TEST_CASE("of several that write one file at once without --overwrite one wins and the others say so") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 3000, 3.0, 48));
  for (const std::string out : {"a.tgz", "a.glb", "a.gltf", "a.sog", "a.spz", "a.ply", "a.html"}) {
    CAPTURE(out);
    const std::string one = "'" TG_CONVERT_PROGRAM "' in.ply " + out + " --quiet 2>err-$i";
    const std::string script = "cd '" + scratch.folder().string() + "'; rm -f err-*; for i in 1 2 3 4; do (" + one +
                               "; echo $? >code-$i) & done; wait; cat code-* | sort | tr -d '\\n' >codes";
    REQUIRE(std::system(script.c_str()) == 0);
    CHECK(Glb::slurp(scratch.folder() / "codes") == "0444");
    for (const char* i : {"1", "2", "3", "4"}) {
      const std::string said = Glb::slurp(scratch.folder() / (std::string("err-") + i));
      CHECK((said.empty() || said.ends_with(": exists already (--overwrite replaces it)\n")));
    }
    CHECK(readModel(scratch.folder() / out).model.size() == 3000);
  }
}

TEST_CASE("a thread that cannot start is an error of the machine") {
  TG_SKIP_IF(TG_THREAD_SANITIZER ? "ThreadSanitizer ends such a program itself" : "");
  const Scratch scratch;
  Bundle bundle;
  bundle.model = randomSplats(1, 50, 3.0, 50);
  writeBundle(scratch.folder() / "in.tgz", bundle);
  // No memory is left for a stack of this size; the first thread has its own.
  const Result refused = tgconvert(scratch, "in.tgz out.ply", "ulimit -s 200000000000 || exit 5; ");
  CHECK(refused.code == 5);
  CHECK(refused.err.find("tgconvert: no thread can be started: ") == 0);
}

TEST_CASE("options that do nothing for what is written or read are refused") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 50, 3.0, 45));
  for (const std::string arguments :
       {"in.ply a.ply --quantize", "in.ply a.sog --meshopt", "in.ply a.spz --lean", "in.ply a.splat --atlas png16",
        "in.ply a.ply --steps 2", "in.ply a.png --psnr", "in.ply a.tgz --target-size 1KB",
        "in.ply a.tgz --texture-step 0.1", "in.ply a.glb --spz-version 3", "in.ply a.glb --spz-axes rdf",
        "in.ply a.glb --base-only", "in.ply a.ply --views none.json", "in.ply a.glb --to glb", "in.ply .compressed.ply",
        "in.ply .glb"}) {
    CAPTURE(arguments);
    const Result refused = tgconvert(scratch, arguments);
    CHECK(refused.code == 1);
    CHECK(refused.err.starts_with("tgconvert: "));
  }
  CHECK(tgconvert(scratch, "in.ply a.ply --quantize").err ==
        "tgconvert: --quantize does nothing here: it is only for .glb, .gltf or .html\n");
  CHECK(!std::filesystem::exists(scratch.folder() / "a.ply"));
  CHECK(tgconvert(scratch, "in.ply a.glb --base-only").err ==
        "tgconvert: --base-only does nothing here: it is only for a .sog, meta.json, lod-meta.json, tileset.json, "
        ".glb, .gltf or "
        ".html that is read\n");
  std::istringstream words(tgconvert(scratch, "--help").out);
  std::string help;
  for (std::string word; words >> word;) help += word + " ";
  CHECK_THAT(help, Contains("that know none, of .sog, meta.json, lod-meta.json, tileset.json, .glb, .gltf or .html "));
  CHECK(tgconvert(scratch, "in.ply a.html --atlas exr").err ==
        "tgconvert: --atlas: a page reads no EXR (expected png8, png16 or webp, found \"exr\")\n");
  // One format's files keep it in their names' ends.
  std::filesystem::create_directory(scratch.folder() / "packed");
  REQUIRE(tgconvert(scratch, "in.ply packed/a.compressed.ply --quiet").code == 0);
  REQUIRE(tgconvert(scratch, "packed plain --to ply --quiet").code == 0);
  CHECK(detectFormat(scratch.folder() / "plain" / "a.ply").name == "ply");
}

TEST_CASE("options that do nothing in a folder, beside --info and before check are refused") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 50, 3.0, 45));
  std::filesystem::create_directory(scratch.folder() / "folder");
  std::filesystem::copy(scratch.folder() / "in.ply", scratch.folder() / "folder");
  for (const std::string arguments :
       {"in.ply a.spz --no-cameras", "in.ply a.html --lean", "folder a --to glb --base-only",
        "folder a --to glb --spz-axes rdf", "folder a --to spz --no-cameras", "in.ply --info --decimate 10",
        "in.ply in.ply null", "in.ply --info --quantize --steps 2", "in.ply --stats --target-size 1KB",
        "in.ply null --overwrite", "in.ply a.glb --dry-run --psnr", "--overwrite --quantize check in.ply",
        "--json check in.ply"}) {
    CAPTURE(arguments);
    CHECK(tgconvert(scratch, arguments).code == 1);
  }
  CHECK(tgconvert(scratch, "in.ply b.ply --info").err ==
        "tgconvert: \"b.ply\" does nothing beside --info, --stats or null: nothing is written\n");
  CHECK(tgconvert(scratch, "in.ply nofile.ply check in.ply").err ==
        "tgconvert: \"in.ply\" does nothing before check (expected check FILE [--json] [--quiet])\n");
  CHECK(tgconvert(scratch, "in.ply null --stats --info --json").code == 0);
}

TEST_CASE("tgconvert reads SPZ of the axes that it is told, in merged files, too") {
  const Scratch scratch;
  const GaussianModel model = randomSplats(1, 50, 3.0, 45);
  writeSplatPly(scratch.folder() / "in.ply", model);
  REQUIRE(tgconvert(scratch, "in.ply a.spz --quiet").code == 0);
  REQUIRE(tgconvert(scratch, "a.spz same.ply --quiet").code == 0);
  REQUIRE(tgconvert(scratch, "a.spz a.spz other.ply --spz-axes rdf --quiet").code == 0);
  const GaussianModel same = readModel(scratch.folder() / "same.ply").model;
  const GaussianModel other = readModel(scratch.folder() / "other.ply").model;
  CHECK(largest(same.mean[7] - model.mean[7]) < 1e-3);
  REQUIRE(other.size() == 100);
  for (const std::size_t i : {7, 57}) {
    const glm::vec3 turned(model.mean[7].x, -model.mean[7].y, -model.mean[7].z);
    CHECK(largest(other.mean[i] - turned) < 1e-3);
  }
  CHECK(tgconvert(scratch, "a.spz b.ply --spz-axes up").code == 1);
  CHECK(tgconvert(scratch, "a.spz x.glb --dry-run")
            .out.find("axes: x right, y up, z back (SPZ) -> +y up, +z forward "
                      "(glTF), a half turn about y") != std::string::npos);
  CHECK(tgconvert(scratch, "a.spz x.ply --dry-run").out.find("(COLMAP), a half turn about x") != std::string::npos);
  CHECK(tgconvert(scratch, "a.spz x.ply --dry-run --spz-axes rdf").out.find("(COLMAP), kept") != std::string::npos);
  const Result json = tgconvert(scratch, "in.ply x.spz --dry-run --json");
  CHECK(nlohmann::json::parse(json.out)["output"]["axes"] == "x right, y up, z back (SPZ)");
}

TEST_CASE("a model in several files has the bytes of all, whatever it is called") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 300, 3.0, 48));
  const auto bytesOf = [&](const std::string& file) {
    const Result json = tgconvert(scratch, "'" + file + "' x.tgz --dry-run --json");
    CAPTURE(json.err);
    REQUIRE(json.code == 0);
    return nlohmann::json::parse(json.out)["input"]["bytes"].get<std::uint64_t>();
  };
  const auto inFolder = [&](const std::string& folder) {
    std::uint64_t bytes = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(scratch.folder() / folder)) {
      if (entry.is_regular_file()) bytes += entry.file_size();
    }
    return bytes;
  };
  for (const std::string file : {"a/12:30.gltf", "b/back\\slash.gltf", "c/100%.gltf", "d/lod-meta.json"}) {
    CAPTURE(file);
    const std::string folder = file.substr(0, 1);
    std::filesystem::create_directory(scratch.folder() / folder);
    REQUIRE(tgconvert(scratch, "in.ply '" + file + "' --quiet").code == 0);
    CHECK(bytesOf(file) == inFolder(folder));
    CHECK(tgconvert(scratch, "check '" + file + "'").code == 0);
  }
}

TEST_CASE("what a format cannot hold is clipped or not counted") {
  const Scratch scratch;
  GaussianModel model = randomSplats(3, 20, 3.0, 49);
  model.log_scale[4].y = 100.0f;
  writeSplatPly(scratch.folder() / "in.ply", model);
  for (const auto& [file, options] : std::initializer_list<std::pair<const char*, const char*>>{
           {"a.glb", ""}, {"a.gltf", ""}, {"a.splat", ""}, {"a.html", ""}, {"rounded.glb", " --quantize"}}) {
    CAPTURE(file);
    const Result written = tgconvert(scratch, std::string("in.ply --no-psnr ") + file + options);
    CHECK(written.code == 0);
    CHECK(written.err.find("1 splats with a scale above e^88.7, which no float holds: clipped") != std::string::npos);
    CHECK(tgconvert(scratch, std::string("check ") + file).code == 0);
    CHECK(readModel(scratch.folder() / file).model.size() == 20);
  }
  CHECK(tgconvert(scratch, "in.ply b.splat --no-psnr").out.find("20 Gaussians, SH degree 0") != std::string::npos);
  CHECK(tgconvert(scratch, "in.ply b.glb --no-psnr").out.find("20 Gaussians, SH degree 3") != std::string::npos);
  std::filesystem::create_directory(scratch.folder() / "all");
  writeSplatPly(scratch.folder() / "all/in.ply", model);
  CHECK(tgconvert(scratch, "all out --to ply --dry-run").out.find("1 models would be written") != std::string::npos);
}

TEST_CASE("a link that leads to itself is nothing to read or to write") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", randomSplats(1, 10, 3.0, 50));
  std::filesystem::create_symlink("loop.glb", scratch.folder() / "loop.glb");
  CHECK(tgconvert(scratch, "loop.glb out.ply").code == 2);
  const Result written = tgconvert(scratch, "in.ply loop.glb");
  CHECK(written.code == 4);
  CHECK(written.err.find("loop.glb: cannot write here: ") != std::string::npos);
  CHECK(tgconvert(scratch, std::string(300, 'n') + ".ply out.ply").code == 2);
}

TEST_CASE("merged models count the cameras that they share once, and no edit leaves a camera nowhere") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 49, 20);
  Bundle bundle;
  bundle.model = scene.model;
  bundle.cameras = {scene.camera, scene.camera};
  bundle.cameras[1].translation.x += 1000.0;
  writeBundle(scratch.folder() / "a.tgz", bundle);
  bundle.cameras[0].translation.y += 1.0;
  writeBundle(scratch.folder() / "b.tgz", bundle);
  CHECK(tgconvert(scratch, "a.tgz b.tgz c.tgz").out.find("40 Gaussians, SH degree 3, 3 cameras") != std::string::npos);
  const Result lost = tgconvert(scratch, "a.tgz d.tgz --scale 1e36");
  CHECK(lost.code == 3);
  CHECK(lost.err.find("--scale 1e36: a camera's position is not finite") != std::string::npos);
  CHECK(!std::filesystem::exists(scratch.folder() / "d.tgz"));
}

TEST_CASE("named views go from file to file, move with the model, and are missed where they find no room") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 71, 30);
  Bundle bundle;
  bundle.model = scene.model;
  bundle.views = {scene.camera};
  bundle.views[0].name = "door";
  Written written;
  writeModel(*findFormat("glb"), scratch.folder() / "in.glb", bundle, {}, written);
  CHECK(tgconvert(scratch, "in.glb --info").out.find("named views: 1\n") != std::string::npos);
  REQUIRE(tgconvert(scratch, "in.glb page.html --translate 1,0,0").code == 0);
  REQUIRE(tgconvert(scratch, "page.html out.gltf --translate 0,1,0").code == 0);
  const std::vector<Camera> views = readModel(scratch.folder() / "out.gltf").views;
  REQUIRE(views.size() == 1);
  CHECK(views[0].name == "door");
  CHECK(glm::length(views[0].position() - scene.camera.position() - glm::dvec3(1, 1, 0)) < 1e-6);
  CHECK(tgconvert(scratch, "in.glb lost.tgz").err.find("a bundle holds no named views: they are left out") !=
        std::string::npos);
  REQUIRE(tgconvert(scratch, "in.glb bare.glb --no-cameras").code == 0);
  CHECK(readModel(scratch.folder() / "bare.glb").views.empty());
  REQUIRE(tgconvert(scratch, "in.glb in.glb merged.glb").code == 0);
  CHECK(readModel(scratch.folder() / "merged.glb").views.size() == 1);
  REQUIRE(tgconvert(scratch, "lost.tgz in.glb bare2.glb --no-cameras").code == 0);
  CHECK(readModel(scratch.folder() / "bare2.glb").views.empty());
  scratch.write("none.json", "[]");
  const Result none = tgconvert(scratch, "in.glb none.glb --views none.json");
  CHECK(none.code == 3);
  CHECK(none.err.find("none.json: no cameras (expected one at least)") != std::string::npos);
}

TEST_CASE("an edited model says so of its scores, and a merged one takes the background that is known") {
  const Scratch scratch;
  Bundle bundle;
  bundle.model = randomSplats(1, 50, 3.0, 50);
  bundle.background = glm::vec3(1.0f);
  bundle.training_json = "{\"stages\": {}}";
  writeBundle(scratch.folder() / "a.tgz", bundle);
  REQUIRE(tgconvert(scratch, "a.tgz same.tgz").code == 0);
  CHECK_FALSE(wasEdited(readModel(scratch.folder() / "same.tgz").training_json));
  REQUIRE(tgconvert(scratch, "a.tgz less.tgz --decimate 50%").code == 0);
  CHECK(wasEdited(readModel(scratch.folder() / "less.tgz").training_json));
  writeSplatPly(scratch.folder() / "b.ply", bundle.model);
  bundle.background = glm::vec3(0.0f, 0.0f, 1.0f);
  writeBundle(scratch.folder() / "blue.tgz", bundle);
  REQUIRE(tgconvert(scratch, "b.ply a.tgz both.tgz").code == 0);
  CHECK(readModel(scratch.folder() / "both.tgz").background == glm::vec3(1.0f));
  REQUIRE(tgconvert(scratch, "b.ply b.glb").code == 0);  // which does not know more
  REQUIRE(tgconvert(scratch, "b.glb a.tgz both.glb").code == 0);
  CHECK(readModel(scratch.folder() / "both.glb").background == glm::vec3(1.0f));
  const Result two = tgconvert(scratch, "a.tgz blue.tgz two.tgz");
  CHECK(two.err.find("blue.tgz: another background, left aside (0, 0, 1 beside 1, 1, 1)") != std::string::npos);
  CHECK(readModel(scratch.folder() / "two.tgz").background == glm::vec3(1.0f));
  bundle.background = glm::vec3(0.0f);
  writeBundle(scratch.folder() / "black.tgz", bundle);
  REQUIRE(tgconvert(scratch, "b.ply black.tgz a.tgz first.tgz").code == 0);
  CHECK(readModel(scratch.folder() / "first.tgz").background == glm::vec3(0.0f));
  bundle.training_json = "{\"edited\": false}";
  writeBundle(scratch.folder() / "odd.tgz", bundle);
  REQUIRE(tgconvert(scratch, "odd.tgz odder.tgz --decimate 50%").code == 0);
  CHECK(wasEdited(readModel(scratch.folder() / "odder.tgz").training_json));
}

TEST_CASE("every merged file is read as the first one is, and the warning of a stopped training stays") {
  const Scratch scratch;
  Bundle bundle;
  bundle.model = test::makeScene(test::SceneKind::ordinary, 49, 20).model;
  writeBundle(scratch.folder() / "whole.tgz", bundle);
  REQUIRE(tgconvert(scratch, "whole.tgz a.glb --quiet").code == 0);
  const Result base = tgconvert(scratch, "a.glb a.glb base.glb --base-only");
  CHECK(base.code == 0);
  CHECK(base.out.find("textures: none\n") != std::string::npos);

  bundle.training_json = R"({"interrupted":true})";
  writeBundle(scratch.folder() / "stopped.tgz", bundle);
  CHECK(tgconvert(scratch, "stopped.tgz whole.tgz b.glb --no-psnr").err ==
        "warning: stopped.tgz: its training was interrupted: no finished model\n");
  CHECK(tgconvert(scratch, "whole.tgz stopped.tgz c.glb --no-psnr").err ==
        "warning: whole.tgz: stopped.tgz: its training was interrupted: no finished model\n");
}

TEST_CASE("output that is lost on a full disk is a failure, and --version is one line") {
  const Scratch scratch;
  writeSplatPly(scratch.folder() / "in.ply", test::makeScene(test::SceneKind::ordinary, 46, 5).model);
  for (const char* arguments : {"in.ply --info", "check in.ply", "--help", "in.ply out.glb"}) {
    CAPTURE(arguments);
    const std::string command =
        "cd '" + scratch.folder().string() + "' && '" TG_CONVERT_PROGRAM "' " + arguments + " >/dev/full 2>err.txt";
    CHECK(WEXITSTATUS(std::system(command.c_str())) == 4);
    CHECK(Glb::slurp(scratch.folder() / "err.txt").starts_with("tgconvert: standard output: cannot write"));
  }
  const Result version = tgconvert(scratch, "--version");
  CHECK(version.code == 0);
  CHECK(version.out.starts_with("tgconvert "));
  const Result twice = tgconvert(scratch, "in.ply --info --to glb --to ply");
  CHECK(twice.code == 1);
  CHECK(twice.err == "tgconvert: --to is given more than once (see --help)\n");
}

TEST_CASE("tgconvert writes what it says and refuses with one line and the right code") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(test::SceneKind::ordinary, 41, 50).model;
  writeSplatPly(scratch.folder() / "in.ply", model);

  const Result first = tgconvert(scratch, "in.ply a.glb");
  CHECK(first.code == 0);
  CHECK(first.err.empty());
  CHECK(first.out.find("50 Gaussians, SH degree 3") != std::string::npos);
  CHECK(first.out.find("a half turn about z") != std::string::npos);

  const Result again = tgconvert(scratch, "in.ply a.glb");
  CHECK(again.code == 4);
  CHECK(again.err == "tgconvert: a.glb: exists already (--overwrite replaces it)\n");
  CHECK(tgconvert(scratch, "in.ply a.glb --overwrite --quiet").code == 0);

  const Result json = tgconvert(scratch, "a.glb b.ply --json");
  REQUIRE(json.code == 0);
  CHECK(nlohmann::json::parse(json.out)["gaussians"] == 50);
  CHECK(nlohmann::json::parse(json.out)["input"]["file_format"] == "glb");
  CHECK(nlohmann::json::parse(json.out)["output"]["file_format"] == "ply");

  const Result info = tgconvert(scratch, "a.glb --info --json");
  REQUIRE(info.code == 0);
  CHECK(nlohmann::json::parse(info.out)["sh_degree"] == 3);

  CHECK(tgconvert(scratch, "").code == 1);
  CHECK(tgconvert(scratch, "in.ply").code == 1);
  CHECK(tgconvert(scratch, "in.ply b.obj").code == 1);
  CHECK(tgconvert(scratch, "in.ply b.glb --no-such-option").code == 1);
  CHECK(tgconvert(scratch, "--help").code == 0);
  CHECK(tgconvert(scratch, "missing.ply b.glb").code == 2);
  CHECK(tgconvert(scratch, ". b.glb").code == 1);  // a folder: --to is missing
  scratch.write("empty.glb", "");
  CHECK(tgconvert(scratch, "empty.glb b.glb").code == 3);
  CHECK(tgconvert(scratch, "in.ply no/such/folder/b.glb").code == 4);
  scratch.write("folder.txt", "");
  CHECK(tgconvert(scratch, "in.ply folder.txt/b.glb").code == 4);
  CHECK(!std::filesystem::exists(scratch.folder() / "b.glb"));

  std::size_t files = 0;  // no temporary file is left
  for (const auto& entry : std::filesystem::directory_iterator(scratch.folder())) files += entry.is_regular_file();
  CHECK(files == 7);  // in.ply a.glb b.ply empty.glb folder.txt out.txt err.txt
}
