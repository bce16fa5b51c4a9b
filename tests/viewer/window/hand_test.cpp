// SPDX-License-Identifier: Apache-2.0
// The real window under a window manager, driven by a pointer and a keyboard.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "converter/edit/select.h"
#include "core/bundle/bundle.h"
#include "core/bundle/camera_file.h"
#include "core/image/metrics.h"
#include "core/model/camera.h"
#include "core/model/verbs.h"
#include "support/catch.h"
#include "viewer/process.h"
#include "viewer/view/gizmo.h"
#include "viewer/view/selection.h"
#include "viewer/window/hand.h"

using namespace tg;
using test::backendOr;
using test::noHand;
using test::seen;
using test::Workshop;

namespace {

constexpr int kPanelWidth = 270;      // [px] at least, in either font
constexpr int kHalfButton = 10;       // [px] of its height
const std::string kHigh = "700x780";  // all of a page without scrolling

// The middle of the first row of the panel, from that one on, in which two pictures of the window differ.
int changedRow(const Image& a, const Image& b, int from = 0) {
  REQUIRE((a.width == b.width && a.height == b.height));
  for (int y = from; y < a.height; ++y) {
    for (int x = 0; x < kPanelWidth; ++x) {
      if (std::abs(a.at(x, y, 2) - b.at(x, y, 2)) > 0.05) return y + kHalfButton;
    }
  }
  FAIL("nothing changed in the panel");
  return 0;
}

// The lowest row of a slider's knob in two pictures of the page of times, which differ above, too.
int lastChangedRow(const Image& a, const Image& b) {
  int bottom = 0;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < kPanelWidth; ++x) {
      if (std::abs(a.at(x, y, 2) - b.at(x, y, 2)) > 0.2) bottom = y;
    }
  }
  return bottom;
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
  // Where they are: what changes beside them is in their row, and below that of Undo.
  shop.write("script.txt",
             "wait 3\nwindow view.png\ntextures alpha\nwait 2\nwindow textures.png\ncrop on\nwait 2\nwindow crop.png\n"
             "tab camera\nwindow camera.png\nbookmark\nwait 2\nwindow bookmark.png\n");
  REQUIRE(shop.tgview({"model.tgz", "--script", "script.txt", "--size", kHigh, "--backend", backendOr("cpu")},
                      test::kXServer)
              .exit_code == 0);
  const auto row = [&](const char* before, const char* after) {
    const Image a = shop.read(before), b = shop.read(after);
    return std::to_string(changedRow(a, b, changedRow(a, b) + kHalfButton + 2));
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

TEST_CASE("Tab after a click in the panel goes to no slider, where the next key would go", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::playByHand(shop,
                   "panel on\nsize " + kHigh + "\nwindow begin.png\n" + seen("clicked") + seen("typed") +
                       "picture typed.png\noutput normal\npicture normal.png\n",
                   "reached begin.png\nclick 108 260\nseen clicked\nxdotool keydown Tab\nsleep 1\nxdotool keyup Tab\n"
                   "key 6\nsleep 0.3\nseen typed\n");
  CHECK(psnr(shop.read("typed.png"), shop.read("normal.png")) > 60);
}

TEST_CASE("what is typed in the frame of Ctrl+S is the file's name and no command", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::playByHand(shop,
                   "hold-frame go\nawait-file copy6.spz\nwait 6\npicture got.png\noutput normal\n"
                   "picture normal.png\n",
                   "reached go.held\nkey ctrl+s\nkey ctrl+a\nxdotool type copy66\nkey BackSpace\nkey BackSpace\n"
                   "xdotool type 6.spz\nkey Return\ntouch go\nreached copy6.spz\n",
                   {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
  CHECK(std::filesystem::exists(shop / "copy6.spz"));
  CHECK_FALSE(std::filesystem::exists(shop / "model-camera-001.json"));  // of C
  CHECK(psnr(shop.read("got.png"), shop.read("normal.png")) < 45);       // of 6
}

TEST_CASE("what is typed in the frame of a click into a field goes there", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("script.txt", "wait 3\ntab camera\nwindow none.png\nbookmark\nwait 2\nwindow one.png\n");
  REQUIRE(shop.tgview({"model.tgz", "--script", "script.txt", "--size", kHigh, "--backend", backendOr("cpu")},
                      test::kXServer)
              .exit_code == 0);
  const Image none = shop.read("none.png"), one = shop.read("one.png");
  const int save = changedRow(none, one, changedRow(none, one) + kHalfButton + 2);
  test::playByHand(
      shop, "panel on\nsize " + kHigh + "\ntab camera\nbookmark\nhold-frame go\n" + seen("typed") + seen("saved"),
      "reached go.held\nclick 200 " + std::to_string(save + 25) +
          "\nkey ctrl+a\nxdotool type c6.json\nkey Return\ntouch go\nseen typed\nclick 140 " + std::to_string(save) +
          "\nseen saved\n",
      {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
  CHECK(std::filesystem::exists(shop / "c6.json"));
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

TEST_CASE("the wheel within one frame acts where it was turned", "[window]") {
  TG_SKIP_IF(noHand());
  // With a click in the panel before, or turned there afterwards.
  const std::string turned = GENERATE("to 100 400\npress 2\nrelease 2\nto 500 240\nwheel 4\nwheel 4\n",
                                      "to 500 240\nwheel 4\nwheel 4\nto 100 400\nwheel 4\n");
  CAPTURE(turned);
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::playByHand(shop,
                   "panel on\nsave-camera far.json\nhold-frame go\n" + seen("wheeled") + "save-camera near.json\n",
                   "reached go.held\n" + turned + "touch go\nseen wheeled\n", {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
  const Camera far = readCameras(shop / "far.json").front(), near = readCameras(shop / "near.json").front();
  CHECK(far.translation != near.translation);
}

TEST_CASE("a drag within one frame goes as far as the button was down", "[window]") {
  TG_SKIP_IF(noHand());
  // From where, and to where.
  const auto dragged = [](const std::string& then) {
    const Workshop shop;
    test::writeSample(shop / "model.tgz");
    test::playByHand(
        shop, "save-camera before.json\nhold-frame go\n" + seen("dragged") + "save-camera after.json\n",
        "reached go.held\nto 300 240\npress 1\nto 500 260\nrelease 1\n" + then + "touch go\nseen dragged\n",
        {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
    return std::pair(readCameras(shop / "before.json").front().translation,
                     readCameras(shop / "after.json").front().translation);
  };
  const auto [before, after] = dragged("");
  CHECK(before != after);
  CHECK(dragged("to 100 100\n") == std::pair(before, after));
}

TEST_CASE("Shift counts for a click as it was held when the button went down", "[window]") {
  TG_SKIP_IF(noHand());
  const auto left = [](const std::string& pressed, const std::string& released) {
    const Workshop shop;
    test::writeSample(shop / "model.tgz");
    test::playByHand(
        shop, "tool rectangle\nselect x>0\nhold-frame go\n" + seen("dragged") + "key Delete\nsave-model left.tgz\n",
        "reached go.held\nto 200 120\n" + pressed + "press 1\nto 330 400\nrelease 1\n" + released +
            "touch go\nseen dragged\n",
        {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
    return readBundle(shop / "left.tgz").model.size();
  };
  // What is added to the selection is deleted with it.
  CHECK(left("xdotool keydown shift\n", "xdotool keyup shift\n") < left("", ""));
}

TEST_CASE("the formats of a save dialog hang from it when they are clicked", "[window]") {
  TG_SKIP_IF(noHand());
  constexpr int kLeft = 60, kRight = 580, kBeside = 230;  // [px] of the dialog's list, and of the formats below it
  int below = 0;                                          // the last row of the list's frame
  {
    const Workshop shop;
    test::writeSample(shop / "model.tgz");
    test::playByHand(shop, seen("asked"), "key ctrl+s\nseen asked\n");
    const Image asked = shop.read("asked.png");
    const auto isLine = [&](int y) {
      const float grey = asked.at(kLeft, y, 0);
      for (int x = kLeft; x < kRight; ++x) {
        if (std::abs(asked.at(x, y, 0) - grey) > 0.02 || grey < asked.at(x, y - 3, 0) + 0.05f) return false;
      }
      return true;
    };
    for (int y = asked.height - 1; y > asked.height / 2 && below == 0; --y) below = isLine(y) ? y : 0;
    REQUIRE(below > 0);
  }
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const std::string formats = "click " + std::to_string(kBeside) + " " + std::to_string(below + 1 + kHalfButton);
  // What hangs is hidden for a frame, until its size is known.
  test::playByHand(shop,
                   seen("asked") +
                       "await-file hanging\nwait 3\nwindow hanging.png\nawait-file gone\nwait 3\n"
                       "window gone.png\n",
                   "key ctrl+s\nseen asked\n" + formats + "\nseen hanging\nkey Escape\nseen gone\n");
  const Image asked = shop.read("asked.png"), hanging = shop.read("hanging.png"), gone = shop.read("gone.png");
  const auto changed = [&](const Image& after) {
    int pixels = 0;
    for (int y = below - 100; y < below - 5; ++y) {
      for (int x = kLeft; x < kRight; ++x) pixels += std::abs(after.at(x, y, 2) - asked.at(x, y, 2)) > 0.1;
    }
    return pixels;
  };
  CHECK(changed(hanging) > 300);  // their names
  CHECK(changed(gone) == 0);
}

TEST_CASE("a hand selects with a rectangle, deletes, and takes it back", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::playByHand(shop,
                   seen("pressed") + seen("dragged") + "hold-frame go\n" + seen("deleted") +
                       "save-model deleted.tgz\nwindow saved.png\n" + seen("undone") + "save-model undone.tgz\n" +
                       seen("redone") + "save-model redone.tgz\n",
                   "key F2\nto 200 120\npress 1\nseen pressed\nto 260 200\nto 330 400\nseen dragged\n"
                   // Both within one frame, as on a slow device.
                   "reached go.held\nrelease 1\nkey Delete\ntouch go\nseen deleted\n"
                   "reached saved.png\nkey ctrl+z\nseen undone\nkey ctrl+shift+z\nseen redone\n",
                   {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
  const GaussianModel whole = readBundle(shop / "model.tgz").model, left = readBundle(shop / "deleted.tgz").model;
  CHECK(left.size() < whole.size());
  CHECK(left.size() > 0);
  CHECK(readBundle(shop / "undone.tgz").model == whole);
  CHECK(readBundle(shop / "redone.tgz").model == left);
  CHECK(psnr(shop.read("deleted.png"), shop.read("undone.png")) < 45);
}

TEST_CASE("a hand selects nothing in the pictures of a recording", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::playByHand(shop,
                   seen("tool") +
                       "record-size 160x120\nrecord-frames 3000\nrecord turn/####.png\nwait 3\n"
                       "window begun.png\n" +
                       seen("dragged") + "cancel-recording\nwait 3\nwindow ended.png\n" + seen("deleted") +
                       "save-model deleted.tgz\n",
                   "key F2\nseen tool\nreached begun.png\nto 200 120\npress 1\nto 260 200\nto 330 400\nrelease 1\n"
                   "seen dragged\nreached ended.png\nkey Delete\nseen deleted\n");
  CHECK_FALSE(std::filesystem::exists(shop / "turn/2999.png"));
  CHECK(readBundle(shop / "deleted.tgz").model == readBundle(shop / "model.tgz").model);
}

TEST_CASE("a hand moves the selection by an arrow in the picture", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const std::string select = "select x>0\n";
  shop.write("script.txt", "panel off\nwait 3\nsave-camera view.json\n");
  REQUIRE(shop.tgview({"model.tgz", "--script", "script.txt", "--size", "640x480", "--backend", backendOr("cpu")},
                      test::kXServer)
              .exit_code == 0);
  const GaussianModel whole = readBundle(shop / "model.tgz").model;
  const SelectionPtr chosen = selectionOf(whole, whereValue(whole, "x>0"));
  const Camera view = readCameras(shop / "view.json").front();
  const Gizmo gizmo = *gizmoAt(GizmoKind::move, chosen->center, view);
  const glm::dvec2 tip = project(view, cameraFromWorld(view, gizmo.origin + glm::dvec3(0.7 * gizmo.size, 0, 0)));
  const auto at = [](glm::dvec2 p) {
    return std::to_string(std::lround(p.x)) + " " + std::to_string(std::lround(p.y));
  };
  const glm::dvec2 goal = tip + glm::dvec2(60, 0);
  test::playByHand(shop,
                   select + "tool move\nwindow begin.png\n" + seen("pressed") + seen("held") + seen("moved") +
                       "save-model moved.tgz\n",
                   "reached begin.png\nto " + at(tip) + "\npress 1\nseen pressed\nto " + at(tip + glm::dvec2(20, 0)) +
                       "\nto " + at(goal) + "\nseen held\nrelease 1\nseen moved\n");
  const GaussianModel moved = readBundle(shop / "moved.tgz").model;
  REQUIRE(moved.size() == whole.size());
  std::set<float> steps;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const glm::vec3 step = moved.mean[i] - whole.mean[i];
    CHECK(step.y == 0);
    CHECK(step.z == 0);
    if (chosen->chosen[i] != 0) steps.insert(step.x);
    if (chosen->chosen[i] == 0) CHECK(step.x == 0);
  }
  CHECK(*steps.begin() > 0.05f);
  CHECK(*steps.rbegin() - *steps.begin() < 1e-5f);  // rounding of the means
}

TEST_CASE("Undo and Redo are buttons, and a drag over the histogram selects", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("script.txt", "wait 3\ntab edit\nwindow none.png\nselect all\nwait 2\nwindow all.png\n");
  REQUIRE(shop.tgview({"model.tgz", "--script", "script.txt", "--size", kHigh, "--backend", backendOr("cpu")},
                      test::kXServer)
              .exit_code == 0);
  const int undo_row = changedRow(shop.read("none.png"), shop.read("all.png"));
  const int count_row = changedRow(shop.read("none.png"), shop.read("all.png"), undo_row + kHalfButton + 2);
  const std::string bars = std::to_string(count_row + 95);  // a heading and a row of buttons further down
  const std::string row = std::to_string(undo_row);
  test::playByHand(shop,
                   "panel on\nsize " + kHigh + "\noutput depth\nwindow depth.png\n" + seen("undone") +
                       "picture undone-picture.png\n" + seen("redone") +
                       "picture redone-picture.png\noutput final\npicture final.png\noutput depth\n"
                       "picture depth-picture.png\ntab edit\nwindow edit.png\n" +
                       seen("pressed") + seen("far") + "hold-frame go\n" + seen("dragged") + seen("deleted") +
                       "save-model left.tgz\n",
                   "reached depth.png\nclick 70 " + row + "\nseen undone\nclick 220 " + row +
                       "\nseen redone\nreached edit.png\n"
                       "to 14 " +
                       bars + "\npress 1\nseen pressed\nto 60 " + bars + "\nto 150 " + bars +
                       "\nseen far\nreached go.held\nrelease 1\nto 500 600\ntouch go\nseen dragged\nkey Delete\n"
                       "seen deleted\n",
                   {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
  // The range ends where the button went up, though the pointer was elsewhere when the frame began, and is marked
  // while it says what is selected.
  const auto marked = [&](const char* window) {
    const Image image = shop.read(window);
    int orange = 0;
    for (int x = 20; x < 140; ++x) orange += image.at(x, count_row + 70, 0) > image.at(x, count_row + 70, 2) + 0.1f;
    return orange > 60;
  };
  CHECK(marked("dragged.png"));
  CHECK_FALSE(marked("deleted.png"));
  CHECK(psnr(shop.read("undone-picture.png"), shop.read("final.png")) > 60);
  CHECK(psnr(shop.read("redone-picture.png"), shop.read("depth-picture.png")) > 60);
  CHECK(psnr(shop.read("final.png"), shop.read("depth-picture.png")) < 45);
  const GaussianModel whole = readBundle(shop / "model.tgz").model, left = readBundle(shop / "left.tgz").model;
  CHECK(left.size() < whole.size());
  // Opacities up to about the middle are gone.
  double lowest = 1, highest = 0;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    lowest = std::min(lowest, opacityOf(whole, i));
    highest = std::max(highest, opacityOf(whole, i));
  }
  for (std::size_t i = 0; i < left.size(); ++i) CHECK(opacityOf(left, i) > lowest + 0.3 * (highest - lowest));
}

TEST_CASE("a slider is dragged, and its mark lies below its digits", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("script.txt", "wait 3\ntab time\nwindow whole.png\nresolution 0.5\nwait 2\nwindow half.png\n");
  REQUIRE(shop.tgview({"model.tgz", "--script", "script.txt", "--size", kHigh, "--backend", backendOr("cpu")},
                      test::kXServer)
              .exit_code == 0);
  const Image half = shop.read("half.png");
  const int bottom = lastChangedRow(shop.read("whole.png"), half);
  const std::string row = std::to_string(bottom - kHalfButton);
  test::playByHand(shop,
                   "panel on\nsize " + kHigh + "\ntab time\nwindow begin.png\n" + seen("held") + seen("dragged") +
                       seen("released") + "picture smaller.png\nresolution 1\npicture whole.png\n",
                   "reached begin.png\nto 150 " + row + "\npress 1\nseen held\nto 120 " + row + "\nto 80 " + row +
                       "\nseen dragged\nrelease 1\nseen released\n");
  CHECK(shop.read("smaller.png").width < shop.read("whole.png").width);
  // No blue among the digits, which are grey: but below them.
  const auto blue = [&](int from, int to) {
    int count = 0;
    for (int y = from; y < to; ++y) {
      for (int x = 20; x < 260; ++x) count += half.at(x, y, 2) - half.at(x, y, 0) > 0.2f;
    }
    return count;
  };
  CHECK(blue(bottom - 18, bottom - 3) == 0);
  CHECK(blue(bottom - 3, bottom + 1) > 20);
}

TEST_CASE("a double click on a slider within one frame opens its field", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("script.txt", "wait 3\ntab time\nwindow whole.png\nresolution 0.5\nwait 2\nwindow half.png\n");
  REQUIRE(shop.tgview({"model.tgz", "--script", "script.txt", "--size", kHigh, "--backend", backendOr("cpu")},
                      test::kXServer)
              .exit_code == 0);
  const std::string row = std::to_string(lastChangedRow(shop.read("whole.png"), shop.read("half.png")) - kHalfButton);
  test::playByHand(shop,
                   "panel on\nsize " + kHigh + "\ntab time\npicture whole.png\nhold-frame go\n" + seen("typed") +
                       "picture half.png\n",
                   "reached go.held\nto 200 " + row +
                       "\nxdotool click --repeat 2 --delay 30 1 type 50\nkey Return\ntouch go\nseen typed\n",
                   {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
  CHECK(std::abs(shop.read("half.png").width - shop.read("whole.png").width / 2) <= 1);
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
