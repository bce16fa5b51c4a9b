// SPDX-License-Identifier: Apache-2.0
// A program's options as a table: what help, manual page and completions are written from.
#pragma once
#include <CLI/CLI.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tg {

struct OptionRow {
  std::vector<std::string> names;    // with their dashes, short ones first; an argument's own name
  std::string value;                 // what stands for the value; "": there is none
  std::vector<std::string> choices;  // all that the value can be; empty: more than can be listed
  std::string range;                 // "0 to 3"; "": any
  std::string fallback;              // without the option; "": nothing to say
  std::string help;
  std::string group;
  bool argument = false;  // by its place, not by its name
  bool required = false;
  bool many = false;

  bool takesFile() const { return value == "FILE" || value == "FOLDER" || value == "TEXT"; }
};

struct CommandTable {
  std::string name;         // with the program's: "tgtrain make-sample"
  std::string word;         // its last word
  std::string description;  // a sentence or two
  std::string footer;       // lines: examples and what follows them
  std::vector<OptionRow> options;
  std::vector<CommandTable> commands;
};

CommandTable tableOf(const CLI::App& app);

// The help with what the row knows beside it: "Where to train (auto, cpu or cuda; default: auto)".
std::string meaningOf(const OptionRow& option);
// "-o, --output FILE"
std::string titleOf(const OptionRow& option);
// The groups' names in their order, "General" last.
std::vector<std::string> groupsOf(const CommandTable& table);
// "tgtrain [OPTIONS] [dataset]", without the program's name where it is `bare`.
std::string usageOf(const CommandTable& table);

// Columns [characters] of the terminal: COLUMNS, else what it says itself, else 80; 40 to 120.
int terminalWidth();
std::string formatHelp(const CommandTable& table, int width);
// A page of section 1, in roff's man macros.
std::string formatManual(const CommandTable& table);
// Throws Error(usage) for a shell other than bash, zsh and fish.
std::string formatCompletion(const CommandTable& table, std::string_view shell);

}  // namespace tg
