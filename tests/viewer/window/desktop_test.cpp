// SPDX-License-Identifier: Apache-2.0
// The real window as a program of a desktop: dialogs, menus, questions, full screen, by keyboard and pointer.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "converter/registry/file_format.h"
#include "core/bundle/camera_file.h"
#include "core/file/file.h"
#include "core/image/metrics.h"
#include "support/catch.h"
#include "viewer/window/hand.h"

using namespace tg;
using test::noHand;
using test::playByHand;
using test::seen;
using test::Workshop;

namespace {

std::string lineOf(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

double share(const Image& a, const Image& b) {
  double changed = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) changed += std::abs(a.data[i] - b.data[i]) > 0.05;
  return changed / static_cast<double>(a.data.size());
}

// Ctrl+Q or Esc (`leave`) asks, and Esc goes back: `before` is what the script does first, before.png of it, `end` what
// the hand does last.
void askedOnLeaving(const Workshop& shop, const std::string& before, const std::string& leave, const std::string& end) {
  playByHand(shop,
             before + "await-file pressed\nwait 30\n" + seen("asked") + "await-file left\nwait 30\n" + seen("back") +
                 "await-file never\n",
             "reached before.png\n" + leave + "touch pressed\nseen asked\nkey Escape\ntouch left\nseen back\n" + end);
  CHECK(share(shop.read("before.png"), shop.read("asked.png")) > 0.05);
  CHECK(share(shop.read("before.png"), shop.read("back.png")) < 0.1);  // but for lines that fade
}

}  // namespace

TEST_CASE("a window without a file opens one by the keyboard alone, and its title is that of what is open",
          "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  playByHand(shop,
             seen("asked") +
                 "await-file chosen\nwait 6\npicture got.png\nwindow open.png\nawait-file title-1\nclose-document "
                 "0\nwait 3\n" +
                 seen("closed") + "await-file title-2\n",
             "xdotool getwindowname \"$window\" > title-0\nkey ctrl+o\nseen asked\nxdotool type mode\nkey Tab\n"
             "key Return\ntouch chosen\nreached open.png\nxdotool getwindowname \"$window\" > t\nmv t title-1\n"
             "seen closed\nxdotool getwindowname \"$window\" > t\nmv t title-2\n",
             {});
  CHECK(share(shop.read("ready.png"), shop.read("asked.png")) > 0.05);
  CHECK(shop.read("got.png").width == 640);
  CHECK(psnr(shop.read("ready.png"), shop.read("closed.png")) > 60);
  CHECK(lineOf(shop / "title-0") == "tgview");
  CHECK(lineOf(shop / "title-1") == "tgview - model.tgz");
  CHECK(lineOf(shop / "title-2") == "tgview");
}

TEST_CASE("a model is saved under a typed name, and a file that is there only when asked twice", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  shop.write("there.ply", "a file");
  playByHand(shop, "await-file copy.spz\nwait 2\n" + seen("warned") + "await-file replaced\nwait 2\nwindow end.png\n",
             "key ctrl+s\nkey ctrl+a\nxdotool type copy.spz\nkey Return\nreached copy.spz\n"
             "key ctrl+s\nkey ctrl+a\nxdotool type there.ply\nkey Return\nseen warned\ncp there.ply still.ply\n"
             "key Return\nfor i in $(seq 1200); do cmp -s there.ply still.ply || break; sleep 0.05; done\ntouch "
             "replaced\nreached end.png\n");
  CHECK(readModel(shop / "copy.spz").model.size() == test::sampleModel().size());
  CHECK(lineOf(shop / "still.ply") == "a file");
  CHECK(readModel(shop / "there.ply").model.size() == test::sampleModel().size());
}

TEST_CASE("a path that was not saved is asked for, Esc goes back, Save saves it and ends", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  askedOnLeaving(shop, "path-lines off\nadd-key\nwait 2\nwindow before.png\nawait-file told\nwait 4\nwindow told.png\n",
                 "key Escape\nseen told\nkey Escape\n", "key ctrl+q\nsleep 0.3\nkey Return\nsleep 0.3\nkey Return\n");
  CHECK(std::filesystem::exists(shop / "path.json"));
}

TEST_CASE("Ctrl+Q during a recording asks, and Enter ends the window after the last picture", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  playByHand(shop,
             "record-size 160x120\nrecord-frames 400\nrecord turn/####.png\nwait 3\nwindow begun.png\n" +
                 seen("asked") + "await-file never\n",
             "reached begun.png\nkey ctrl+q\nseen asked\nkey Return\n");
  CHECK(std::filesystem::exists(shop / "turn/0399.png"));
}

