// SPDX-License-Identifier: Apache-2.0
// tgview --output: paths and turntables to pictures and videos.
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>

#include "converter/registry/file_format.h"
#include "core/bundle/bundle.h"
#include "core/bundle/camera_file.h"
#include "core/file/json.h"
#include "core/image/metrics.h"
#include "support/catch.h"
#include "viewer/picture/frame_writer.h"
#include "viewer/process.h"
#include "viewer/view/camera_path.h"

using namespace tg;
using test::ProcessResult;
using test::Workshop;

namespace {

std::size_t filesIn(const std::filesystem::path& folder) {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++count;
  return count;
}

ProcessResult tgview(const Workshop& shop, std::vector<std::string> flags) {
  flags.insert(flags.begin(), {"model.tgz", "--backend", "cpu"});
  return shop.tgview(flags);
}

// The frames of a video as pictures frame0001.png and so on.
void unpack(const Workshop& shop, const std::string& video) {
  const std::string command = "cd '" + (shop / ".").string() + "' && ffmpeg -loglevel error -i " + video +
                              " frame%04d.png >/dev/null 2>&1 </dev/null";
  REQUIRE(std::system(command.c_str()) == 0);
}

}  // namespace

TEST_CASE("a turntable's frames are what --render makes of its cameras") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const ProcessResult result = tgview(shop, {"--turntable", "4", "-o", "turn", "--show", "depth", "--size", "80x60"});
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK_THAT(result.out, Contains("turn/####.png: 4 frames of 80x60, depth"));
  CHECK(filesIn(shop / "turn") == 4);
  REQUIRE(tgview(shop, {"--render", "first.png", "--show", "depth", "--size", "80x60"}).exit_code == 0);
  CHECK(psnr8Bit(shop.read("turn/0000.png"), shop.read("first.png")) > 60);
  CHECK(psnr8Bit(shop.read("turn/0002.png"), shop.read("first.png")) < 40);
}

TEST_CASE("a path of two keys begins and ends with their pictures, cameras.json is a path too") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  std::vector<Camera> cameras = {lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 96, 72),
                                 lookAt({3, -1, -2}, {0, 0, 0}, {0, -1, 0}, 0.6, 96, 72)};
  shop.write("cameras.json", formatCameras(cameras));
  shop.write("path.json", formatPath(pathOf(cameras, 1, "")));
  shop.write("last.json", formatCameras({cameras[1]}));
  for (const char* path : {"cameras.json", "path.json"}) {
    const ProcessResult result =
        tgview(shop, {"--path", path, "--fps", "4", "-o", std::string(path) + "_frames/##.png", "--size", "96x72"});
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    CHECK(filesIn(shop / (std::string(path) + "_frames")) == 5);
  }
  for (const auto& [camera, frame] : {std::pair{"cameras.json", "00"}, {"last.json", "04"}}) {
    REQUIRE(tgview(shop, {"--render", "a.png", "--camera", camera}).exit_code == 0);
    CHECK(psnr8Bit(shop.read("a.png"), shop.read(std::string("path.json_frames/") + frame + ".png")) > 60);
    CHECK(psnr8Bit(shop.read("a.png"), shop.read(std::string("cameras.json_frames/") + frame + ".png")) > 60);
  }
}

TEST_CASE("a path along the model's own cameras begins and ends with their pictures") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  Bundle bundle = readBundle(shop / "model.tgz");
  bundle.cameras = {lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 96, 72),
                    lookAt({3, -1, -2}, {0, 0, 0}, {0, -1, 0}, 0.6, 96, 72)};
  writeBundle(shop / "model.tgz", bundle);
  shop.write("cameras.json", formatCameras(bundle.cameras));
  Written written;
  std::filesystem::create_directory(shop / "levels");
  writeModel(*findFormat("lod-meta.json"), shop / "levels/lod-meta.json", bundle, {}, written);
  writeModel(*findFormat("gltf"), shop / "S.GLTF", bundle, {}, written);
  std::filesystem::copy_file(shop / "model.tgz", shop / "model.tar.gz");
  for (const std::string path : {"cameras.json", "model.tgz", "model.tar.gz", "S.GLTF", "levels/lod-meta.json"}) {
    const ProcessResult result = tgview(shop, {"--path", path, "--fps", "4", "-o", "frames/##.png", "--size", "96x72"});
    INFO(path << result.err);
    REQUIRE(result.exit_code == 0);
    CHECK(filesIn(shop / "frames") == 5);
    for (const auto& [camera, frame] : {std::pair{"0", "00"}, {"1", "04"}}) {
      REQUIRE(tgview(shop, {"--render", "a.png", "--camera", camera}).exit_code == 0);
      CHECK(psnr8Bit(shop.read("a.png"), shop.read(std::string("frames/") + frame + ".png")) > 60);
    }
    std::filesystem::remove_all(shop / "frames");
  }
  bundle.cameras.clear();
  writeBundle(shop / "model.tgz", bundle);
  const ProcessResult refused = tgview(shop, {"--path", "model.tgz", "-o", "frames"});
  CHECK(refused.exit_code == 3);
  CHECK_THAT(refused.err, Contains("model.tgz: the model has no cameras to fly along (expected one at least"));
  CHECK_FALSE(std::filesystem::exists(shop / "frames"));
}

