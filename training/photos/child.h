// SPDX-License-Identifier: Apache-2.0
// Another program as a child of this one: no shell, its words in a log, gone when this one is.
#pragma once
#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tg {

// Thrown out of what was stopped by its user, at a moment from which the same command goes on.
struct Stopped : std::exception {
  const char* what() const noexcept override { return "stopped"; }
};

// What a program's name stands for on the PATH; a name with a slash is itself. None: no such program.
std::optional<std::filesystem::path> findProgram(const std::string& name);

struct ChildCommand {
  std::vector<std::string> words;              // the program's path, then its arguments
  std::filesystem::path log;                   // what it says is added to this file
  std::function<void(std::string_view)> line;  // told of each line that it says, if given
  // Takes standard output, if given; else that goes where standard error goes, to the log.
  std::function<void(std::span<const std::uint8_t>)> output;
  std::filesystem::path folder = {};          // that it works in; empty: where this program does
  std::chrono::seconds patience{5};           // for a child that was asked to end; then it is killed
  std::function<void()> meanwhile = nullptr;  // called ten times a second at least; what it throws ends the child
};

struct ChildEnd {
  int code = 0;      // its exit code; 128 + N after signal N
  std::string last;  // lines of what it said, without traces of its stack
};

// Runs it to its end; once `stop` is set, ends it and throws Stopped. It also ends when this program is killed. Call it
// from the main thread: a child goes with the thread that began it. Throws Error(device) where it cannot be started,
// Error(cannotWrite) for the log.
ChildEnd runChild(const ChildCommand& command, const std::atomic<int>& stop);

}  // namespace tg
