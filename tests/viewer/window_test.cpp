// SPDX-License-Identifier: Apache-2.0
// The real window, under a virtual X server: what is on screen is what --render writes.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <thread>

#include "core/metrics.h"
#include "core/ply.h"
#include "process.h"
#include "render/renderer.h"
#include "support/catch.h"

using namespace tg;
using test::ProcessResult;
using test::Workshop;

namespace {

const std::vector<std::string> kXServer = {"xvfb-run", "-a", "-s", "-screen 0 1024x768x24"};

bool haveWindow() { return test::haveXServer() && test::haveVulkan(); }

// Runs a script in a window, under validation.
void play(const Workshop& shop, const std::string& script, const std::string& size,
          const std::string& backend = "vulkan") {
  shop.write("script.txt", script);
  const ProcessResult result = shop.tgview(
      {"model.tgz", "--script", "script.txt", "--size", size, "--backend", backend, "--validation"}, kXServer);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(result.err.find("vulkan:") == std::string::npos);
}

Image render(const Workshop& shop, std::vector<std::string> flags) {
  flags.insert(flags.begin(), {"model.tgz", "--render", "render.png", "--backend", "vulkan"});
  const ProcessResult result = shop.tgview(flags);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  return shop.read("render.png");
}

}  // namespace

TEST_CASE("the window shows every output as --render writes it, before and after a resize") {
  if (!haveWindow()) return;
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  std::string script = "panel off\nwait 2\n";
  const std::vector<std::string> outputs = {"final", "base", "texture", "alpha", "depth", "normal", "count"};
  for (const std::string& output : outputs) script += "output " + output + "\nwindow " + output + ".png\n";
  script += "output final\ntextures off\nwindow off.png\ntextures rgba\n";
  script += "hold-textures-off on\nwindow held.png\nhold-textures-off off\n";
  script += "size 300x260\norbit 20 -10\ndolly 0.9\nsave-camera camera.json\nwindow resized.png\npicture picture.png\n";
  play(shop, script, "240x180");
  for (const std::string& output : outputs) {
    INFO(output);
    CHECK(psnr(shop.read(output + ".png"), render(shop, {"--size", "240x180", "--show", output})) > 45);
  }
  const Image off = render(shop, {"--size", "240x180", "--textures", "off"});
  CHECK(psnr(shop.read("off.png"), off) > 45);
  CHECK(psnr(shop.read("held.png"), off) > 45);
  const Image resized = shop.read("resized.png");
  REQUIRE(resized.width == 300);
  REQUIRE(resized.height == 260);
  CHECK(psnr(resized, render(shop, {"--camera", "camera.json"})) > 45);
  CHECK(psnr(resized, shop.read("picture.png")) > 60);
}

TEST_CASE("the panel lies beside the picture and never changes it") {
  if (!haveWindow()) return;
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop, "wait 3\nsave-camera camera.json\npicture picture.png\nwindow window.png\n", "800x480");
  const Image window = shop.read("window.png");
  const Image picture = shop.read("picture.png");
  REQUIRE(window.width == 800);
  REQUIRE(picture.width < 600);
  REQUIRE(picture.height == 480);
  CHECK(psnr(picture, render(shop, {"--camera", "camera.json"})) > 45);
  // The right part of the window is the picture.
  double worst = 0;
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        worst = std::max(worst, double{std::abs(window.at(800 - picture.width + x, y, c) - picture.at(x, y, c))});
      }
    }
  }
  CHECK(worst == 0);
}

TEST_CASE("the CPU's pictures reach the window unchanged") {
  if (!haveWindow()) return;
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop, "panel off\nsave-camera camera.json\nsize 260x200\noutput normal\nwait 2\npicture picture.png\n",
       "240x180", "cpu");
  const ProcessResult result =
      shop.tgview({"model.tgz", "--render", "render.png", "--backend", "cpu", "--show", "normal", "--size", "260x200"});
  REQUIRE(result.exit_code == 0);
  CHECK(psnr(shop.read("picture.png"), shop.read("render.png")) > 60);
}

