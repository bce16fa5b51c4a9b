// SPDX-License-Identifier: Apache-2.0
// The real window with several models, files on their way, comparisons and failing devices.
#include <algorithm>
#include <cstdio>

#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/image/metrics.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "viewer/process.h"
#include "viewer/view/compare.h"

using namespace tg;
using test::backendOr;
using test::kXServer;
using test::noWindow;
using test::ProcessResult;
using test::Workshop;

namespace {

ProcessResult play(const Workshop& shop, std::vector<std::string> arguments, const std::string& script,
                   const std::string& size, const std::string& backend, const char* program = TG_TGVIEW) {
  shop.write("script.txt", script);
  arguments.insert(arguments.end(), {"--script", "script.txt", "--size", size, "--backend", backend, "--validation"});
  ProcessResult result = shop.tgview(arguments, kXServer, program);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(result.err.find(backendOr("vulkan") + ":") == std::string::npos);
  return result;
}

std::string run(const Workshop& shop, const std::vector<std::string>& arguments) {
  const ProcessResult result = shop.tgview(arguments);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  return result.out;
}

// Of the program's one line.
double numberAfter(const std::string& text, const std::string& word) {
  const std::size_t at = text.find(word);
  REQUIRE(at != std::string::npos);
  return std::stod(text.substr(at + word.size()));
}

}  // namespace

TEST_CASE("several models are open at once: the one shown is what --render writes, and closing comes back",
          "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "a.tgz");
  test::writeSample(shop / "b.tgz", 90);
  writeSplatPly(shop / "c.ply", test::sampleModel(250));
  play(shop, {"a.tgz", "b.tgz", "c.ply"},
       "panel off\ndocument 1\npicture b.png\nkey PageUp\npicture a.png\nkey PageUp\nsave-camera c.json\n"
       "picture c.png\nclose-document 0\nkey Ctrl+W\npicture last.png\nopen a.tgz\npicture again.png\n",
       "240x180", backendOr("vulkan"));
  const auto render = [&](const std::string& model, const std::string& camera) {
    run(shop, {model, "--render", "render.png", "--backend", backendOr("vulkan"), "--camera", camera, "--size",
               "240x180", "--background", model == "c.ply" ? "black" : "white"});
    return shop.read("render.png");
  };
  CHECK(psnr(shop.read("a.png"), render("a.tgz", "1")) > 45);
  CHECK(psnr(shop.read("b.png"), render("b.tgz", "1")) > 45);
  CHECK(psnr(shop.read("c.png"), render("c.ply", "c.json")) > 45);
  CHECK(psnr(shop.read("last.png"), shop.read("b.png")) > 60);
  CHECK(psnr(shop.read("again.png"), shop.read("a.png")) > 60);
}

TEST_CASE("the command line's camera, background and crop box hold beside a second model, as --render draws them",
          "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "a.tgz");
  test::writeSample(shop / "c.tgz", 90);
  const std::vector<std::string> flags = {"--camera", "2", "--background", "0,0.5,0", "--crop", "-9,-9,-9,0,9,9"};
  const auto with = [&](std::vector<std::string> words) {
    words.insert(words.end(), flags.begin(), flags.end());
    return words;
  };
  const auto render = [&](const std::string& model) {
    run(shop, with({model, "--render", "render.png", "--size", "240x180", "--backend", backendOr("vulkan")}));
    return shop.read("render.png");
  };
  play(shop, with({"a.tgz", "--compare", "c.tgz", "--compare-mode", "flicker"}),
       "panel off\nwait 3\ncompare off\npicture first.png\nkey PageDown\npicture second.png\n", "240x180",
       backendOr("vulkan"));
  play(shop, with({"a.tgz", "c.tgz"}), "panel off\nwait 3\npicture last.png\n", "240x180", backendOr("vulkan"));
  CHECK(psnr(shop.read("first.png"), render("a.tgz")) > 45);
  CHECK(psnr(shop.read("second.png"), render("c.tgz")) > 45);
  CHECK(psnr(shop.read("last.png"), shop.read("second.png")) > 60);
}

TEST_CASE("the window answers while a file is read, says so, and Esc stops it", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "a.tgz");
  test::writeSample(shop / "slow.tgz", 90);
  play(shop, {"a.tgz"},
       "panel off\npicture before.png\nslow-file 60\nbegin-open slow.tgz\nwait 2\nwindow loading.png\nkey "
       "Esc\nawait-open\n"
       "wait 2\npicture after.png\nopen slow.tgz\npicture slow.png\n",
       "400x300", "cpu", TG_TGVIEW_UNDER_TEST);
  CHECK(psnr(shop.read("before.png"), shop.read("after.png")) > 60);
  CHECK(psnr(shop.read("before.png"), shop.read("loading.png")) < 40);  // the bar is there
  CHECK(psnr(shop.read("slow.png"), shop.read("after.png")) < 40);
}

