// SPDX-License-Identifier: Apache-2.0
// The real window, under a virtual X server: what is on screen is what --render writes.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/bundle/camera_file.h"
#include "core/bundle/ply.h"
#include "core/file/json.h"
#include "core/image/metrics.h"
#include "render/renderer.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "support/setting_values.h"
#include "viewer/process.h"
#include "viewer/view/session.h"

using namespace tg;
using test::backendOr;
using test::kXServer;
using test::noWindow;
using test::ProcessResult;
using test::Workshop;

namespace {

// Runs a script in a window, under validation.
void play(const Workshop& shop, const std::string& script, const std::string& size,
          const std::string& backend = backendOr("vulkan"), const std::vector<std::string>& more = {},
          const char* program = TG_TGVIEW) {
  shop.write("script.txt", script);
  std::vector<std::string> words = {"model.tgz", "--script",  "script.txt", "--size",
                                    size,        "--backend", backend,      "--validation"};
  words.insert(words.end(), more.begin(), more.end());
  const ProcessResult result = shop.tgview(words, kXServer, program);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(result.err.find(backendOr("vulkan") + ":") == std::string::npos);
}

Image render(const Workshop& shop, std::vector<std::string> flags) {
  flags.insert(flags.begin(), {"model.tgz", "--render", "render.png", "--backend", backendOr("vulkan")});
  const ProcessResult result = shop.tgview(flags);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  return shop.read("render.png");
}

}  // namespace

