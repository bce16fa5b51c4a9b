// SPDX-License-Identifier: Apache-2.0
// What is asked before something is lost.
#include "viewer/view/desktop.h"

#include <algorithm>
#include <utility>

#include "core/bundle/camera_file.h"
#include "viewer/view/state.h"

namespace tg {
namespace {

bool isUnsaved(const ViewerState& state, Unsaved what) {
  const DesktopState& desktop = state.desktop;
  if (std::find(desktop.discarded.begin(), desktop.discarded.end(), what) != desktop.discarded.end()) return false;
  if (what == Unsaved::path) {
    return !state.path.path.keys.empty() &&
           (desktop.kept_path.keys.empty() || formatPath(state.path.path) != formatPath(desktop.kept_path));
  }
  return !desktop.bookmarks_kept && !state.camera.bookmarks.empty() &&
         formatCameras(state.camera.bookmarks) != desktop.kept_bookmarks;
}

// A model takes its bookmarks with it, the window everything.
void goOn(ViewerState& state, int document) {
  const bool window = document < 0;
  for (const Unsaved what : {Unsaved::path, Unsaved::bookmarks}) {
    const bool goes = window || (what == Unsaved::bookmarks && document == state.documents.shown);
    if (!goes || !isUnsaved(state, what)) continue;
    state.desktop.question = ClosingQuestion{document, what};
    return;
  }
  state.desktop.discarded.clear();
  if (window) {
    state.quit = true;
  } else {
    state.documents.close_request = document;
  }
}

}  // namespace

void askToQuit(ViewerState& state) { goOn(state, -1); }

void askToClose(ViewerState& state, int document) {
  if (document >= 0) goOn(state, document);
}

void saveUnsaved(ViewerState& state) {
  state.desktop.after_saving = std::exchange(state.desktop.question, std::nullopt);
  if (!state.desktop.after_saving) return;
  state.desktop.wanted = state.desktop.after_saving->what == Unsaved::path ? FileUse::savePath : FileUse::saveBookmarks;
}

void discardUnsaved(ViewerState& state) {
  const auto question = std::exchange(state.desktop.question, std::nullopt);
  if (!question) return;
  state.desktop.discarded.push_back(question->what);
  goOn(state, question->document);
}

void notePathKept(ViewerState& state) { state.desktop.kept_path = state.path.path; }

void noteBookmarksKept(ViewerState& state) { state.desktop.kept_bookmarks = formatCameras(state.camera.bookmarks); }

void keepUnsaved(ViewerState& state) {
  state.desktop.question.reset();
  state.desktop.discarded.clear();
}

bool isModal(const ViewerState& state) { return state.desktop.dialog || state.desktop.question; }

}  // namespace tg
