// SPDX-License-Identifier: Apache-2.0
// What every program does alike: --version, wrong command lines, errors to exit codes.
#pragma once
#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "core/system/names.h"

namespace tg {

// Adds --version, --completion and --man (but to a command of a program, called as "tgtrain photos", the first alone),
// and reads the command line. Nothing when the program is to go on, else its
// exit code: 0 after --help and those; with a line on stderr, 2 for a file of settings that cannot be read and 1 for
// what else is wrong, with the name that was meant where one is near.
std::optional<int> parseCommandLine(CLI::App& app, int argc, char** argv);

struct Example {
  const char* command;
  const char* meaning;
};
// The end of a help text and of a manual page. `more`: what else there is to say, a line or several.
void addExamples(CLI::App& app, std::initializer_list<Example> examples, const std::string& more = "");

// Refuses what is none of the names: `--show: expected final, base or alpha, found "alhpa" (did you mean alpha?)`.
CLI::Validator oneOf(std::vector<std::string> names);
template <Named E>
CLI::Validator oneOf() {
  constexpr auto names = namesOf(E{});
  return oneOf({names.begin(), names.end()});
}

// An option that takes a number of bytes, 1 at least: 900KB, 1.5MB, units of 1,000.
CLI::Option* addBytes(CLI::App& app, const std::string& name, std::uint64_t& bytes, const std::string& help);

// Runs a program's body and returns its exit code. What it throws becomes a line on stderr and the code of
// core/system/error.h: 5 where memory runs out, 3 for what is no Error. A body that succeeds but whose standard output
// could not be written (a full disk) ends in 4.
int runProgram(const char* name, const std::function<int()>& body);

}  // namespace tg