TEST_CASE("the window shows every output as --render writes it, before and after a resize", "[window]") {
  TG_SKIP_IF(noWindow());
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

TEST_CASE("the panel lies beside the picture and never changes it", "[window]") {
  TG_SKIP_IF(noWindow());
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

TEST_CASE("the CPU's pictures reach the window unchanged", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop, "panel off\nsave-camera camera.json\nsize 260x200\noutput normal\nwait 2\npicture picture.png\n",
       "240x180", "cpu");
  const ProcessResult result =
      shop.tgview({"model.tgz", "--render", "render.png", "--backend", "cpu", "--show", "normal", "--size", "260x200"});
  REQUIRE(result.exit_code == 0);
  CHECK(psnr(shop.read("picture.png"), shop.read("render.png")) > 60);
}

TEST_CASE("without Vulkan a window opens on OpenGL, on the device that draws windows") {
  TG_SKIP_IF(test::noWindow("opengl"));
  std::vector<std::string> no_vulkan = {"VK_DRIVER_FILES=/nonexistent.json", "VK_ICD_FILENAMES=/nonexistent.json"};
  no_vulkan.insert(no_vulkan.end(), kXServer.begin(), kXServer.end());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("script.txt", "panel off\nwait 2\npicture picture.png\n");
  const auto window = [&](const std::vector<std::string>& flags) {
    std::vector<std::string> all = {"model.tgz", "--script", "script.txt", "--size", "240x180"};
    all.insert(all.end(), flags.begin(), flags.end());
    return shop.tgview(all, no_vulkan);
  };
  const ProcessResult automatic = window({});
  INFO(automatic.err);
  REQUIRE(automatic.exit_code == 0);
  CHECK(shop.tgview({"model.tgz", "--render", "cpu.png", "--size", "240x180", "--backend", "cpu"}).exit_code == 0);
  CHECK(psnr(shop.read("picture.png"), shop.read("cpu.png")) > 45);
  CHECK(window({"--backend", "vulkan"}).exit_code == 5);
  const ProcessResult refused = window({"--backend", "opengl", "--device", "no such device"});
  CHECK(refused.exit_code == 5);
  CHECK_THAT(refused.err, Contains("lets OpenGL draw on") && Contains("expected \"no such device\""));
}

#ifdef TG_SHARED_PICTURES
TEST_CASE("pictures that share the window's textures reach it unchanged") {
  TG_SKIP_IF(test::noWindow("opengl"));
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const ProcessResult result = shop.tgview({"model.tgz"}, kXServer, TG_SHARED_PICTURES);
  INFO(result.err);
  CHECK(result.exit_code == 0);
}
#endif

// With blocks of memory that go at once, two runs of three ended in the driver when both threads shared a display.
TEST_CASE("on a software device the window's frames and the pictures of a turn leave each other's memory alone") {
  TG_SKIP_IF(test::noWindow("opengl"));
  const Workshop shop;
  test::writeSample(shop / "model.tgz", 30);
  shop.write("script.txt", "turntable on\nwait 300\n");
  std::vector<std::string> prefix = kXServer;
  prefix.insert(prefix.end(),
                {"env", "MALLOC_MMAP_THRESHOLD_=16384", "MALLOC_TRIM_THRESHOLD_=4096", "MALLOC_PERTURB_=165"});
  const ProcessResult result =
      shop.tgview({"model.tgz", "--script", "script.txt", "--size", "320x240", "--backend", "opengl"}, prefix);
  INFO(result.err);
  CHECK(result.exit_code == 0);
}

TEST_CASE("a broken file shows an error and leaves the old model, a good one replaces it", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  GaussianModel half = test::sampleModel();
  half.atlas = {};
  half.texture_mode = TextureMode::none;
  writeSplatPly(shop / "plain.ply", half);
  shop.write("broken.tgz", "not an archive");
  play(shop,
       "keep-going on\npanel off\nwait 2\npicture before.png\nopen broken.tgz\nwindow error.png\nkey Esc\n"
       "picture after.png\n"
       "save-camera camera.json\nopen plain.ply\ncamera camera.json\npicture plain.png\n"
       "open model.tgz\ntextures off\nbackground black\ncamera camera.json\npicture textured.png\n",
       "240x180");
  CHECK(psnr(shop.read("before.png"), shop.read("error.png")) < 40);  // the error panel is there
  CHECK(psnr(shop.read("before.png"), shop.read("after.png")) > 60);
  // Untextured, model.tgz is plain.ply.
  CHECK(psnr(shop.read("plain.png"), shop.read("textured.png")) > 45);
}

TEST_CASE("a followed run folder is waited for, shown, and shown again from the same camera when it changes",
          "[window]") {
  TG_SKIP_IF(noWindow());
  for (const std::string& backend : {backendOr("vulkan"), std::string("cpu")}) {
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
    CHECK(result.err.find(backendOr("vulkan") + ":") == std::string::npos);
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
  CHECK_THAT(result.out, Contains("400 Gaussians") && Contains("plain 5"));
  CHECK_THAT(result.out, Contains("90 Gaussians") && Contains("plain 9"));
}

TEST_CASE("every way of drawing is the same in the window and by its flags", "[window]") {
  TG_SKIP_IF(noWindow());
  std::vector<std::pair<std::string, std::vector<std::string>>> cases = {
      {"exposure -1", {"--exposure", "-1"}},
      {"output depth-median", {"--show", "depth-median"}},
      {"output overdraw", {"--show", "overdraw"}},
      {"output ellipsoids", {"--show", "ellipsoids"}},
      {"output centers", {"--show", "centers"}},
      {"output texel-density", {"--show", "texel-density"}},
      {"output texture\ngain 6", {"--show", "texture", "--gain", "6"}},
      {"output depth\ncolors turbo", {"--show", "depth", "--colors", "turbo"}},
      {"output count\ncolors viridis\nrange 2,98", {"--show", "count", "--colors", "viridis", "--range", "2,98"}},
      {"output overdraw\nrange 10,90", {"--show", "overdraw", "--range", "10,90"}},
  };
  for (const RenderSetting& setting : renderSettings()) {
    const std::string name(setting.name), value = test::otherValue(setting);
    if (!setting.title.empty()) cases.push_back({name + " " + value, {"--" + name, value}});
  }
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const auto rendered = [&shop](std::vector<std::string> flags, const std::string& backend) {
    flags.insert(flags.begin(), {"model.tgz", "--render", "render.png", "--backend", backend, "--size", "240x180"});
    const ProcessResult result = shop.tgview(flags);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return shop.read("render.png");
  };
  for (const std::string& backend : {std::string("cpu"), backendOr("vulkan")}) {
    std::size_t number = 0;
    for (const auto& [command, flags] : cases) {
      const std::string name = std::to_string(number++) + ".png";
      play(shop, "panel off\n" + command + "\nwait 2\npicture " + name + "\n", "240x180", backend);
      INFO(backend << ": " << command);
      CHECK(psnr(shop.read(name), rendered(flags, backend)) > 40);
    }
  }
}

TEST_CASE("any number of frames in flight, a moving camera, a storm of sizes and a lost device leave the right picture",
          "[window]") {
  TG_SKIP_IF(noWindow());
  for (const char* frames : {"1", "2"}) {
    const Workshop shop;
    test::writeSample(shop / "model.tgz");
    std::string script = "panel off\nwait 2\ncontinuous on\n";
    for (int i = 0; i < 12; ++i) script += "orbit 7 1\nwait 1\n";
    script += "save-camera turned.json\npicture turned.png\n";
    for (const char* size : {"300x200", "64x64", "240x180"}) {
      script += "size " + std::string(size) + "\noutput count\norbit 30 5\nwait 1\noutput final\n";
    }
    script += "compare side\nwait 2\ncompare off\nsave-camera stormed.json\npicture stormed.png\nwindow window.png\n";
    script += "orbit 5 5\nlose-device\nwait 5\norbit 5 5\nsave-camera lost.json\npicture lost.png\n";
    const std::string backend = backendOr("vulkan");
    std::vector<std::string> flags;
    if (backend == "vulkan") flags = {"--frames-in-flight", frames};
    play(shop, script, "240x180", backend, flags, TG_TGVIEW_UNDER_TEST);
    INFO(frames << " in flight");
    CHECK(psnr(shop.read("turned.png"), render(shop, {"--camera", "turned.json"})) > 45);
    const Image stormed = render(shop, {"--camera", "stormed.json"});
    CHECK(psnr(shop.read("stormed.png"), stormed) > 45);
    CHECK(psnr(shop.read("window.png"), stormed) > 45);
    CHECK(psnr(shop.read("lost.png"), render(shop, {"--camera", "lost.json"})) > 45);
  }
}

TEST_CASE("where Vulkan may not copy pictures into windows they are OpenGL's") {
  TG_SKIP_IF(test::noWindow("opengl"));
  TG_SKIP_IF(noWindow());
  std::vector<std::string> prefix = {"TG_NO_COPIES=1"};
  prefix.insert(prefix.end(), kXServer.begin(), kXServer.end());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("script.txt", "panel off\nwait 2\nwindow window.png\n");
  const auto window = [&](const std::string& backend) {
    return shop.tgview({"model.tgz", "--script", "script.txt", "--size", "240x180", "--backend", backend}, prefix,
                       TG_TGVIEW_UNDER_TEST);
  };
  const ProcessResult automatic = window("auto");
  INFO(automatic.err);
  REQUIRE(automatic.exit_code == 0);
  CHECK(psnr(shop.read("window.png"), render(shop, {"--size", "240x180"})) > 45);
  const ProcessResult refused = window("vulkan");
  CHECK(refused.exit_code == 5);
  CHECK_THAT(refused.err, Contains("does not let pictures be copied into a window"));
}

TEST_CASE("a window that the window system has no image for shows its picture later", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop,
       "panel off\nwait 2\nwithhold-images 7\norbit 10 0\nwait 1\nsave-camera turned.json\nwithhold-images 3\n"
       "window turned.png\n",
       "240x180", backendOr("vulkan"), {}, TG_TGVIEW_UNDER_TEST);
  CHECK(psnr(shop.read("turned.png"), render(shop, {"--camera", "turned.json"})) > 45);
}

TEST_CASE("a script whose window gets no image for too long ends and says so", "[window]") {
  TG_SKIP_IF(noWindow());
  TG_SKIP_IF(backendOr("vulkan") != "vulkan" ? "images are Vulkan's" : "");
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("script.txt", "wait 2\nwithhold-images 1e6\nwait 1\n");
  const ProcessResult result =
      shop.tgview({"model.tgz", "--script", "script.txt", "--size", "96x64", "--backend", "vulkan"}, kXServer,
                  TG_TGVIEW_UNDER_TEST);
  CHECK(result.exit_code == 5);
  CHECK_THAT(result.err, Contains("the window system takes no image"));
}

TEST_CASE("a script's patience with a window system begins when it takes no image and not with the frame before",
          "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  std::thread opener([&shop] {
    for (int i = 0; i < 6000 && !std::filesystem::exists(shop / "go.held"); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(3200));
    shop.write("go", "");
  });
  shop.write("script.txt", "wait 2\nwithhold-images 3\nhold-frame go\nwait 1\n");
  const ProcessResult result =
      shop.tgview({"model.tgz", "--script", "script.txt", "--size", "96x64", "--backend", backendOr("vulkan")},
                  kXServer, TG_TGVIEW_UNDER_TEST);
  opener.join();
  INFO(result.err);
  CHECK(result.exit_code == 0);
}

