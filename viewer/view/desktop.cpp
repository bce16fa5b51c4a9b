// SPDX-License-Identifier: Apache-2.0
// What is asked before something is lost.
#include "viewer/view/desktop.h"

#include <algorithm>
#include <utility>

#include "core/bundle/camera_file.h"
#include "core/file/file.h"
#include "core/system/error.h"
#include "viewer/view/edits.h"
#include "viewer/view/names.h"
#include "viewer/view/state.h"

namespace tg {
namespace {

void show(ViewerState& state, const std::filesystem::path& model) {
  const int document = documentOf(state, model);
  if (document >= 0 && document != state.documents.shown) state.documents.show_request = document;
}

bool isPathUnsaved(const ViewerState& state) {
  const CameraPath& kept = state.desktop.kept_path;
  return !state.path.path.keys.empty() && (kept.keys.empty() || formatPath(state.path.path) != formatPath(kept));
}

// The models with bookmarks that would be lost, the one shown first.
std::vector<std::filesystem::path> bookmarksLost(const ViewerState& state, const Closing& closing) {
  std::vector<std::filesystem::path> models;
  if (state.desktop.bookmarks_kept || closing.way == Closing::Way::reading) return models;
  const auto look = [&](const std::filesystem::path& model, const std::vector<Camera>& bookmarks,
                        const std::string& kept) {
    const bool leaves = closing.way == Closing::Way::window || closing.model == model;
    if (leaves && !bookmarks.empty() && formatCameras(bookmarks) != kept) models.push_back(model);
  };
  look(state.scene.path, state.camera.bookmarks, state.desktop.kept_bookmarks);
  for (int i = 0; i < static_cast<int>(state.documents.open.size()); ++i) {
    const Document& document = state.documents.open[static_cast<std::size_t>(i)];
    if (i != state.documents.shown) look(document.path, document.bookmarks, document.kept_bookmarks);
  }
  return models;
}

// The open models with edits that would be lost, the one shown first.
std::vector<std::filesystem::path> editsLost(const ViewerState& state, const Closing& closing) {
  std::vector<std::filesystem::path> models = unsavedModels(state);
  if (closing.way != Closing::Way::window) std::erase_if(models, [&](const auto& m) { return m != closing.model; });
  const auto shown = std::find(models.begin(), models.end(), state.scene.path);
  if (shown != models.end()) std::iter_swap(models.begin(), shown);
  return models;
}

// Whether the run waits, or is about to, because this window has told it to: it would wait for ever.
bool holdsRun(const FollowState& follow) {
  const bool told = follow.told == RunCommand::pause || follow.told == RunCommand::step;
  if (!follow.active || !follow.status || !told) return false;
  return follow.status->phase == RunPhase::paused || follow.status->phase == RunPhase::training;
}

// True when the user is asked. The model is shown meanwhile.
bool ask(ViewerState& state, const Closing& closing, Unsaved what, const std::filesystem::path& model) {
  const auto& discarded = state.desktop.discarded;
  if (std::find(discarded.begin(), discarded.end(), std::pair(what, model)) != discarded.end()) return false;
  state.desktop.question = ClosingQuestion{closing, what, model};
  if (!model.empty()) show(state, model);
  return true;
}

}  // namespace

// A model takes its bookmarks and edits with it, the window everything, a recording that is under way among it, a file
// that is read again the edits.
void goOnClosing(ViewerState& state, const Closing& closing) {
  const bool window = closing.way == Closing::Way::window;
  const int document = documentOf(state, closing.model);
  if (!window && document < 0) return;  // is closed already
  if (window && state.record.wanted && ask(state, closing, Unsaved::recording, {})) return;
  if (window && isPathUnsaved(state) && ask(state, closing, Unsaved::path, {})) return;
  for (const std::filesystem::path& model : bookmarksLost(state, closing)) {
    if (ask(state, closing, Unsaved::bookmarks, model)) return;
  }
  for (const std::filesystem::path& model : editsLost(state, closing)) {
    if (ask(state, closing, Unsaved::edits, model)) return;
  }
  if (window && holdsRun(state.follow) && ask(state, closing, Unsaved::run, {})) return;
  state.desktop.discarded.clear();
  switch (closing.way) {
    case Closing::Way::window:
      state.quit = true;
      break;
    case Closing::Way::model:
      state.documents.close_request = document;
      break;
    case Closing::Way::reading:
      state.desktop.agreed.emplace_back(closing.model, editAt(state, document).revision);
      state.documents.open_requests.push_back(closing.model);
      break;
  }
}

void askToQuit(ViewerState& state) {
  state.desktop.discarded.clear();
  state.desktop.after_recording = false;  // is asked anew
  goOnClosing(state, {});
}

void askToClose(ViewerState& state, int document) {
  if (document < 0 || document >= static_cast<int>(state.documents.open.size())) return;
  state.desktop.discarded.clear();
  goOnClosing(state, {Closing::Way::model, state.documents.open[static_cast<std::size_t>(document)].path});
}

bool guardEdits(ViewerState& state) {
  DesktopState& desktop = state.desktop;
  std::erase_if(state.documents.open_requests, [&](const std::filesystem::path& path) {
    const int document = documentOf(state, path);
    if (document < 0 || !losesEdits(state, document) || !hasChanged(state, document)) return false;
    desktop.read_again.push_back(state.documents.open[static_cast<std::size_t>(document)].path);
    return true;
  });
  if (desktop.read_again.empty() || isModal(state) || desktop.wanted || desktop.saving) return false;
  const Closing closing{Closing::Way::reading, desktop.read_again.front()};
  desktop.read_again.erase(desktop.read_again.begin());
  desktop.discarded.clear();
  goOnClosing(state, closing);
  return true;
}

bool losesEdits(const ViewerState& state, int document) {
  const std::pair edits(state.documents.open[static_cast<std::size_t>(document)].path,
                        editAt(state, document).revision);
  return hasUnsavedEdits(state, document) && std::ranges::count(state.desktop.agreed, edits) == 0;
}

void saveUnsaved(ViewerState& state) {
  const auto question = std::exchange(state.desktop.question, std::nullopt);
  if (!question) return;
  if (question->what == Unsaved::run) {
    tellRun(state.follow, {RunCommand::go, 1});
    return goOnClosing(state, question->closing);
  }
  if (question->what == Unsaved::recording) {
    state.desktop.after_recording = state.record.wanted;
    return state.record.wanted ? void() : goOnClosing(state, question->closing);  // it has ended meanwhile
  }
  state.desktop.after_saving = question->closing;
  state.desktop.dialog.reset();
  if (question->what != Unsaved::path) show(state, question->model);  // another one may have been opened since
  switch (question->what) {
    case Unsaved::path:
      state.desktop.wanted = FileUse::savePath;
      break;
    case Unsaved::bookmarks:
      state.desktop.wanted = FileUse::saveBookmarks;
      break;
    case Unsaved::edits:
      state.desktop.wanted = FileUse::saveModel;
      break;
    case Unsaved::run:  // is told at once
    case Unsaved::recording:
      break;
  }
}

void discardUnsaved(ViewerState& state) {
  const auto question = std::exchange(state.desktop.question, std::nullopt);
  if (!question) return;
  state.desktop.discarded.emplace_back(question->what, question->model);
  goOnClosing(state, question->closing);
}

void sayNotWritten(ViewerState& state, std::optional<FileDialog> dialog, const std::string& problem) {
  endNotice(state);
  if (!dialog || isModal(state) || state.desktop.wanted) {
    state.messages.error = problem;
    return;
  }
  dialog->problem = problem;
  dialog->chosen.reset();
  dialog->fresh = true;
  dialog->has_keyboard = false;
  enterFolder(dialog->browser, dialog->browser.folder);  // as it is now
  state.desktop.dialog = std::move(dialog);
}

void tellRun(FollowState& follow, const RunOrder& order) {
  follow.order = order;
  follow.told = order.command;
}

void notePathKept(ViewerState& state) { state.desktop.kept_path = state.path.path; }

void noteBookmarksKept(ViewerState& state) { state.desktop.kept_bookmarks = formatCameras(state.camera.bookmarks); }

void keepUnsaved(ViewerState& state) {
  state.desktop.question.reset();
  state.desktop.discarded.clear();
  state.desktop.after_saving.reset();
  state.desktop.after_recording = false;
  state.desktop.stays_open = true;
}

bool mayReplace(ViewerState& state, const std::filesystem::path& file, std::string_view use) {
  // Bookmarks and recordings of another model are another file's.
  const std::string what =
      std::string(use) + " " + absolutePath(file).string() + " of " + absolutePath(state.scene.path).string();
  const bool pressed_again = std::exchange(state.desktop.replaces, what) == what;
  if (pressed_again || !isFile(file)) return true;
  notify(state, printable(file.filename().string()) + " is there already: once more replaces it");
  return false;
}

bool isModal(const ViewerState& state) { return state.desktop.dialog || state.desktop.question; }

}  // namespace tg
