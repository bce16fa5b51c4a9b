// SPDX-License-Identifier: Apache-2.0
// The programs as users run them: a shell command in a folder, its exit code and what it said.
#pragma once
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "support/temporary_folder.h"

namespace tg::test {

struct Outcome {
  int code = -1;
  std::string output;  // both streams
};

// Both streams also stay in log.txt of the folder.
inline Outcome run(const TemporaryFolder& folder, const std::string& command) {
  const int status = std::system(("cd '" + folder.path.string() + "' && (" + command + ") >log.txt 2>&1").c_str());
  std::ifstream stream(folder / "log.txt");
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, {std::istreambuf_iterator<char>(stream), {}}};
}

// Gives the folder's `disk` a file system of this size: a command for `unshare -rm sh -c`.
inline std::string mountOf(const std::string& size) { return "mount -t tmpfs -o size=" + size + " none disk"; }

// Makes `disk`. For TG_SKIP_IF: "" where mountOf() may.
inline std::string missingMount(const TemporaryFolder& folder) {
  std::filesystem::create_directory(folder / "disk");
  return run(folder, "unshare -rm sh -c '" + mountOf("4k") + "'").code == 0 ? "" : "no file system may be mounted here";
}

}  // namespace tg::test