TEST_CASE("a benchmark whose window gets no image for too long ends and says so", "[window]") {
  TG_SKIP_IF(noWindow());
  TG_SKIP_IF(backendOr("vulkan") != "vulkan" ? "images are Vulkan's" : "");
  std::vector<std::string> prefix = {"TG_NO_IMAGES=1", "timeout", "60"};
  prefix.insert(prefix.end(), kXServer.begin(), kXServer.end());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("path.json", formatCameras({test::trainedLikeCamera(96, 72), test::trainedLikeCamera(96, 72)}));
  const ProcessResult result = shop.tgview(
      {"model.tgz", "--benchmark", "path.json", "--window", "--fps", "4", "--size", "96x64", "--backend", "vulkan"},
      prefix, TG_TGVIEW_UNDER_TEST);
  CHECK(result.exit_code == 5);
  CHECK_THAT(result.err, Contains("the window system takes no image"));
}

TEST_CASE("a window's device may fail again once it has shown its frames but not at once", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop,
       "panel off\nwait 2\nlose-window-device\nwait 150\nlose-window-device\nwait 3\nkey Esc\nsave-camera c.json\n"
       "window after.png\n",
       "120x90", backendOr("vulkan"), {}, TG_TGVIEW_UNDER_TEST);
  CHECK(psnr(shop.read("after.png"), render(shop, {"--camera", "c.json"})) > 45);
  shop.write("script.txt", "wait 2\nlose-window-device\nwait 3\nlose-window-device\nwait 3\n");
  const ProcessResult result =
      shop.tgview({"model.tgz", "--script", "script.txt", "--size", "96x64", "--backend", backendOr("vulkan")},
                  kXServer, TG_TGVIEW_UNDER_TEST);
  CHECK(result.exit_code == 5);
}

