// SPDX-License-Identifier: Apache-2.0
// The real window on scenes with levels of detail.
#include <filesystem>
#include <numeric>

#include "core/image/metrics.h"
#include "support/catch.h"
#include "viewer/levels.h"
#include "viewer/process.h"

using namespace tg;
using test::kXServer;
using test::noWindow;
using test::ProcessResult;
using test::Workshop;

namespace {

ProcessResult play(const Workshop& shop, std::vector<std::string> arguments, const std::string& script) {
  shop.write("script.txt", script);
  arguments.insert(arguments.end(), {"--script", "script.txt", "--size", "320x240", "--backend", "cpu"});
  ProcessResult result = shop.tgview(arguments, kXServer, TG_TGVIEW_UNDER_TEST);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  return result;
}

double meanOf(const Image& image) {
  return std::accumulate(image.data.begin(), image.data.end(), 0.0) / static_cast<double>(image.data.size());
}

}  // namespace

TEST_CASE("a window shows coarser levels where finer ones are late, then what --render writes of the same view",
          "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  const LodScene scene = test::writeLevels(shop / "scene/lod-meta.json");
  REQUIRE(scene.levels >= 3);
  play(
      shop, {"--splat-budget", "2500"},
      "panel off\nhold-finest on\nbegin-open scene/lod-meta.json\nawait-scene\noutput alpha\nwait 20\n"
      "picture held.png\nhold-finest off\nawait-open\npicture whole.png\noutput final\norbit 20 5\nsave-camera c.json\n"
      "picture turned.png\nsplat-budget 1000\npicture less.png\n");
  // Merged Gaussians cover a little less at their rims, but nothing is bare that is opaque in the end.
  const Image held = shop.read("held.png"), whole = shop.read("whole.png");
  CHECK(meanOf(whole) > 0.1);
  CHECK(meanOf(held) > 0.7 * meanOf(whole));
  CHECK(psnr(held, whole) < 40);  // it is coarser
  std::size_t opaque = 0, bare = 0;
  for (std::size_t i = 0; i < whole.data.size(); ++i) {
    opaque += whole.data[i] > 0.95f;
    bare += whole.data[i] > 0.95f && held.data[i] < 0.25f;
  }
  CHECK(opaque > 0);
  CHECK(bare * 100 < opaque);
  for (const auto& [picture, budget] : {std::pair("turned.png", "2500"), {"less.png", "1000"}}) {
    const ProcessResult result = shop.tgview({"scene/lod-meta.json", "--splat-budget", budget, "--render", "render.png",
                                              "--camera", "c.json", "--size", "320x240", "--backend", "cpu"});
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    CHECK(psnr(shop.read(picture), shop.read("render.png")) > 45);
  }
  CHECK(psnr(shop.read("turned.png"), shop.read("less.png")) < 45);
}

TEST_CASE("a recording in the window has the levels of each of its cameras", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  (void)test::writeLevels(shop / "scene/lod-meta.json");
  play(shop, {"scene/lod-meta.json", "--splat-budget", "1000"},
       "camera 1\nrecord-size 160x120\nrecord-frames 3\nrecord turn/####.png\nawait-recording\n");
  const ProcessResult result =
      shop.tgview({"scene/lod-meta.json", "--splat-budget", "1000", "--camera", "1", "--turntable", "3", "--size",
                   "160x120", "-o", "plain/####.png", "--backend", "cpu", "-q"});
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  for (const char* frame : {"/0000.png", "/0001.png", "/0002.png"}) {
    INFO(frame);
    CHECK(psnr(shop.read(std::string("turn") + frame), shop.read(std::string("plain") + frame)) > 45);
  }
}

TEST_CASE("a recording of a streamed scene waits while another model is shown, and is cancelled when it is closed",
          "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  (void)test::writeLevels(shop / "scene/lod-meta.json");
  test::writeSample(shop / "model.tgz");
  const std::vector<std::string> scene = {"scene/lod-meta.json", "--splat-budget", "1000"};
  const std::string begin = "panel off\nopen model.tgz\ndocument 0\ncamera 1\nrecord-size 160x120\n";
  play(shop, scene,
       begin +
           "record-frames 24\nrecord turn/####.png\nwait 2\ndocument 1\nwait 60\npicture other.png\ndocument 0\n"
           "await-recording\n");
  CHECK(shop.read("other.png").width == 320);
  ProcessResult result = shop.tgview({"model.tgz", "--render", "render.png", "--size", "320x240", "--backend", "cpu"});
  REQUIRE(result.exit_code == 0);
  CHECK(psnr(shop.read("other.png"), shop.read("render.png")) > 45);
  result = shop.tgview({"scene/lod-meta.json", "--splat-budget", "1000", "--camera", "1", "--turntable", "24", "--size",
                        "160x120", "-o", "plain/####.png", "--backend", "cpu", "-q"});
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  for (int i = 0; i < 24; ++i) {  // it was left in the middle
    const std::string frame = (i < 10 ? "/000" : "/00") + std::to_string(i) + ".png";
    INFO(frame);
    CHECK(psnr(shop.read("turn" + frame), shop.read("plain" + frame)) > 45);
  }
  play(shop, scene,
       begin +
           "record-frames 3000\nrecord closed/####.png\nwait 2\ndocument 1\nwait 2\nclose-document 0\n"
           "await-recording\npicture left.png\n");
  CHECK_FALSE(std::filesystem::exists(shop / "closed/2999.png"));
  CHECK(psnr(shop.read("left.png"), shop.read("render.png")) > 45);
}

TEST_CASE("a window with a file of chunks that is truncated goes on, and ends by itself", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  const LodScene scene = test::writeLevels(shop / "scene/lod-meta.json");
  const std::filesystem::path broken = shop / "scene" / scene.files[scene.leaves[0].levels[0].file];
  std::filesystem::resize_file(broken.parent_path() / "quats.webp", 40);
  play(shop, {"scene/lod-meta.json", "--splat-budget", "4000"},
       "keep-going on\nwindow broken.png\npanel off\npicture a.png\n");
  CHECK(meanOf(shop.read("a.png")) > 0.1);
}
