// SPDX-License-Identifier: Apache-2.0
// Dialogs and what follows from them.
#include "viewer/window/desktop_control.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/bundle/camera_file.h"
#include "core/bundle/training_json.h"
#include "core/file/file.h"
#include "core/file/identity.h"
#include "core/file/web_address.h"
#include "core/system/error.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/edits.h"
#include "viewer/view/names.h"
#include "viewer/view/path_editor.h"
#include "viewer/window/glfw.h"

namespace tg {
namespace {

// The monitor that shows most of a window; null where none is known.
GLFWmonitor* monitorOf(GLFWwindow* window) {
  glm::ivec2 place, size;
  glfwGetWindowPos(window, &place.x, &place.y);
  glfwGetWindowSize(window, &size.x, &size.y);
  int count = 0;
  GLFWmonitor** monitors = glfwGetMonitors(&count);
  GLFWmonitor* best = nullptr;
  int most = -1;
  for (int i = 0; i < count; ++i) {
    const GLFWvidmode* mode = glfwGetVideoMode(monitors[i]);
    if (!mode) continue;
    glm::ivec2 at;
    glfwGetMonitorPos(monitors[i], &at.x, &at.y);
    const glm::ivec2 shared = glm::max(
        glm::min(place + size, at + glm::ivec2(mode->width, mode->height)) - glm::max(place, at), glm::ivec2(0));
    if (shared.x * shared.y <= most) continue;
    most = shared.x * shared.y;
    best = monitors[i];
  }
  return best;
}

// Pictures and bookmarks are of what is shown: false, and asked for, where that is another model by now.
bool isShown(ViewerState& state, const FileDialog& dialog) {
  if (dialog.use != FileUse::savePicture && dialog.use != FileUse::saveBookmarks) return true;
  const int document = documentOf(state, dialog.model);
  if (document < 0 || document == state.documents.shown) return true;
  state.documents.show_request = document;
  return false;
}

void copyCamera(const ViewerState& state, GLFWwindow* window, glm::ivec2 picture) {
  Camera camera = toCamera(state.camera.pose, state.camera.lens, picture.x, picture.y);
  camera.name = state.scene.path.stem().string();
  glfwSetClipboardString(window, formatCameras({camera}).c_str());
}

void pasteCamera(ViewerState& state, GLFWwindow* window) {
  const char* text = glfwGetClipboardString(window);
  const std::string copied(text ? text : "");
  if (copied.size() > kMaxCamerasBytes) throw Error(ErrorKind::badData, "clipboard: too long for a cameras.json");
  const std::vector<Camera> cameras = parseCameras(copied, "clipboard");
  if (cameras.empty()) throw Error(ErrorKind::badData, "clipboard: no camera inside (expected at least 1, found 0)");
  setCamera(state, cameras.front());
  state.path.playing = false;
}

}  // namespace

DesktopControl::DesktopControl(const ViewOptions& options, std::function<void()> wake)
    : quiet_(!options.script.empty()), saver_(std::move(wake)) {}

glm::ivec2 DesktopControl::windowSize(GLFWwindow* window) const {
  if (fullscreen_) return size_;
  glm::ivec2 size;
  glfwGetWindowSize(window, &size.x, &size.y);
  return size;
}

PixelRect DesktopControl::leaveWindow(GLFWwindow* window) {
  PixelRect place{place_, windowSize(window)};
  if (!std::exchange(fullscreen_, false)) glfwGetWindowPos(window, &place.origin.x, &place.origin.y);
  return place;
}

bool DesktopControl::update(ViewerState& state, GLFWwindow* window, glm::ivec2 picture, bool busy) {
  DesktopState& desktop = state.desktop;
  const bool modal = isModal(state);
  if (std::exchange(desktop.stays_open, false)) {
    for (Order& order : orders_) order.after.reset();
    for (auto& [order, problem] : returning_) order.after.reset();
  }
  takeSaved(state);
  if (!busy) sayReturning(state);
  if (desktop.fullscreen != fullscreen_) setFullscreen(window, desktop.fullscreen);
  if (std::exchange(desktop.copy, false)) {
    copyCamera(state, window, picture);
    if (!quiet_) notify(state, "The camera is in the clipboard, as a cameras.json");
  }
  if (std::exchange(desktop.paste, false)) attempt(state, [&] { pasteCamera(state, window); });
  if (desktop.dialog && desktop.dialog->chosen && isShown(state, *desktop.dialog)) {
    const FileDialog dialog = *std::exchange(desktop.dialog, std::nullopt);
    folder_ = dialog.chosen->parent_path();
    useFile(state, dialog);
  }
  if (const auto file = std::exchange(desktop.save_request, std::nullopt)) {
    saveModel(state, state.scene.path, *file, std::nullopt, std::nullopt);
  }
  if (desktop.wanted && !desktop.dialog) openDialog(state, *std::exchange(desktop.wanted, std::nullopt));
  // A dialog that was cancelled ends what was to follow.
  if (!desktop.dialog && !desktop.wanted) desktop.after_saving.reset();
  desktop.saving = !orders_.empty() || !returning_.empty();
  return modal != isModal(state);
}

void DesktopControl::openDialog(ViewerState& state, FileUse use) {
  if (use == FileUse::saveModel && !isWhole(state.scene)) {
    return notify(state, state.scene.streamed_from > 0
                             ? "A scene with levels of detail is not saved: tgconvert makes one"
                         : state.scene.model ? "The model is still being read"
                                             : "There is no model to save");
  }
  if (use == FileUse::savePath && state.path.path.keys.empty()) {
    return notify(state, "There is no path to save: K adds a key at the view");
  }
  if (use == FileUse::saveBookmarks && state.camera.bookmarks.empty()) {
    return notify(state, "There are no bookmarks to save: Shift+B sets one");
  }
  FileDialog& dialog = state.desktop.dialog.emplace();
  dialog.use = use;
  dialog.model = state.scene.path;
  dialog.browser.saves = use != FileUse::open;
  const std::string stem = state.scene.path.empty() ? "tgview" : state.scene.path.stem().string();
  std::filesystem::path folder = folder_;
  const bool edited = use == FileUse::saveModel && state.edit.revision != state.edit.saved;
  if ((folder.empty() || edited) && !state.scene.path.empty() && !isWebAddress(state.scene.path.string())) {
    folder = absolutePath(state.scene.path).parent_path();
  }
  const auto local = std::ranges::find_if(state.recent, [](const std::string& name) { return !isWebAddress(name); });
  if (folder.empty() && local != state.recent.end()) folder = std::filesystem::path(*local).parent_path();
  switch (use) {
    case FileUse::open:
      dialog.browser.types = readableTypes();
      dialog.browser.types.push_back({".json", ""});
      break;
    case FileUse::saveModel:
      dialog.browser.types = modelTypes(state.scene);
      if (state.display.crop) dialog.note = "What lies outside the crop box is saved, too";
      dialog.browser.text = edited ? saveTarget(state).filename().string() : stem + ".tgz";
      break;
    case FileUse::savePicture:
      dialog.browser.types = {{".png", ""}, {".jpg", ""}};
      dialog.browser.text = freeName(stem, ".png").string();
      break;
    case FileUse::savePath:
    case FileUse::saveBookmarks: {
      const std::string& file = use == FileUse::savePath ? state.path.file : state.camera.bookmark_file;
      dialog.browser.types = {{".json", ""}};
      dialog.browser.text = std::filesystem::path(file).filename().string();
      break;
    }
  }
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored)) folder = std::filesystem::current_path(ignored);
  enterFolder(dialog.browser, folder);
}