TEST_CASE("a picture is of the model that its dialog was opened for", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  test::writeSample(shop / "other.tgz", 30);
  playByHand(shop,
             "picture own.png\nawait-file dialog\nopen other.tgz\npicture other.png\nawait-file got.png\nwait 2\n",
             "reached own.png\nkey ctrl+p\nsleep 0.5\ntouch dialog\nreached other.png\nkey ctrl+a\n"
             "xdotool type got.png\nkey Return\nreached got.png\n");
  CHECK(psnr(shop.read("own.png"), shop.read("other.png")) < 40);
  CHECK(psnr(shop.read("own.png"), shop.read("got.png")) > 60);
}

TEST_CASE("a window that is told to stop keeps its session and ends by the signal", "[window]") {
  TG_SKIP_IF(noHand());
  for (const auto& [signal, code] : {std::pair("TERM", "143"), {"HUP", "129"}}) {
    INFO(signal);
    const Workshop shop;
    test::writeSample(shop / "model.tgz");
    playByHand(shop, "bookmark\nwindow marked.png\nawait-file never\n",
               "reached marked.png\nkill -s " + std::string(signal) + " $tgview\ncode=0\nwait $tgview || code=$?\n" +
                   "echo $code > code\nexit 0\n",
               {"model.tgz", "--session", "session.json"});
    CHECK(lineOf(shop / "code") == code);
    std::ifstream session(shop / "session.json");
    CHECK(std::string(std::istreambuf_iterator<char>(session), {}).find("view 1") != std::string::npos);
  }
}