TEST_CASE("the window ends cleanly while a file is read and a picture is drawn", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "a.tgz");
  test::writeSample(shop / "slow.tgz", 90);
  for (const std::string& backend : {backendOr("vulkan"), std::string("cpu")}) {
    play(shop, {"a.tgz"}, "orbit 30 5\nslow-file 60\nbegin-open slow.tgz\norbit 10 0\n", "300x200", backend,
         TG_TGVIEW_UNDER_TEST);
  }
}

TEST_CASE("a storm of sizes leaves the picture of the last one", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "a.tgz");
  std::string storm = "panel off\n";
  for (int i = 0; i < 25; ++i) {
    storm += "size " + std::to_string(60 + 37 * (i * i % 17)) + "x" + std::to_string(50 + 29 * (i * 7 % 13)) + "\n";
  }
  play(shop, {"a.tgz"}, storm + "size 260x200\nwindow window.png\npicture picture.png\n", "240x180",
       backendOr("vulkan"));
  run(shop, {"a.tgz", "--render", "render.png", "--backend", backendOr("vulkan"), "--size", "260x200"});
  CHECK(psnr(shop.read("window.png"), shop.read("render.png")) > 45);
  CHECK(psnr(shop.read("picture.png"), shop.read("render.png")) > 45);
  for (const char* file : {"window.png", "picture.png"}) CHECK(isDrawn(readFile(shop / file, 1 << 24)));
}

TEST_CASE("a comparison on screen is the one that --render writes, and both are two renderings put together",
          "[window]") {
  TG_SKIP_IF(noWindow());
  for (const std::string& backend : {backendOr("vulkan"), std::string("cpu")}) {
    INFO(backend);
    const Workshop shop;
    test::writeSample(shop / "a.tgz");
    test::writeSample(shop / "b.tgz", 90);
    const auto render = [&](std::vector<std::string> more) {
      more.insert(more.end(), {"--render", "render.png", "--backend", backend});
      const std::string out = run(shop, more);
      return std::pair(shop.read("render.png"), out);
    };
    play(shop, {"a.tgz", "b.tgz"},
         "document 0\npanel off\ncompare side\nwindow side.png\ncompare wipe\ndivider 0.25\nwindow wipe.png\n"
         "picture wipe-picture.png\ninspect 60 90\npicture inspected.png\nclear-inspection\ncompare flip\npicture "
         "flip-picture.png\nwindow flip.png\ncompare "
         "difference\nwindow difference.png\ndifference signed 4\nwindow signed.png\n"
         "compare flicker\nwindow first.png\nkey Shift+V\nwindow other.png\ncompare off\nwindow off.png\n"
         "output count\ncompare side\nwindow count.png\n",
         "240x180", backend);
    const Image a = render({"a.tgz", "--size", "240x180"}).first, b = render({"b.tgz", "--size", "240x180"}).first;
    const Image a_half = render({"a.tgz", "--size", "120x180"}).first;
    const Image b_half = render({"b.tgz", "--size", "120x180"}).first;
    CHECK(psnr(shop.read("side.png"), composed(a_half, b_half, {}, {.mode = CompareMode::side})) > 45);
    const Image wipe = composed(a, b, {}, {.mode = CompareMode::wipe, .divider = 0.25f});
    CHECK(psnr(shop.read("wipe.png"), wipe) > 45);
    CHECK(psnr(shop.read("wipe-picture.png"), wipe) > 45);
    CHECK(psnr(shop.read("inspected.png"), wipe) > 45);
    const Image flip = flipOf(a, b, {});
    CHECK(psnr(shop.read("flip.png"), flip) > 35);
    CHECK(psnr(shop.read("flip-picture.png"), flip) > 35);
    CHECK(psnr(shop.read("difference.png"), differenceOf(a, b, {}, {})) > 40);
    CHECK(psnr(shop.read("signed.png"), differenceOf(a, b, {}, {.gain = 4, .with_sign = true})) > 35);
    CHECK(psnr(shop.read("first.png"), a) > 45);
    CHECK(psnr(shop.read("other.png"), b) > 45);
    CHECK(psnr(shop.read("off.png"), a) > 45);
    const Image counts =
        render({"a.tgz", "--compare", "b.tgz", "--compare-mode", "side", "--size", "240x180", "--show", "count"}).first;
    CHECK(psnr(shop.read("count.png"), counts) > 35);
    const auto [side, out] = render({"a.tgz", "--compare", "b.tgz", "--compare-mode", "side", "--size", "240x180"});
    CHECK(psnr(shop.read("side.png"), side) > 45);
    CHECK(numberAfter(out, "PSNR ") == Approx(psnr(b_half, a_half)).margin(0.1));
    const auto [difference, line] =
        render({"a.tgz", "--compare", "b.tgz", "--compare-mode", "difference", "--size", "240x180"});
    CHECK(psnr(shop.read("difference.png"), difference) > 40);
    CHECK(numberAfter(line, "PSNR ") == Approx(psnr(b, a)).margin(0.1));
    CHECK(numberAfter(line, "SSIM ") == Approx(ssim(b, a)).margin(0.01));
  }
}

