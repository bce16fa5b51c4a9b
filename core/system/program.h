// SPDX-License-Identifier: Apache-2.0
// What every program does alike: --version, wrong command lines, errors to exit codes.
#pragma once
#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace tg {

// Adds --version and reads the command line. Nothing when the program is to go on, else its exit code: 0 after --help
// and --version; with a line on stderr, 2 for a file of settings that cannot be read and 1 for what else is wrong.
std::optional<int> parseCommandLine(CLI::App& app, int argc, char** argv);

// An option that takes a number of bytes, 1 at least: 900KB, 1.5MB, units of 1,000.
CLI::Option* addBytes(CLI::App& app, const std::string& name, std::uint64_t& bytes, const std::string& help);

// Runs a program's body and returns its exit code. What it throws becomes a line on stderr and the code of
// core/system/error.h: 5 where memory runs out, 3 for what is no Error. A body that succeeds but whose standard output
// could not be written (a full disk) ends in 4.
int runProgram(const char* name, const std::function<int()>& body);

}  // namespace tg
