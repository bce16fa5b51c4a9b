// SPDX-License-Identifier: Apache-2.0
// Between DesktopState and the rest: opens dialogs, does what a file was chosen for, full screen, clipboard.
#pragma once
#include <deque>
#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <utility>

#include "viewer/model/model_saver.h"
#include "viewer/view/options.h"
#include "viewer/view/state.h"
#include "viewer/window/screen.h"

struct GLFWwindow;

namespace tg {

class DesktopControl {
 public:
  // `wake` is called in another thread when a file has been written.
  DesktopControl(const ViewOptions& options, std::function<void()> wake);

  // Once a frame, in the window's thread. `picture`: size of the picture's camera [px]. True when something that can be
  // seen has changed.
  // `busy`: the user drags or types, which a dialog that comes by itself must not take.
  bool update(ViewerState& state, GLFWwindow* window, glm::ivec2 picture, bool busy = false);
  // Of the window when it is not full screen.
  glm::ivec2 windowSize(GLFWwindow* window) const;
  // Another window comes instead of this one, where this one is when it is not full screen.
  PixelRect leaveWindow(GLFWwindow* window);

 private:
  void openDialog(ViewerState& state, FileUse use);
  void useFile(ViewerState& state, const FileDialog& dialog);
  void saveModel(ViewerState& state, const std::filesystem::path& model, const std::filesystem::path& file,
                 std::optional<Closing> after, std::optional<FileDialog> dialog);
  void takeSaved(ViewerState& state);
  void sayReturning(ViewerState& state);
  void setFullscreen(GLFWwindow* window, bool on);

  // Of the saver, under way.
  struct Order {
    std::optional<Closing> after;      // what follows
    std::optional<FileDialog> dialog;  // that its file was chosen in
  };

  const bool quiet_;              // a script's pictures must not show lines that fade
  std::filesystem::path folder_;  // of the last dialog
  bool fullscreen_ = false;
  glm::ivec2 place_{0}, size_{0};  // of the window before
  std::deque<Order> orders_;
  std::deque<std::pair<Order, std::string>> returning_;  // not written, and why
  ModelSaver saver_;
};

}  // namespace tg