void DesktopControl::useFile(ViewerState& state, const FileDialog& dialog) {
  const std::filesystem::path& file = *dialog.chosen;
  DesktopState& desktop = state.desktop;
  const auto after = std::exchange(desktop.after_saving, std::nullopt);
  bool saved = false;
  const auto save = [&](const std::function<void()>& write) {
    attempt(state, [&] {
      write();
      notify(state, "Saved " + file.string());
      saved = true;
    });
    if (saved) return;
    desktop.after_saving = after;
    sayNotWritten(state, dialog, std::exchange(state.messages.error, ""));
  };
  switch (dialog.use) {
    case FileUse::open:
      state.documents.open_requests.push_back(file);
      break;
    case FileUse::saveModel:
      saveModel(state, dialog.model, file, after, dialog);
      break;
    case FileUse::savePicture:
      state.capture.picture = file;
      state.capture.dialog = dialog;
      break;
    case FileUse::savePath:
      state.path.file = file.string();
      save([&] { savePath(state, file); });
      if (saved) notePathKept(state);
      break;
    case FileUse::saveBookmarks:
      state.camera.bookmark_file = file.string();
      save([&] { saveBookmarks(state, file); });
      if (saved) noteBookmarksKept(state);
      break;
  }
  if (after && saved) goOnClosing(state, *after);
}

