// SPDX-License-Identifier: Apache-2.0
// The real window under a window manager, driven by a pointer and a keyboard.
#include <cmath>
#include <filesystem>

#include "core/bundle/camera_file.h"
#include "core/image/metrics.h"
#include "core/model/camera.h"
#include "support/catch.h"
#include "viewer/process.h"
#include "viewer/window/hand.h"

using namespace tg;
using test::backendOr;
using test::noHand;
using test::seen;
using test::Workshop;

namespace {

constexpr int kPanelWidth = 270;      // [px] at least, in either font
constexpr int kHalfButton = 10;       // [px] of its height
const std::string kHigh = "700x700";  // all of a page without scrolling

// The middle of the first row of the panel in which two pictures of the window differ.
int changedRow(const Image& a, const Image& b) {
  REQUIRE((a.width == b.width && a.height == b.height));
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < kPanelWidth; ++x) {
      if (std::abs(a.at(x, y, 2) - b.at(x, y, 2)) > 0.05) return y + kHalfButton;
    }
  }
  FAIL("nothing changed in the panel");
  return 0;
}

}  // namespace

TEST_CASE("dragging the line of a wipe moves it, dragging beside it moves the camera", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::writeSample(shop / "other.tgz", 90);
  test::playByHand(
      shop,
      "compare wipe\nwindow middle.png\n" + seen("held") + seen("dragged") + seen("released") +
          "divider 0.25\nwindow quarter.png\nsave-camera before.json\nwindow stay.png\n" + seen("grabbed") +
          seen("orbited") + "save-camera after.json\n",
      "reached middle.png\nto 320 240\npress 1\nseen held\nto 240 240\nto 160 240\nseen dragged\nrelease 1\n"
      "seen released\nreached stay.png\nto 400 240\npress 1\nseen grabbed\nto 440 240\nto 480 240\nseen orbited\n"
      "release 1\n",
      {"model.tgz", "other.tgz"});
  CHECK(psnr(shop.read("middle.png"), shop.read("dragged.png")) < 45);
  CHECK(psnr(shop.read("quarter.png"), shop.read("dragged.png")) > 60);
  const Camera before = readCameras(shop / "before.json").front(), after = readCameras(shop / "after.json").front();
  CHECK(before.translation != after.translation);
}

TEST_CASE("buttons of one page that have one label are clicked each", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  // Where they are: what changes beside them is in their row.
  shop.write("script.txt",
             "wait 3\nwindow view.png\ntextures alpha\nwindow textures.png\ncrop on\nwindow crop.png\n"
             "tab camera\nwindow camera.png\nbookmark\nwindow bookmark.png\n");
  REQUIRE(shop.tgview({"model.tgz", "--script", "script.txt", "--size", kHigh, "--backend", backendOr("cpu")},
                      test::kXServer)
              .exit_code == 0);
  const auto row = [&](const char* before, const char* after) {
    return std::to_string(changedRow(shop.read(before), shop.read(after)));
  };
  const std::string textures = row("view.png", "textures.png"), crop = row("textures.png", "crop.png");
  const std::string bookmarks = row("camera.png", "bookmark.png");
  test::playByHand(
      shop,
      "panel on\nsize " + kHigh + "\ncrop 0,0,0,9,9,9\ncrop off\nwindow begin.png\n" + seen("alpha") +
          "picture got-alpha.png\n" + seen("off") + "picture got-off.png\n" + seen("cropped") +
          "picture got-cropped.png\ntextures alpha\ncrop off\npicture alpha.png\ntextures off\npicture off.png\n"
          "crop on\npicture cropped.png\ntab camera\nbookmark\nwindow bookmarked.png\n" +
          seen("saved"),
      "reached begin.png\nclick 108 " + textures + "\nseen alpha\nclick 44 " + textures + "\nseen off\nclick 50 " +
          crop + "\nseen cropped\nreached bookmarked.png\nclick 140 " + bookmarks + "\nseen saved\n");
  for (const std::string name : {"alpha.png", "off.png", "cropped.png"}) {
    INFO(name);
    CHECK(psnr(shop.read("got-" + name), shop.read(name)) > 60);
  }
  CHECK(psnr(shop.read("alpha.png"), shop.read("off.png")) < 45);
  CHECK(psnr(shop.read("off.png"), shop.read("cropped.png")) < 45);
  CHECK(std::filesystem::exists(shop / "bookmarks.json"));
  CHECK_FALSE(std::filesystem::exists(shop / "model-camera-001.json"));
}

TEST_CASE("the keyboard, the wheel and a click act as the help says", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::playByHand(shop,
                   seen("typed") +
                       "output normal\nwindow normal.png\noutput final\nsave-camera far.json\nwindow far.png\n" +
                       seen("wheeled") + "save-camera near.json\nwindow near.png\n" + seen("clicked"),
                   "to 320 240\nkey 6\nseen typed\nreached far.png\nwheel 4\nseen wheeled\nreached near.png\nkey m\n"
                   "click 320 240\nseen clicked\n");
  CHECK(psnr(shop.read("typed.png"), shop.read("normal.png")) > 60);
  const Camera far = readCameras(shop / "far.json").front(), near = readCameras(shop / "near.json").front();
  CHECK(far.translation != near.translation);
  // The square of the Gaussian under the pointer, in the middle: the notice of the key is further down.
  const Image before = shop.read("near.png"), after = shop.read("clicked.png");
  double changed = 0;
  for (int y = 60; y < 400; ++y) {
    for (int x = 0; x < 640; ++x) changed += std::abs(after.at(x, y, 2) - before.at(x, y, 2)) > 0.2;
  }
  CHECK(changed > 100);
}

TEST_CASE("a window that was minimised and hidden comes back with its picture", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::playByHand(shop, "await-file restored\nwindow restored.png\noutput base\nwindow base.png\n",
                   "xdotool windowminimize \"$window\"\nsleep 1\nimport -window root PNG24:minimised.png\n"
                   "xdotool windowmap \"$window\"\nsleep 0.5\nxdotool windowunmap \"$window\"\nsleep 0.5\n"
                   "xdotool windowmap \"$window\"\nsleep 0.5\nimport -window root PNG24:mapped.png\ntouch restored\n");
  CHECK(psnr(shop.read("ready.png"), shop.read("restored.png")) > 60);
  CHECK(psnr(shop.read("ready.png"), shop.read("base.png")) < 50);  // pictures still come
  CHECK(psnr(shop.read("mapped.png"), shop.read("minimised.png")) < 30);
}

TEST_CASE("the panels answer while a picture takes seconds", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::playByHand(
      shop, "window before.png\nhold-picture enough\norbit 30 0\nwindow after.png\nhelp off\nwindow closed.png\n",
      "reached before.png\nimport -window \"$window\" PNG24:still.png\nkey question\n"
      "until import -window \"$window\" PNG24:helped.png\n"
      "  [ \"$(identify -format %# helped.png)\" != \"$(identify -format %# still.png)\" ]\n"
      "do sleep 0.1\ndone\n[ ! -e after.png ] || exit 92\ntouch enough\n",
      {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
  // The old picture stays until the new one is there; the help lies over it already.
  CHECK(psnr(shop.read("before.png"), shop.read("still.png")) > 60);
  CHECK(psnr(shop.read("still.png"), shop.read("helped.png")) < 30);
  CHECK(psnr(shop.read("helped.png"), shop.read("after.png")) > 15);
  CHECK(psnr(shop.read("closed.png"), shop.read("before.png")) < 45);
}