TEST_CASE("Esc twice within one frame leaves the window open and says that once more ends it", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  playByHand(shop, "hold-frame go\nwait 6\nwindow told.png\nawait-file never\n",
             "reached go.held\nkey Escape\nkey Escape\ntouch go\nreached told.png\n"
             "for i in $(seq 100); do kill -0 $tgview || break; key Escape; sleep 0.3; done\n",
             {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
  CHECK(share(shop.read("ready.png"), shop.read("told.png")) > 0);
}

TEST_CASE("edits that were not saved are asked for, and Save replaces the model's own file and ends", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  askedOnLeaving(shop, "select x>0\ndelete-selection\nwindow before.png\n", "cp model.tgz whole.tgz\nkey ctrl+q\n",
                 "key ctrl+q\nsleep 0.3\nkey Return\nsleep 0.3\nkey Return\nsleep 0.3\n"
                 "cmp model.tgz whole.tgz || exit 93\nkey Return\n");
  const std::size_t left = readModel(shop / "model.tgz").model.size();
  CHECK(left > 0);
  CHECK(left < readModel(shop / "whole.tgz").model.size());
}

TEST_CASE("Esc closes the list that is open and not the viewer", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  playByHand(
      shop, "panel on\nsize 900x600\nwait 3\nwindow before.png\n" + seen("menu") + seen("closed") + seen("over"),
      "reached before.png\nclick 30 10\nsleep 0.3\nto 700 500\nseen menu\nkey Escape\nseen closed\nkey h\nto 700 0\n"
      "sleep 0.3\nseen over\n");
  CHECK(share(shop.read("before.png"), shop.read("menu.png")) > 0.05);
  CHECK(psnr(shop.read("before.png"), shop.read("closed.png")) > 40);
  // Without the panel the menu comes to the pointer: a bar across the window.
  const Image over = shop.read("over.png");
  CHECK(std::abs(over.at(890, 4, 0) - over.at(500, 4, 0)) < 0.02);
  CHECK(over.at(890, 4, 0) < 0.3);  // the model's background is white
}

TEST_CASE("F11 fills the screen and gives it back", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  playByHand(shop, "await-file big\nwait 4\nwindow big.png\nawait-file small\nwait 4\nwindow small.png\n",
             "key F11\nsized 1024x768\ntouch big\nreached big.png\nkey Escape\nsized 640x480\ntouch small\nreached "
             "small.png\n");
  CHECK(shop.read("big.png").width == 1024);
  CHECK(shop.read("big.png").height == 768);
  CHECK(shop.read("small.png").width == 640);
  CHECK(shop.read("small.png").height == 480);
}

TEST_CASE("a device that fails leaves the full screen and what lies behind it", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  playByHand(
      shop,
      "await-file big\nlose-window-device\nwait 30\nwindow big.png\nawait-file small\nwait 4\nwindow "
      "small.png\n",
      "key F11\nsized 1024x768\ntouch big\nreached big.png\nwindow=$(xdotool search --onlyvisible --name '^tgview' | "
      "head -n 1)\nxdotool windowfocus --sync $window\nkey Escape\nkey Escape\nsized 640x480\ntouch small\nreached "
      "small.png\n",
      {"model.tgz"}, TG_TGVIEW_UNDER_TEST);
  CHECK(shop.read("big.png").width == 1024);
  CHECK(shop.read("small.png").width == 640);
  CHECK(shop.read("small.png").height == 480);
}

TEST_CASE("the wheel goes to the pointer, a double click brings what it hits to the middle without a turn",
          "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  playByHand(shop,
             "save-camera start.json\nwindow start.png\n" + seen("wheeled") +
                 "save-camera near.json\nkey Shift+F\n"
                 "window reset.png\n" +
                 seen("clicked") + "wait 20\nsave-camera centred.json\n",
             "reached start.png\nto 400 200\nwheel 4\nwheel 4\nseen wheeled\nreached reset.png\nto 380 250\n"
             "xdotool click --repeat 2 --delay 60 1 getmouselocation >/dev/null\nsleep 0.5\nseen clicked\n");
  const Camera start = readCameras(shop / "start.json").front(), near = readCameras(shop / "near.json").front();
  const Camera centred = readCameras(shop / "centred.json").front();
  const glm::dvec3 zoomed = start.rotation * (near.position() - start.position());
  CHECK(zoomed.x > 0);  // right
  CHECK(zoomed.y < 0);  // up
  CHECK(zoomed.z > 0);  // forward
  const glm::dvec3 moved = start.rotation * (centred.position() - start.position());
  CHECK(moved.x > 0);
  CHECK(std::abs(moved.z) < 1e-6);
  CHECK(centred.rotation == start.rotation);
}

TEST_CASE("a letter with Ctrl is not the letter, and the camera goes through the clipboard", "[window]") {
  TG_SKIP_IF(noHand());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  playByHand(shop,
             "window start.png\n" + seen("chords") + "save-camera a.json\norbit 30 10\nwindow away.png\n" +
                 seen("pasted") + "save-camera b.json\n",
             "reached start.png\nkey ctrl+5\nkey ctrl+h\nkey ctrl+c\nsleep 0.3\nseen chords\nreached away.png\n"
             "key ctrl+v\nsleep 0.3\nseen pasted\n");
  CHECK(psnr(shop.read("start.png"), shop.read("chords.png")) > 20);  // not depth
  const Camera a = readCameras(shop / "a.json").front(), b = readCameras(shop / "b.json").front();
  CHECK(glm::distance(a.position(), b.position()) < 1e-6);
}

TEST_CASE("names are written in letters that the interface itself does not need", "[window]") {
  TG_SKIP_IF(test::noWindow());
  TG_SKIP_IF(isFile("/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf") ? "" : "no package fonts-dejavu-core");
  const Workshop shop;
  std::vector<Image> windows;
  for (const std::string name : {"\u0430\u0431\u0432.tgz", "\u0433\u0434\u0435.tgz"}) {
    test::writeSample(shop / name);
    shop.write("script.txt", "wait 6\nwindow window.png\n");
    const test::ProcessResult result = shop.tgview(
        {name, "--script", "script.txt", "--size", "700x300", "--backend", test::backendOr("vulkan"), "--validation"},
        test::kXServer);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    windows.push_back(shop.read("window.png"));
  }
  CHECK(share(windows[0], windows[1]) > 0);  // no question marks, which are alike
}

TEST_CASE("open models whose long names differ at their ends can be told apart", "[window]") {
  TG_SKIP_IF(test::noWindow());
  const Workshop shop;
  test::writeSample(shop / "shown.tgz");
  std::vector<Image> windows;
  for (const char* end : {"one", "two"}) {
    const std::string name = "a_name_that_is_much_too_long_for_the_list_and_for_what_is_compared_" + std::string(end);
    test::writeSample(shop / (name + ".tgz"));
    shop.write("script.txt", "open shown.tgz\nwait 6\nwindow window.png\n");
    const test::ProcessResult result =
        shop.tgview({name + ".tgz", "--script", "script.txt", "--size", "700x300", "--backend", test::backendOr("cpu")},
                    test::kXServer);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    windows.push_back(shop.read("window.png"));
  }
  // Lines of text in which they differ: in the list, and as what is compared with.
  int lines = 0, last = -100;
  for (int y = 0; y < windows[0].height; ++y) {
    bool differs = false;
    for (int x = 0; x < 270; ++x) differs = differs || std::abs(windows[0].at(x, y, 0) - windows[1].at(x, y, 0)) > 0.1;
    if (!differs) continue;
    lines += y > last + 10;
    last = y;
  }
  CHECK(lines == 2);
}
