// SPDX-License-Identifier: Apache-2.0
// What a window has besides its pictures: file dialogs, the question before it closes, the full screen, the clipboard.
// Keys and panels ask here; the window answers.
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "viewer/view/camera_path.h"
#include "viewer/view/file_browser.h"

namespace tg {

struct ViewerState;

// What a file is chosen for.
enum class FileUse { open, saveModel, savePicture, savePath, saveBookmarks };

struct FileDialog {
  FileUse use = FileUse::open;
  FileBrowser browser;
  std::optional<std::filesystem::path> chosen;  // the window takes it
  bool fresh = true;                            // not drawn yet
};

// What the user is asked about before it is lost.
enum class Unsaved { path, bookmarks };

struct ClosingQuestion {
  int document = -1;  // of the open ones, which is to be closed; -1: the window is
  Unsaved what = Unsaved::path;
};

struct DesktopState {
  std::optional<FileUse> wanted;     // a dialog to be opened
  std::optional<FileDialog> dialog;  // that is open
  std::optional<ClosingQuestion> question;
  std::optional<ClosingQuestion> after_saving;  // goes on once that is saved
  bool fullscreen = false;
  std::optional<glm::ivec2> turn_about;  // [px] of the picture: what is seen there is to be the pivot
  bool copy = false, paste = false;      // the camera, by the clipboard
  bool bookmarks_kept = false;           // between runs, so that none is lost
  CameraPath kept_path;                  // as it was read or saved last
  std::string kept_bookmarks;            // the same, as their file has them
  std::vector<Unsaved> discarded;        // the user said so
};

// Close the window, or one of the open models; what is not saved is asked for first.
void askToQuit(ViewerState& state);
void askToClose(ViewerState& state, int document);
// The answers.
void saveUnsaved(ViewerState& state);
void discardUnsaved(ViewerState& state);
void keepUnsaved(ViewerState& state);  // nothing is closed
// After a file was read or written.
void notePathKept(ViewerState& state);
void noteBookmarksKept(ViewerState& state);

// A dialog or question is open, which gets keys and clicks.
bool isModal(const ViewerState& state);

}  // namespace tg