TEST_CASE("a view of more pairs than the device binds is drawn in parts without a message", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop,
       "panel off\nwait 2\norbit 10 0\noutput depth\npicture whole.png\ncrowd 50\noutput final\nwait 1\n"
       "save-camera c.json\nwindow parts.png\noutput depth\npicture depth.png\n",
       "240x180", backendOr("vulkan"), {}, TG_TGVIEW_UNDER_TEST);
  CHECK(psnr(shop.read("parts.png"), render(shop, {"--camera", "c.json"})) > 45);
  CHECK(psnr(shop.read("depth.png"), shop.read("whole.png")) > 45);
}

TEST_CASE("a picture that the device has no memory for is drawn in parts without a message", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop, "panel off\nwait 2\ncramp 50\norbit 10 0\nwait 1\nsave-camera c.json\nwindow parts.png\nrefused 2\n",
       "240x180", backendOr("vulkan"), {}, TG_TGVIEW_UNDER_TEST);
  CHECK(psnr(shop.read("parts.png"), render(shop, {"--camera", "c.json"})) > 45);
}

TEST_CASE("a picture that is under way while the one before it turns out to need parts is drawn again", "[window]") {
  TG_SKIP_IF(noWindow());
  TG_SKIP_IF(backendOr("vulkan") != "vulkan" ? "pictures overlap on Vulkan alone" : "");
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop,
       "panel off\nwait 2\ncontinuous on\ncrowd-of-two 50\nwait 2\ncontinuous off\norbit 10 0\nwait 1\nrefused 2\n"
       "save-camera c.json\nwindow parts.png\n",
       "240x180", "vulkan", {"--frames-in-flight", "2"}, TG_TGVIEW_UNDER_TEST);
  CHECK(psnr(shop.read("parts.png"), render(shop, {"--camera", "c.json"})) > 45);
}

TEST_CASE("a picture after one that was drawn in parts begins with parts", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  // 180 rows at once do not fit, nor do 90.
  play(shop,
       "panel off\nwait 2\ncrowd 50\noutput depth\nwait 1\nrefused 2\noutput final\nwait 1\nrefused 2\n"
       "output depth\nwait 1\nrefused 3\noutput final\nwait 1\nsave-camera c.json\nwindow parts.png\nrefused 3\n",
       "240x180", backendOr("vulkan"), {}, TG_TGVIEW_UNDER_TEST);
  CHECK(psnr(shop.read("parts.png"), render(shop, {"--camera", "c.json"})) > 45);
}

