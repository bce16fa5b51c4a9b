// SPDX-License-Identifier: Apache-2.0
// What follows from a dialog, without a window.
#include "viewer/window/desktop_control.h"

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "viewer/keys.h"
#include "viewer/view/path_editor.h"

using namespace tg;

namespace {

ViewerState stateWithModel() {
  Scene scene;
  scene.path = "tiny.tgz";
  scene.model = std::make_shared<GaussianModel>(tinyTexturedModel(4));
  measure(scene);
  ViewerState state;
  state.documents.open.emplace_back().path = scene.path;
  state.documents.shown = 0;
  setScene(state, scene);
  addKey(state);
  return state;
}

// As Enter leaves it.
void choose(ViewerState& state, FileUse use, const std::filesystem::path& folder, const std::string& text) {
  FileDialog& dialog = state.desktop.dialog.emplace();
  dialog.use = use;
  dialog.model = state.scene.path;
  dialog.browser.saves = true;
  enterFolder(dialog.browser, folder);
  dialog.browser.text = text;
  dialog.chosen = folder / text;
}

}  // namespace

TEST_CASE("what cannot be written brings its dialog back with the name and the reason") {
  const TemporaryFolder folder;
  for (const FileUse use : {FileUse::savePath, FileUse::saveModel}) {
    ViewerState state = stateWithModel();
    DesktopControl control({}, [] {});
    const std::string name = use == FileUse::savePath ? "named.json" : "named.tgz";
    choose(state, use, folder.path, "missing/" + name);
    state.desktop.after_saving = Closing{Closing::Way::model, state.scene.path};
    const auto update = [&](const std::function<bool()>& until) {
      const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
      do {
        (void)control.update(state, nullptr, {64, 48});
        if (!until()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      } while (!until() && std::chrono::steady_clock::now() < end);
    };
    update([&] { return state.desktop.dialog && !state.desktop.dialog->chosen; });
    REQUIRE(state.desktop.dialog);
    CHECK(state.desktop.dialog->use == use);
    CHECK(state.desktop.dialog->browser.text == "missing/" + name);
    CHECK_THAT(state.desktop.dialog->problem, Contains(name));
    CHECK(state.messages.error.empty());
    CHECK(state.desktop.after_saving);  // still follows
    CHECK_FALSE(state.documents.close_request);
    choose(state, use, folder.path, name);
    update([&] { return std::filesystem::exists(folder / name) && !state.desktop.saving; });
    CHECK(std::filesystem::exists(folder / name));
    CHECK_FALSE(state.desktop.dialog);
    CHECK(state.documents.close_request == 0);
  }
}

TEST_CASE("a dialog does not come back by itself while the user drags or types") {
  const TemporaryFolder folder;
  ViewerState state = stateWithModel();
  DesktopControl control({}, [] {});
  choose(state, FileUse::saveModel, folder.path, "missing/named.tgz");
  for (int i = 0; i < 30; ++i) {
    (void)control.update(state, nullptr, {64, 48}, true);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK_FALSE(state.desktop.dialog);
  CHECK(state.desktop.saving);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!state.desktop.dialog && std::chrono::steady_clock::now() < end) {
    (void)control.update(state, nullptr, {64, 48});
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK(state.desktop.dialog);
}

TEST_CASE("a model that could not be written and was closed meanwhile is an error and brings no dialog back") {
  const TemporaryFolder folder;
  ViewerState state = stateWithModel();
  DesktopControl control({}, [] {});
  choose(state, FileUse::saveModel, folder.path, "missing/named.tgz");
  (void)control.update(state, nullptr, {64, 48});
  CHECK(state.desktop.saving);
  state.documents.open.clear();
  state.documents.shown = -1;
  state.scene = {};
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (state.desktop.saving && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    (void)control.update(state, nullptr, {64, 48});
  }
  CHECK_FALSE(state.desktop.dialog);
  CHECK_THAT(state.messages.error, Contains("named.tgz"));
  // The same where it is closed before the name is chosen.
  state.messages.error.clear();
  choose(state, FileUse::saveModel, folder.path, "named.tgz");
  state.desktop.dialog->model = "tiny.tgz";
  (void)control.update(state, nullptr, {64, 48});
  CHECK_THAT(state.messages.error, Contains("tiny.tgz"));
}

TEST_CASE("what cannot be written while another dialog is asked for is an error of the window") {
  ViewerState state = stateWithModel();
  state.desktop.wanted = FileUse::open;
  sayNotWritten(state, FileDialog{}, "a.tgz: no room");
  CHECK(state.messages.error == "a.tgz: no room");
  CHECK_FALSE(state.desktop.dialog);
}

TEST_CASE("a picture of the key P is of no dialog") {
  ViewerState state = stateWithModel();
  state.capture.dialog.emplace();
  test::press(state, 'P');
  CHECK_FALSE(state.capture.picture.empty());
  CHECK_FALSE(state.capture.dialog);
}

TEST_CASE("what cannot be written beside another dialog is an error of the window") {
  ViewerState state = stateWithModel();
  choose(state, FileUse::savePath, ".", "path.json");
  sayNotWritten(state, FileDialog{}, "a.tgz: no room");
  CHECK(state.messages.error == "a.tgz: no room");
  CHECK(state.desktop.dialog->problem.empty());
}

TEST_CASE("the dialog that saves a model says that the crop box cuts nothing off, and no other dialog does") {
  for (const FileUse use : {FileUse::saveModel, FileUse::savePicture}) {
    for (const bool crop : {true, false}) {
      ViewerState state = stateWithModel();
      state.display.crop = crop;
      state.desktop.wanted = use;
      DesktopControl control({}, [] {});
      (void)control.update(state, nullptr, {64, 48});
      REQUIRE(state.desktop.dialog);
      CHECK(state.desktop.dialog->note.empty() == (use != FileUse::saveModel || !crop));
    }
  }
}
