// SPDX-License-Identifier: Apache-2.0
// Drives the window from a text file, one command a line: tests of the real window, and pictures for the manual.
#pragma once
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "viewer/script/verb.h"
#include "viewer/view/state.h"

namespace tg {

// Empty lines are skipped, and lines from a word that begins with '#'. docs/viewer.md lists the commands.
struct ScriptCommand {
  int line = 0;
  std::string verb;
  std::vector<std::string> words;
};

struct Script {
  std::string path;
  std::span<const Verb> more;  // verbs beside the viewer's own
  std::vector<ScriptCommand> commands;
  std::size_t next = 0;
  int rounds = 0;            // times that `repeat` was reached
  int wait = 0;              // frames still to draw before the next command
  bool keeps_going = false;  // after what the viewer says did not work
  std::string error;         // what the viewer may show: of a session, or of a device that another replaced
  double waiting_since = 0;  // [s] window time of the command that waits for a model; 0: none does
};

// Throws Error(badData) with the line for an unknown command or a wrong number of words; Error(cannotRead).
// `more`, which must outlive the script: verbs beside the viewer's own.
Script readScript(const std::filesystem::path& path, std::span<const Verb> more = {});
Script parseScript(const std::string& text, const std::string& path, std::span<const Verb> more = {});

// Runs commands up to the first that needs a frame to be drawn; after the last one, asks the viewer to quit. Returns
// the window size that a command asked for. Throws Error(badData) with the line for a wrong value, and with the last
// command's when the viewer shows an error before the next one.
std::optional<glm::ivec2> step(Script& script, ViewerState& state);

// Throws the error again with the last command's line: of what takes frames, recordings and pictures of the window.
[[noreturn]] void failAtLast(const Script& script, const Error& error);

}  // namespace tg