TEST_CASE("numbers are recorded as EXR") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  REQUIRE(tgview(shop, {"--turntable", "2", "-o", "f/#.exr", "--show", "alpha"}).exit_code == 0);
  CHECK(shop.read("f/1.exr").channels == 1);
}

TEST_CASE("a turntable can be seen from above, from afar, around another axis") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const auto first = [&](std::vector<std::string> flags) {
    flags.insert(flags.end(), {"--turntable", "1", "-o", "f/#.png"});
    const ProcessResult result = tgview(shop, flags);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return shop.read("f/0.png");
  };
  const Image low = first({"--elevation", "5", "--radius", "6"});
  CHECK(psnr8Bit(low, first({"--elevation", "60", "--radius", "6"})) < 40);
  CHECK(psnr8Bit(low, first({"--elevation", "5", "--radius", "12"})) < 40);
  CHECK(psnr8Bit(low, first({"--elevation", "5", "--radius", "6", "--up", "+x"})) < 40);
  CHECK(psnr8Bit(low, first({"--elevation", "5", "--radius", "6"})) > 60);
}

TEST_CASE("videos by ffmpeg show the frames, at even sizes") {
  TG_SKIP_IF(findProgram("ffmpeg").empty() ? "no ffmpeg" : "");
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const std::vector<std::string> shot = {"--turntable", "6", "--size", "161x119", "-o"};
  for (const char* video : {"a.mp4", "a.webm"}) {
    INFO(video);
    std::vector<std::string> flags = shot;
    flags.push_back(video);
    const ProcessResult result = tgview(shop, flags);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    CHECK_THAT(result.out, Contains("6 frames of 162x120"));
    unpack(shop, video);
    CHECK_FALSE(std::filesystem::exists(shop / "frame0007.png"));
    REQUIRE(tgview(shop, {"--turntable", "6", "--size", "162x120", "-o", "png"}).exit_code == 0);
    for (int i = 0; i < 6; i += 5) {
      const Image frame = shop.read("frame000" + std::to_string(i + 1) + ".png");
      REQUIRE(frame.width == 162);
      CHECK(psnr(frame, shop.read("png/000" + std::to_string(i) + ".png")) > 28);
    }
  }
}

TEST_CASE("a video whose end does not fit on the disk is no video") {
  TG_SKIP_IF(findProgram("ffmpeg").empty() ? "no ffmpeg" : "");
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  // Writes beyond 4 KiB fail as on a full disk; so short a video is written at its end only.
  const ProcessResult result = shop.tgview({"model.tgz", "--turntable", "3", "--size", "320x240", "-o", "a.mp4"},
                                           {"sh", "-c", "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\""});
  INFO(result.err);
  CHECK(result.exit_code == 4);
  CHECK_THAT(result.err, Contains("a.mp4: ffmpeg failed"));
  CHECK_FALSE(std::filesystem::exists(shop / "a.mp4"));
}

TEST_CASE("without ffmpeg a video ends with exit code 4 before any rendering") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const ProcessResult result =
      shop.tgview({"model.tgz", "--backend", "cpu", "--turntable", "4", "-o", "a.mp4"}, {"env", "PATH=/nonexistent"});
  CHECK(result.exit_code == 4);
  CHECK_THAT(result.err, Contains("a.mp4: a video needs the ffmpeg program"));
  CHECK_FALSE(std::filesystem::exists(shop / "a.mp4"));
}

TEST_CASE("the flag --benchmark prints medians, percentiles and passes as JSON, on both backends") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("path.json",
             formatPath(pathOf(std::vector<Camera>{lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 96, 72),
                                                   lookAt({3, -1, -2}, {0, 0, 0}, {0, -1, 0}, 0.6, 96, 72)},
                               1, "")));
  std::vector<std::string> backends = test::deviceBackends();
  backends.emplace_back("cpu");
  for (const std::string& backend : backends) {
    INFO(backend);
    const ProcessResult result =
        shop.tgview({"model.tgz", "--backend", backend, "--benchmark", "path.json", "--fps", "5", "--size", "96x72"});
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    const nlohmann::json json = parseJson(result.out, "stdout");
    CHECK(json["backend"] == backend);
    CHECK(json["path"]["frames"] == 6);
    CHECK(json["image"]["width"] == 96);
    CHECK(json["model"]["gaussians"] == 400);
    CHECK(json["model"]["bytes"] == std::filesystem::file_size(shop / "model.tgz"));
    CHECK_FALSE(json["passes_ms"].empty());
    for (const char* times : {"frame_ms", "cpu_ms"}) {
      const double low = json[times]["min"], median = json[times]["median"], p95 = json[times]["p95"],
                   high = json[times]["max"];
      CHECK(low > 0);
      CHECK(low <= median);
      CHECK(median <= p95);
      CHECK(p95 <= high);
    }
    for (const char* member : {"read_ms", "upload_ms", "first_frame_ms", "total_ms", "gb_per_s"}) {
      CHECK(json["load"][member].get<double>() > 0);
    }
  }
}

