// SPDX-License-Identifier: Apache-2.0
// What every program does alike: --version, wrong command lines, errors to exit codes.
#pragma once
#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "core/system/names.h"
#include "core/system/numbers.h"

namespace tg {

// Adds --version, --completion and --man (but to a command of a program, called as "tgtrain photos", the first alone),
// and reads the command line. Nothing when the program is to go on, else its
// exit code: 0 after --help and those; with a line on stderr, 2 for a file of settings that cannot be read and 1 for
// what else is wrong, with the name that was meant where one is near.
std::optional<int> parseCommandLine(CLI::App& app, int argc, char** argv);

// What CLI11 found wrong with flags that are no program's command line, in the words of one: of the App that threw it.
std::string wrongFlags(const CLI::App& app, const CLI::Error& error);

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

// Refuses what is no number from `low` to `high`, or, where these are integers, no integer: `--steps: expected a number
// from 0.125 to 64, found "abc"`. In CLI11's own words, CLI::Range, each of its versions differs.
template <typename T>
CLI::Validator within(T low, T high) {
  constexpr bool kWhole = std::is_integral_v<T>;
  const std::string from = numberText(low), to = numberText(high);
  const auto check = [low, high, from, to](const std::string& text) {
    T value{};
    // CLI11 takes 010 for 8 and 0x10 for 16, which other numbers here are not.
    if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high &&
        (!kWhole || parseWhole<T>(text.substr(text[0] == '+' ? 1 : 0)) == value)) {
      return std::string();
    }
    return std::string(kWhole ? "expected an integer" : "expected a number") + " from " + from + " to " + to +
           ", found \"" + text + "\"";
  };
  return {check, std::string(kWhole ? "INT" : "FLOAT") + " in [" + from + " - " + to + "]"};
}

// An option that takes a number of bytes, 1 at least: 900KB, 1.5MB, units of 1,000.
CLI::Option* addBytes(CLI::App& app, const std::string& name, std::uint64_t& bytes, const std::string& help);

// Runs a program's body and returns its exit code. What it throws becomes a line on stderr and the code of
// core/system/error.h: 5 where memory runs out, 3 for what is no Error. A body that succeeds but whose standard output
// could not be written (a full disk) ends in 4.
int runProgram(const char* name, const std::function<int()>& body);

}  // namespace tg