TEST_CASE("a broken file shows an error and leaves the old model; a good one replaces it") {
  if (!haveWindow()) return;
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  GaussianModel half = test::sampleModel();
  half.atlas = {};
  half.texture_mode = TextureMode::none;
  writeSplatPly(shop / "plain.ply", half);
  shop.write("broken.tgz", "not an archive");
  play(shop,
       "panel off\nwait 2\npicture before.png\nopen broken.tgz\nwindow error.png\nkey Esc\npicture after.png\n"
       "save-camera camera.json\nopen plain.ply\ncamera camera.json\npicture plain.png\n"
       "open model.tgz\ntextures off\nbackground black\ncamera camera.json\npicture textured.png\n",
       "240x180");
  CHECK(psnr(shop.read("before.png"), shop.read("error.png")) < 40);  // the error panel is there
  CHECK(psnr(shop.read("before.png"), shop.read("after.png")) > 60);
  // Untextured, model.tgz is plain.ply.
  CHECK(psnr(shop.read("plain.png"), shop.read("textured.png")) > 45);
}

TEST_CASE("a followed run folder is waited for, shown, and shown again from the same camera when it changes") {
  if (!haveWindow()) return;
  for (const char* backend : {"vulkan", "cpu"}) {
    const Workshop shop;
    shop.write("script.txt",
               "wait 3\nwindow waiting.png\nawait 1\norbit 20 -10\nsave-camera camera.json\npicture first.png\n"
               "await 2\nwindow panel.png\npicture second.png\n");
    // A training run, seen from outside: the model comes late, half of it first; then another one.
    std::thread trainer([&] {
      const auto awaitFile = [&](const std::string& name) {
        for (int i = 0; i < 6000 && !std::filesystem::exists(shop / name); ++i) {
          std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
      };
      awaitFile("waiting.png");
      std::filesystem::create_directory(shop / "run");
      shop.write("run/model.tgz", "half a model");
      std::this_thread::sleep_for(std::chrono::milliseconds(700));
      test::writeSample(shop / "run/model.tgz");
      awaitFile("first.png");
      test::writeSample(shop / "run/model.tgz", 90);
      std::filesystem::copy(shop / "run/model.tgz", shop / "model.tgz");
    });
    const ProcessResult result = shop.tgview(
        {"--follow", "run", "--script", "script.txt", "--size", "800x480", "--backend", backend, "--validation"},
        kXServer);
    trainer.join();
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    CHECK(result.err.find("vulkan:") == std::string::npos);
    const Image second = shop.read("second.png");
    CHECK(psnr(second, render(shop, {"--camera", "camera.json"})) > 45);
    CHECK(psnr(second, shop.read("first.png")) < 45);
  }
}

TEST_CASE("without a display, a followed model is rendered whenever it changes, until its training is finished") {
  const Workshop shop;
  test::writeSample(shop / "run.tgz", 400, R"({"interrupted": true, "stages": {"plain": {"iterations": 5}}})");
  std::thread trainer([&] {
    for (int i = 0; i < 6000 && !std::filesystem::exists(shop / "out.png"); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    test::writeSample(shop / "run.tgz", 90, R"({"interrupted": false, "stages": {"plain": {"iterations": 9}}})");
  });
  const ProcessResult result = shop.tgview({"--follow", "run.tgz", "--render", "out.png", "--backend", "cpu"});
  trainer.join();
  INFO(result.err);
  CHECK(result.exit_code == 0);
  CHECK_THAT(result.out, Catch::Contains("400 Gaussians") && Catch::Contains("plain 5"));
  CHECK_THAT(result.out, Catch::Contains("90 Gaussians") && Catch::Contains("plain 9"));
}

TEST_CASE("a script that is wrong or cannot write ends with its exit code") {
  if (!haveWindow()) return;
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("unknown.txt", "dance\n");
  shop.write("value.txt", "output red\n");
  shop.write("write.txt", "window no/such/folder/a.png\n");
  const auto run = [&shop](const std::string& script) {
    return shop.tgview({"model.tgz", "--size", "200x150", "--script", script}, kXServer).exit_code;
  };
  CHECK(run("missing.txt") == 2);
  CHECK(run("unknown.txt") == 3);
  CHECK(run("value.txt") == 3);
  CHECK(run("write.txt") == 4);
}