TEST_CASE("a picture begins with the parts that fitted its own size", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop,
       "panel off\nwait 2\ncrowd 50\noutput depth\nwait 1\nrefused 2\nresolution 0.5\nwait 1\nrefused 3\n"
       "resolution 1\nwait 1\nrefused 3\n",
       "240x180", backendOr("vulkan"), {}, TG_TGVIEW_UNDER_TEST);
}

TEST_CASE("two models in colours of one scale begin with the parts that fitted them", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::writeSample(shop / "other.tgz", 90);
  play(shop,
       "document 0\npanel off\noutput depth\ncompare side\nwait 1\nwindow whole.png\ncrowd 50\norbit 10 0\nwait 1\n"
       "refused 4\norbit -10 0\nwait 1\nrefused 4\nwindow parts.png\n",
       "240x180", backendOr("vulkan"), {"other.tgz"}, TG_TGVIEW_UNDER_TEST);
  CHECK(psnr(shop.read("parts.png"), shop.read("whole.png")) > 45);
}

TEST_CASE("the picture's resolution follows the state, the window's does not", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop, "panel off\nresolution 0.5\npicture half.png\nwindow window.png\n", "240x180");
  CHECK(shop.read("half.png").width == 120);
  CHECK(shop.read("window.png").width == 240);
  CHECK(psnr(shop.read("half.png"), render(shop, {"--size", "120x90"})) > 45);
}

TEST_CASE("bookmarks, up axes and key frames in the window are cameras elsewhere", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop,
       "panel off\npath-lines off\nwait 2\norbit 25 -10\nbookmark\npicture marked.png\nup +x\norbit 40 0\n"
       "picture away.png\ngo-bookmark 0\nup cameras\nsave-bookmarks marks.json\nadd-key\ndolly 0.7\norbit -30 5\n"
       "fov 60\nadd-key\nsave-path path.json\nsave-keys keys.json\nseek 1\npicture middle.png\n"
       "clear-path\nload-path keys.json\nshow-key 1\npicture end.png\n",
       "240x180");
  CHECK(psnr(shop.read("marked.png"), shop.read("away.png")) < 40);
  CHECK(psnr(shop.read("marked.png"), render(shop, {"--camera", "marks.json", "--size", "240x180"})) > 45);
  const ProcessResult result = shop.tgview({"model.tgz", "--path", "path.json", "--fps", "1", "-o", "f/#.png", "--size",
                                            "240x180", "--backend", backendOr("vulkan")});
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(psnr(shop.read("middle.png"), shop.read("f/1.png")) > 45);
  CHECK(psnr(shop.read("end.png"), shop.read("f/2.png")) > 45);
}

TEST_CASE("the turntable turns and the path plays while the window lives", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop,
       "panel off\nwait 2\npicture still.png\nturntable on\nwait 60\nturntable off\npicture turned.png\n"
       "camera 1\nadd-key\ncamera 2\nadd-key\nkey-seconds 0 0.1\npath-lines off\nshow-key 0\nplay on\nwait 600\n"
       "picture played.png\ncamera 2\npicture end.png\n",
       "240x180", "cpu");
  CHECK(psnr(shop.read("still.png"), shop.read("turned.png")) < 45);
  CHECK(psnr(shop.read("played.png"), shop.read("end.png")) > 60);
}

TEST_CASE("a picture that is saved while the camera moves by itself has its full size", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz", 20000);
  play(shop,
       "panel off\nwait 2\nturntable on\nwait 5\npicture turning.png\nturntable off\nadd-key\norbit 40 0\nadd-key\n"
       "play on\nwait 5\npicture playing.png\n",
       "900x700", "cpu");
  for (const char* name : {"turning.png", "playing.png"}) {
    const Image picture = shop.read(name);
    CHECK(picture.width == 900);
    CHECK(picture.height == 700);
  }
}