TEST_CASE("a model is compared with the photograph of its camera, found by name in a data set's folder", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "a.tgz");
  test::writeSample(shop / "b.tgz", 90);
  // The "photographs": another model's renderings, of another size than the cameras'.
  std::filesystem::create_directories(shop / "data/images");
  for (const std::string number : {"0", "1"}) {
    run(shop, {"b.tgz", "--render", "data/images/view" + number + ".png", "--backend", "cpu", "--camera", number,
               "--size", "192x144"});
  }
  play(shop, {"a.tgz", "--photos", "data", "--compare-mode", "flicker"},
       "panel off\nkey Shift+V\ncamera 2\nkey .\npicture photo.png\norbit 5 0\nwindow moved.png\n", "192x144", "cpu");
  CHECK(psnr(shop.read("photo.png"), shop.read("data/images/view1.png")) > 45);
  // From a free view there is nothing to compare with: the model alone.
  CHECK(psnr(shop.read("moved.png"), shop.read("photo.png")) < 45);
  const std::string out = run(shop, {"a.tgz", "--photos", "data", "--camera", "0", "--render", "out.png",
                                     "--compare-mode", "difference", "--backend", "cpu"});
  CHECK(out.find("view0.png") != std::string::npos);
  CHECK(numberAfter(out, "PSNR ") < 60);
  CHECK(shop.tgview({"a.tgz", "--photos", "data", "--camera", "2", "--render", "out.png", "--backend", "cpu"})
            .exit_code == 2);
  CHECK(shop.tgview({"a.tgz", "--photos", "nowhere", "--render", "out.png", "--backend", "cpu"}).exit_code == 2);
  CHECK(shop.tgview({"a.tgz", "--compare", "b.tgz", "--render", "out.exr", "--backend", "cpu"}).exit_code == 1);
  CHECK(shop.tgview({"a.tgz", "b.tgz", "--render", "out.png", "--backend", "cpu"}).exit_code == 1);
}

TEST_CASE("a lost device is a message, and the CPU draws the same picture", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "a.tgz");
  run(shop, {"a.tgz", "--render", "render.png", "--backend", "cpu", "--size", "240x180"});
  for (const std::string verb : {"lose-device", "lose-window-device"}) {
    INFO(verb);
    play(shop, {"a.tgz"},
         "panel off\nwait 2\npicture before.png\n" + verb +
             "\noutput base\nwait 1\noutput final\nwait 3\nwindow message.png\nkey Esc\n" +
             "window after.png\npicture picture.png\norbit 10 0\npicture turned.png\n",
         "240x180", backendOr("vulkan"), TG_TGVIEW_UNDER_TEST);
    CHECK(psnr(shop.read("before.png"), shop.read("render.png")) > 45);
    CHECK(psnr(shop.read("message.png"), shop.read("render.png")) < 40);
    CHECK(psnr(shop.read("after.png"), shop.read("render.png")) > 60);
    CHECK(psnr(shop.read("picture.png"), shop.read("render.png")) > 60);
    CHECK(psnr(shop.read("turned.png"), shop.read("render.png")) < 45);
  }
}

TEST_CASE("timings say how fast the file and the first pictures came", "[window]") {
  TG_SKIP_IF(noWindow());
  const Workshop shop;
  test::writeSample(shop / "a.tgz");
  shop.write("script.txt", "wait 2\n");
  const ProcessResult result =
      shop.tgview({"a.tgz", "--timings", "--script", "script.txt", "--size", "200x150", "--backend", "cpu"}, kXServer);
  REQUIRE(result.exit_code == 0);
  CHECK_THAT(result.out, Contains("MB read in") && Contains("first picture after"));
}
