// SPDX-License-Identifier: Apache-2.0
// The viewer as a process of its own.
#include "training/watch.h"

#include <spawn.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "core/system/error.h"

namespace tg {
namespace {

std::filesystem::path viewerProgram() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) throw Error(ErrorKind::device, "--watch: cannot tell where this program lies: " + error.message());
  return self.parent_path() / "tgview";
}

// In a process group of its own.
void start(std::vector<std::string> words) {
  requireViewer();
  const std::string viewer = viewerProgram().string();
  words.insert(words.begin(), viewer);
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawnattr_t attributes;
  if (const int error = ::posix_spawnattr_init(&attributes)) {
    throw Error(ErrorKind::device, viewer, "cannot start: " + std::generic_category().message(error));
  }
  const std::unique_ptr<posix_spawnattr_t, int (*)(posix_spawnattr_t*)> destroyed(&attributes,
                                                                                  ::posix_spawnattr_destroy);
  // A process group of its own keeps the terminal's Ctrl-C away; the training's handlers are reset by exec itself.
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  ::posix_spawnattr_setpgroup(&attributes, 0);
  // What reads our standard output is not to wait until the window is closed.
  posix_spawn_file_actions_t streams;
  int error = ::posix_spawn_file_actions_init(&streams);
  if (error == 0) error = ::posix_spawn_file_actions_adddup2(&streams, STDERR_FILENO, STDOUT_FILENO);
  pid_t process = 0;
  if (error == 0) error = ::posix_spawn(&process, viewer.c_str(), &streams, &attributes, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&streams);
  if (error != 0) {
    throw Error(ErrorKind::device, viewer, "cannot start: " + std::generic_category().message(error));
  }
}

}  // namespace

void requireViewer() {
  const std::filesystem::path viewer = viewerProgram();
  if (::access(viewer.c_str(), X_OK) != 0) {
    throw Error(ErrorKind::device, "--watch: no viewer (expected " + viewer.string() + ", built with TG_VIEWER)");
  }
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY")) {
    throw Error(ErrorKind::device, "--watch: no display (expected DISPLAY or WAYLAND_DISPLAY to be set)");
  }
}

bool canShow() {
  try {
    requireViewer();
    return true;
  } catch (const Error&) {
    return false;
  }
}

void startViewer(const std::filesystem::path& folder, const std::filesystem::path& dataset) {
  start({"--follow", "--photos=" + dataset.string(), "--", folder.string()});
}

void showModel(const std::filesystem::path& model) { start({"--", model.string()}); }

}  // namespace tg