TEST_CASE("a recording in the window is the recording without one, and can be cancelled", "[window]") {
  TG_SKIP_IF(noWindow());
  for (const std::string& backend : {backendOr("vulkan"), std::string("cpu")}) {
    const Workshop shop;
    test::writeSample(shop / "model.tgz");
    play(shop,
         "camera 1\nadd-key\norbit 40 10\nadd-key\nsave-path path.json\ntab path\nrecord-size 90x60\nrecord-fps 2\n"
         "record window/##.png\nwindow during.png\noutput normal\nawait-recording\noutput final\n"
         "record-fps 1000\nrecord cancelled/####.png\nwait 100\ncancel-recording\nwait 2\npicture after.png\n"
         "record closed/####.png\nwait 2\nclose-document 0\nawait-recording\n",
         "240x180", backend);
    const ProcessResult result = shop.tgview({"model.tgz", "--path", "path.json", "--fps", "2", "-o", "plain/##.png",
                                              "--size", "90x60", "--backend", backend});
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    for (const char* frame : {"00.png", "02.png", "04.png"}) {
      CHECK(psnr(shop.read(std::string("window/") + frame), shop.read(std::string("plain/") + frame)) > 45);
    }
    CHECK_FALSE(std::filesystem::exists(shop / "window/05.png"));
    CHECK(std::filesystem::exists(shop / "cancelled/0000.png"));
    CHECK_FALSE(std::filesystem::exists(shop / "cancelled/2000.png"));
    CHECK(shop.read("after.png").width > 90);
  }
}

TEST_CASE("inspecting draws the picked Gaussian's square, alone only that, and clearing takes both back", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop,
       "panel off\nwait 2\nwindow before.png\ninspect 120 90\nwindow inspected.png\npicture picture.png\npick 1\n"
       "window second.png\nisolate on\npicture alone.png\nclear-inspection\nwindow after.png\n",
       "240x180", "cpu");
  CHECK(psnr(shop.read("before.png"), shop.read("inspected.png")) < 50);
  CHECK(psnr(shop.read("inspected.png"), shop.read("second.png")) < 50);
  CHECK(psnr(shop.read("before.png"), shop.read("picture.png")) > 60);
  CHECK(psnr(shop.read("before.png"), shop.read("alone.png")) < 30);
  CHECK(psnr(shop.read("before.png"), shop.read("after.png")) > 60);
}

TEST_CASE("the inspector prints a pixel whose colour is the picture's") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const ProcessResult result = shop.tgview({"model.tgz", "--inspect", "48,36", "--size", "96x72"});
  REQUIRE(result.exit_code == 0);
  const nlohmann::json json = parseJson(result.out, "stdout");
  REQUIRE(shop.tgview({"model.tgz", "--render", "a.png", "--size", "96x72", "--backend", "cpu"}).exit_code == 0);
  const Image picture = shop.read("a.png");
  for (int c = 0; c < 3; ++c) {
    const double value = std::clamp(json["color"][static_cast<std::size_t>(c)].get<double>(), 0.0, 1.0);
    CHECK(std::abs(value - picture.at(48, 36, c)) < 0.01);
  }
  CHECK_FALSE(json["hits"].empty());
  CHECK(shop.tgview({"model.tgz", "--inspect", "96,0", "--size", "96x72"}).exit_code == 1);
  CHECK(shop.tgview({"model.tgz", "--inspect", "x", "--size", "96x72"}).exit_code == 1);
  CHECK(shop.tgview({"none.tgz", "--inspect", "1,1"}).exit_code == 2);
}

TEST_CASE("the flag --benchmark in a window times what is shown there", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("path.json", formatCameras({test::trainedLikeCamera(96, 72), test::trainedLikeCamera(96, 72)}));
  for (const std::string& backend : {backendOr("vulkan"), std::string("cpu")}) {
    const ProcessResult result = shop.tgview({"model.tgz", "--benchmark", "path.json", "--window", "--fps", "4",
                                              "--size", "700x300", "--backend", backend, "--validation"},
                                             kXServer);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    const nlohmann::json json = parseJson(result.out, "stdout");
    CHECK(json["where"] == "window");
    CHECK(json["backend"] == backend);
    CHECK(json["path"]["frames"] == 5);
    CHECK(json["image"]["height"] == 300);
    CHECK(json["frame_ms"]["median"].get<double>() > 0);
    CHECK(json["load"]["total_ms"].get<double>() > 0);
    CHECK_FALSE(json["passes_ms"].empty());
  }
}