// The one that the dialog was opened for: another one may be shown by now.
void DesktopControl::saveModel(ViewerState& state, const std::filesystem::path& model,
                               const std::filesystem::path& file, std::optional<Closing> after,
                               std::optional<FileDialog> dialog) {
  const int document = documentOf(state, model);
  if (document < 0) {
    state.messages.error = model.string() + ": is not saved (expected an open model, found that it was closed)";
    return;
  }
  const bool shown = document == state.documents.shown;
  const Document& open = state.documents.open[static_cast<std::size_t>(document)];
  const EditState& edit = shown ? state.edit : open.edit;
  Scene saved = shown ? state.scene : open.scene;
  if (edit.revision != edit.read) noteEdited(saved.training_json);
  saver_.save(file, std::move(saved), edit.revision);
  orders_.push_back({std::move(after), std::move(dialog)});
  if (!quiet_) notify(state, "Saving " + file.string());
}

void DesktopControl::takeSaved(ViewerState& state) {
  while (const auto news = saver_.take()) {
    Order order = std::move(orders_.front());
    orders_.pop_front();
    if (!news->problem.empty()) {
      if (quiet_) throw Error(static_cast<ErrorKind>(news->error_kind), news->problem);
      returning_.emplace_back(std::move(order), news->problem);
      state.quit = false;
      continue;
    }
    if (!quiet_) {
      std::string text = "Saved " + news->path.string();
      for (const std::string& warning : news->warnings) text += "\n" + warning;
      const int document = documentOf(state, news->model);
      if (!news->whole && document >= 0 && hasUnsavedEdits(state, document)) {
        text += "\nThat is not all of the model: its edits still count as not saved";
      }
      notify(state, text);
    }
    if (!news->whole) continue;
    // What is shown is what its own file holds now.
    if (const int document = documentOf(state, news->model); document >= 0 && sameFile(news->path, news->model)) {
      sceneAt(state, document).file = identityOf(news->path);
    }
    noteModelKept(state, news->model, news->revision);
    if (order.after) goOnClosing(state, *order.after);
  }
}

void DesktopControl::sayReturning(ViewerState& state) {
  for (; !returning_.empty(); returning_.pop_front()) {
    auto& [order, problem] = returning_.front();
    state.quit = false;  // who left meanwhile is to hear of it, too
    // A dialog for a model that has been closed could save nothing.
    if (order.dialog && documentOf(state, order.dialog->model) < 0) order.dialog.reset();
    if (order.dialog && !isModal(state) && !state.desktop.wanted) state.desktop.after_saving = order.after;
    sayNotWritten(state, std::move(order.dialog), problem);
  }
}

void DesktopControl::setFullscreen(GLFWwindow* window, bool on) {
  fullscreen_ = on;
  if (!on) return glfwSetWindowMonitor(window, nullptr, place_.x, place_.y, size_.x, size_.y, GLFW_DONT_CARE);
  glfwGetWindowPos(window, &place_.x, &place_.y);
  glfwGetWindowSize(window, &size_.x, &size_.y);
  GLFWmonitor* monitor = monitorOf(window);
  const GLFWvidmode* mode = monitor ? glfwGetVideoMode(monitor) : nullptr;
  if (mode) glfwSetWindowMonitor(window, monitor, 0, 0, mode->width, mode->height, mode->refreshRate);
}

}  // namespace tg