TEST_CASE("every wrong use of --output is one line and its exit code") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("bad.json", R"({"format":"tgview-path","version":1,"aspect":1,"keys":[]})");
  shop.write("long.json", R"({"format":"tgview-path","version":1,"aspect":1,"keys":[)"
                          R"({"time":0,"position":[0,0,0],"rotation":[1,0,0,0],"fov_y":40},)"
                          R"({"time":80000,"position":[0,0,0],"rotation":[1,0,0,0],"fov_y":40}]})");
  struct Case {
    std::vector<std::string> flags;
    int exit_code;
  };
  const std::vector<Case> cases = {
      {{"-o", "f"}, 1},
      {{"--turntable", "4"}, 1},
      {{"--window"}, 1},
      {{"--path", "bad.json", "--render", "a.png"}, 1},
      {{"--turntable", "0", "-o", "f"}, 1},
      {{"--turntable", "x", "-o", "f"}, 1},
      {{"--turntable", "2.9", "-o", "f"}, 1},
      {{"--turntable", "2", "-o", "f", "--splat-budget", "1000.5"}, 1},
      {{"--turntable", "4", "-o", "f.png"}, 1},
      {{"--turntable", "4", "-o", "f", "--render", "a.png"}, 1},
      {{"--turntable", "4", "-o", "f", "--path", "bad.json"}, 1},
      {{"--turntable", "4", "-o", "f", "--fps", "0"}, 1},
      {{"--turntable", "4", "-o", "f", "--up", "z"}, 1},
      {{"--turntable", "4", "-o", "f", "--elevation", "90"}, 1},
      {{"--path", "long.json", "-o", "f"}, 1},
      {{"--benchmark", "bad.json", "--script", "s"}, 1},
      {{"--benchmark", "missing.json"}, 2},
      {{"--benchmark", "bad.json"}, 3},
      {{"--path", "missing.json", "-o", "f"}, 2},
      {{"--path", "bad.json", "-o", "f"}, 3},
      {{"--turntable", "4", "-o", "model.tgz/f/#.png"}, 4},
  };
  for (const Case& wrong : cases) {
    const ProcessResult result = tgview(shop, wrong.flags);
    std::string line;
    for (const std::string& word : wrong.flags) line += " " + word;
    INFO("tgview" << line << "\n" << result.err);
    CHECK(result.exit_code == wrong.exit_code);
    CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
    CHECK_FALSE(std::filesystem::exists(shop / "f"));
  }
}

// Mesa keeps every program that it has compiled in a folder: what is new there was compiled.
TEST_CASE("software drivers compile nothing for another camera, nor for sizes that are powers of two") {
  TG_SKIP_IF(test::noDevice());
  bool counted = false;
  for (const std::string& backend : test::deviceBackends()) {
    CAPTURE(backend);
    const Workshop shop;
    test::writeSample(shop / "model.tgz");
    const std::filesystem::path cache = shop / "cache";
    // How many there are after a turn of so many pictures; those behind the first give it time to write them.
    const auto compiled = [&](const std::string& size, const std::string& frames, const std::string& show) {
      const ProcessResult result = shop.tgview({"model.tgz", "--turntable", frames, "-o", "turn" + frames, "--backend",
                                                backend, "--size", size, "--show", show},
                                               {"env", "MESA_SHADER_CACHE_DIR=" + cache.string()});
      INFO(result.err);
      REQUIRE(result.exit_code == 0);
      std::size_t programs = 0;
      if (std::filesystem::exists(cache)) {
        for (const auto& entry : std::filesystem::recursive_directory_iterator(cache)) {
          programs += entry.path().filename() != "index" && entry.is_regular_file();
        }
      }
      return programs;
    };
    for (const char* show : {"final", "ellipsoids"}) {
      CAPTURE(show);
      // On a loaded machine one may still be lost; then the next turn writes it.
      std::size_t programs = compiled("90x70", "6", show);
      for (std::size_t before = programs + 1; programs != before;) {
        before = programs;
        programs = compiled("90x70", "6", show);
      }
      if (programs == 0) {
        std::cout << "left out: " << backend << " keeps no compiled programs\n";
        break;
      }
      counted = true;
      CHECK(compiled("90x70", "11", show) == programs);
      CHECK(compiled("128x64", "6", show) == programs);
    }
  }
  TG_SKIP_IF(counted ? "" : "no driver keeps compiled programs");
}
