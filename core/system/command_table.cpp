// SPDX-License-Identifier: Apache-2.0
// CLI11's options to rows, rows to help.
#include "core/system/command_table.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <utility>

#include "core/system/numbers.h"

namespace tg {
namespace {

constexpr const char* kLastGroup = "General";

std::vector<std::string> parts(const std::string& text, char separator) {
  std::vector<std::string> found;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) found.push_back(part);
  return found;
}

std::string joined(const std::vector<std::string>& words, const std::string& between, const std::string& last) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == words.size() ? last : between) + words[i];
  }
  return text;
}

// Between those outside brackets: "[ADDRESS:]PORT:{a,b}" has two.
std::vector<std::string> typeParts(const std::string& text) {
  std::vector<std::string> found(1);
  int depth = 0;
  for (const char c : text) {
    depth += (c == '[' || c == '{') - (c == ']' || c == '}');
    if (c == ':' && depth == 0) {
      found.emplace_back();
    } else {
      found.back() += c;
    }
  }
  return found;
}

// CLI11 has type and validators in one text: "INT:INT in [0 - 4096]", "TEXT:{auto,cpu}".
void takeType(const std::string& type, OptionRow& row) {
  const std::vector<std::string> said = typeParts(type);
  row.value = said[0].empty() ? "VALUE" : said[0];
  for (std::size_t i = 1; i < said.size(); ++i) {
    const std::string& part = said[i];
    if (part.starts_with("{") && part.ends_with("}")) {
      row.choices = parts(part.substr(1, part.size() - 2), ',');
    } else if (const std::size_t open = part.find(" in ["); open != part.npos && part.ends_with("]")) {
      row.range = part.substr(open + 5, part.size() - open - 6);
      if (const std::size_t to = row.range.find(" - ", 1); to != row.range.npos) row.range.replace(to, 3, " to ");
    }
  }
  if (!row.choices.empty() && row.value == "TEXT") row.value = "NAME";
  if (row.value == "INT" || row.value == "UINT") row.value = "N";
  if (row.value == "FLOAT") row.value = "X";
  if (row.value != "N" && row.value != "X") row.range.clear();  // of what the text stands for
}

OptionRow rowOf(const CLI::Option& option) {
  OptionRow row;
  row.argument = option.get_positional();
  if (row.argument) {
    row.names = {option.get_name(true, false)};
  } else {
    for (const std::string& name : option.get_snames()) row.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) row.names.push_back("--" + name);
  }
  if (option.get_expected_min() > 0) takeType(option.get_type_name(), row);  // else a flag
  row.fallback = option.get_default_str();
  if (row.value.empty() && row.fallback != "on") row.fallback.clear();
  row.help = option.get_description();
  row.group = option.get_group();
  row.required = option.get_required();
  row.many = option.get_expected_max() > 1 && row.argument;
  return row;
}

CommandTable tableUnder(const std::string& before, const CLI::App& app) {
  CommandTable table;
  table.word = app.get_name();
  table.name = before + table.word;
  table.description = app.get_description();
  table.footer = app.get_footer();
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_group().empty()) table.options.push_back(rowOf(*option));
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!command->get_group().empty()) table.commands.push_back(tableUnder(table.name + " ", *command));
  }
  return table;
}

// Lines of at most `width` characters, the first one after `first` that stand there already.
std::string wrapped(const std::string& text, int width, int indent, int first) {
  std::string out;
  int column = first;
  std::istringstream stream(text);
  bool start = true;
  for (std::string word; stream >> word; start = false) {
    const int length = static_cast<int>(word.size());
    if (!start && column + 1 + length > width) {
      out += "\n" + std::string(static_cast<std::size_t>(indent), ' ');
      column = indent;
      start = true;
    }
    out += (start ? "" : " ") + word;
    column += length + (start ? 0 : 1);
  }
  return out + "\n";
}

std::string entry(const std::string& title, const std::string& text, int width) {
  const int indent = std::min(30, width / 3);
  std::string out = "  " + title;
  const int used = static_cast<int>(out.size());
  out += used + 2 <= indent ? std::string(static_cast<std::size_t>(indent - used), ' ')
                            : "\n" + std::string(static_cast<std::size_t>(indent), ' ');
  return out + wrapped(text, width, indent, indent);
}

}  // namespace

CommandTable tableOf(const CLI::App& app) { return tableUnder("", app); }

std::string meaningOf(const OptionRow& option) {
  std::vector<std::string> facts;
  const bool listed = std::ranges::all_of(
      option.choices, [&](const std::string& choice) { return option.help.find(choice) != std::string::npos; });
  if (!option.choices.empty() && !listed) facts.push_back(joined(option.choices, ", ", " or "));
  if (!option.range.empty() && option.help.find(option.range) == std::string::npos) facts.push_back(option.range);
  if (!option.fallback.empty()) facts.push_back("default: " + option.fallback);
  if (option.required && !option.argument) facts.emplace_back("required");
  if (facts.empty()) return option.help;
  const std::string text = joined(facts, "; ", "; ") + ")";
  return option.help.ends_with(")") ? option.help.substr(0, option.help.size() - 1) + "; " + text
                                    : option.help + " (" + text;
}

std::string titleOf(const OptionRow& option) {
  std::string title = joined(option.names, ", ", ", ");
  if (option.argument) return title + (option.many ? "..." : "");
  if (option.names.front().starts_with("--")) title.insert(0, "    ");
  return title + (option.value.empty() ? "" : " " + option.value);
}

std::vector<std::string> groupsOf(const CommandTable& table) {
  std::vector<std::string> groups;
  for (const OptionRow& option : table.options) {
    const bool known = std::ranges::find(groups, option.group) != groups.end();
    if (!option.argument && !known && option.group != kLastGroup) groups.push_back(option.group);
  }
  groups.emplace_back(kLastGroup);
  return groups;
}

std::string usageOf(const CommandTable& table) {
  std::string usage = table.name + " [OPTIONS]";
  for (const OptionRow& option : table.options) {
    if (!option.argument) continue;
    const std::string title = titleOf(option);
    usage += option.required ? " " + title : " [" + title + "]";
  }
  return usage;
}

int terminalWidth() {
  int width = 80;
  winsize size{};
  const char* columns = std::getenv("COLUMNS");
  const auto said = columns ? parseWhole<int>(columns) : std::nullopt;
  if (said && *said > 0) {
    width = *said;
  } else if (isatty(STDOUT_FILENO) && ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) {
    width = size.ws_col;
  }
  return std::clamp(width, 40, 120);
}

std::string formatHelp(const CommandTable& table, int width) {
  std::string text = wrapped(table.description, width, 0, 0);
  text += "\nUsage: " + wrapped(usageOf(table), width, 9, 7);
  for (const CommandTable& command : table.commands) text += "       " + wrapped(usageOf(command), width, 9, 7);
  text += "\n";
  for (const OptionRow& option : table.options) {
    if (option.argument) text += entry(titleOf(option), meaningOf(option), width);
  }
  if (!table.commands.empty()) text += "\nCommands (each has --help):\n";
  for (const CommandTable& command : table.commands) text += entry(command.word, command.description, width);
  for (const std::string& group : groupsOf(table)) {
    text += "\n" + wrapped(group + ":", width, 0, 0);
    for (const OptionRow& option : table.options) {
      if (option.argument || option.group != group) continue;
      text += entry(titleOf(option), meaningOf(option), width);
    }
  }
  return table.footer.empty() ? text : text + "\n" + table.footer + "\n";
}

}  // namespace tg
