// SPDX-License-Identifier: Apache-2.0
// What a window has besides its pictures: file dialogs, the question before something is lost, the full screen, the
// clipboard.
// Keys and panels ask here; the window answers.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "viewer/view/camera_path.h"
#include "viewer/view/file_browser.h"

namespace tg {

struct FollowState;
struct RunOrder;
struct ViewerState;

// What a file is chosen for.
enum class FileUse { open, saveModel, savePicture, savePath, saveBookmarks };

struct FileDialog {
  FileUse use = FileUse::open;
  std::filesystem::path model;  // what was shown when it was opened
  FileBrowser browser;
  std::optional<std::filesystem::path> chosen;  // the window takes it
  bool fresh = true;                            // not drawn yet
  bool has_keyboard = false;                    // its field, or had it
  std::string note;                             // what of what is saved is not seen; "" = nothing
  std::string problem;                          // why what was chosen could not be written; "" = nothing was
};

// What the user is asked about before it is lost.
// run: nothing is lost, but it waits at this window's word. recording: one that is under way.
enum class Unsaved { path, bookmarks, edits, run, recording };

// What would lose it.
struct Closing {
  enum class Way { window, model, reading };  // reading: its file is read again
  Way way = Way::window;
  std::filesystem::path model;  // of the open ones; of the window's: none
};

struct ClosingQuestion {
  Closing closing;
  Unsaved what = Unsaved::path;
  std::filesystem::path model;  // that has the edits or bookmarks
};

struct DesktopState {
  std::optional<FileUse> wanted;     // a dialog to be opened
  std::optional<FileDialog> dialog;  // that is open
  std::optional<ClosingQuestion> question;
  std::optional<Closing> after_saving;            // goes on once that is saved
  bool after_recording = false;                   // the window closes once it has ended well
  std::vector<std::filesystem::path> read_again;  // have edits: to be asked about, one after the other
  std::vector<std::pair<std::filesystem::path, std::uint64_t>> agreed;  // are read again, and lose that revision
  std::optional<std::filesystem::path> save_request;                    // the model shown, unasked; a script's
  bool saving = false;                                                  // written by the window
  bool stays_open = false;                                              // what is being saved closes nothing any more
  bool fullscreen = false;
  std::optional<glm::ivec2> turn_about;  // [px] of the picture: what is seen there is to be the pivot
  bool copy = false, paste = false;      // the camera, by the clipboard
  bool bookmarks_kept = false;           // between runs, so that none is lost
  CameraPath kept_path;                  // as it was read or saved last
  std::string kept_bookmarks;            // the same, as their file has them
  std::vector<std::pair<Unsaved, std::filesystem::path>> discarded;  // the user said so; of which model
  std::string replaces;  // what a button without a dialog wrote, or asked to replace: use, file and model
};

// Whether a button that writes a file may: it is not there, or the button wrote it last, of the model shown, or was
// pressed once more after the user was told. `use`: what the file is to be.
bool mayReplace(ViewerState& state, const std::filesystem::path& file, std::string_view use);

// Close the window, or one of the open models; what is not saved is asked for first.
void askToQuit(ViewerState& state);
void askToClose(ViewerState& state, int document);
// Once a frame, before files are opened: one that would replace a model with edits is asked for first. True when
// something was asked.
bool guardEdits(ViewerState& state);
// Whether a file that is read again would lose edits that the user has not given up.
bool losesEdits(const ViewerState& state, int document);
void goOnClosing(ViewerState& state, const Closing& closing);  // after something was saved
// The answers.
void saveUnsaved(ViewerState& state);
void discardUnsaved(ViewerState& state);
void keepUnsaved(ViewerState& state);  // nothing is closed
// To be given to the run that is followed, by the window.
void tellRun(FollowState& follow, const RunOrder& order);
// A file could not be written: the dialog that it was chosen in comes back and says why. Without it, or while another
// one is open, it is an error of the window.
void sayNotWritten(ViewerState& state, std::optional<FileDialog> dialog, const std::string& problem);
// After a file was read or written.
void notePathKept(ViewerState& state);
void noteBookmarksKept(ViewerState& state);

// A dialog or question is open, which gets keys and clicks.
bool isModal(const ViewerState& state);

}  // namespace tg