TEST_CASE("a session keeps size, page, output, recent files and bookmarks, a broken one is replaced with a word",
          "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const auto run = [&shop](const std::string& script, std::vector<std::string> flags) {
    shop.write("script.txt", script);
    flags.insert(flags.begin(), {"model.tgz", "--session", "state/session.json", "--script", "script.txt"});
    const ProcessResult result = shop.tgview(flags, kXServer);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
  };
  run("wait 3\ntab path\noutput depth\norbit 30 0\nbookmark\npanel off\npicture a.png\n", {"--size", "400x300"});
  run("wait 3\nwindow again.png\ngo-bookmark 0\npicture b.png\n", {});
  CHECK(shop.read("again.png").width == 400);
  CHECK(psnr(shop.read("a.png"), shop.read("b.png")) > 60);  // output, panel and bookmark
  const LoadedSession kept = loadSession(shop / "state/session.json");
  CHECK(kept.problem.empty());
  CHECK(kept.session.tab == Tab::path);
  REQUIRE(kept.session.recent.size() == 1);
  CHECK(kept.session.recent[0].ends_with("/model.tgz"));
  shop.write("state/session.json", "{");
  run("wait 3\nwindow broken.png\nkey Esc\nwait 2\nwindow fine.png\n", {"--size", "400x300"});
  CHECK(psnr(shop.read("broken.png"), shop.read("fine.png")) < 40);  // the message
  CHECK(loadSession(shop / "state/session.json").problem.empty());
  // A script alone keeps nothing.
  std::filesystem::remove_all(shop / "state");
  const ProcessResult plain = shop.tgview({"model.tgz", "--script", "script.txt"}, [] {
    std::vector<std::string> prefix = {"env", "XDG_STATE_HOME=/nonexistent/state"};
    prefix.insert(prefix.end(), kXServer.begin(), kXServer.end());
    return prefix;
  }());
  CHECK(plain.exit_code == 0);
  CHECK(plain.err.empty());
}

TEST_CASE("a path given to the window, or dropped on it, is there to be played", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  play(shop, "wait 2\ncamera 1\nadd-key\norbit 40 10\nadd-key\nsave-path path.json\npanel off\npicture end.png\n",
       "240x180", "cpu");
  play(shop, "panel off\nwait 2\nopen path.json\npath-lines off\nshow-key 1\npicture dropped.png\n", "240x180", "cpu");
  CHECK(psnr(shop.read("end.png"), shop.read("dropped.png")) > 45);
  shop.write("script.txt", "panel off\npath-lines off\nwait 2\nshow-key 1\npicture given.png\n");
  const ProcessResult result = shop.tgview(
      {"model.tgz", "--path", "path.json", "--script", "script.txt", "--size", "240x180", "--backend", "cpu"},
      kXServer);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(psnr(shop.read("end.png"), shop.read("given.png")) > 45);
}

TEST_CASE("a script that is wrong or cannot write ends with its exit code", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("unknown.txt", "dance\n");
  shop.write("value.txt", "output red\n");
  shop.write("write.txt", "keep-going on\nwindow no/such/folder/a.png\n");
  shop.write("open.txt", "wait 2\nopen none.tgz\n");
  shop.write("inspect.txt", "inspect 3000 5\n");
  shop.write("record.txt", "keep-going on\nwait 2\nrecord x.exr\nawait-recording\n");
  const auto run = [&shop](const std::string& script) {
    return shop.tgview({"model.tgz", "--size", "200x150", "--script", script}, kXServer);
  };
  CHECK(run("missing.txt").exit_code == 2);
  CHECK(run("unknown.txt").exit_code == 3);
  CHECK(run("value.txt").exit_code == 3);
  const ProcessResult written = run("write.txt"), recorded = run("record.txt");
  CHECK(written.exit_code == 4);
  CHECK_THAT(written.err, Contains("tgview: write.txt: line 2: window: "));
  CHECK(recorded.exit_code == 3);
  CHECK_THAT(recorded.err, Contains("tgview: record.txt: line 3: record: x.exr: expected a video ("));
  CHECK(run("open.txt").exit_code == 3);
  CHECK(run("inspect.txt").exit_code == 3);
}
