// SPDX-License-Identifier: Apache-2.0
// Manual pages, in the man macros that every roff knows.
#include <sstream>

#include "core/system/command_table.h"

namespace tg {
namespace {

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
  }
  // A dot or a quote would begin a request.
  if (out.starts_with(".") || out.starts_with("'")) out.insert(0, "\\&");
  return out;
}

// A sentence a line.
std::string paragraph(const std::string& text) {
  std::string out, line;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    line += (line.empty() ? "" : " ") + word;
    if (word.ends_with(".")) out += escaped(std::exchange(line, {})) + "\n";
  }
  return line.empty() ? out : out + escaped(line) + "\n";
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
  return text;
}

std::string entries(const CommandTable& table, const std::string& group, bool arguments) {
  std::string out;
  for (const OptionRow& option : table.options) {
    if (option.argument != arguments || (!arguments && option.group != group)) continue;
    std::string title;
    for (const std::string& name : option.names) {
      title += (title.empty() ? "\\fB" : ", \\fB") + escaped(name) + (arguments && option.many ? "...\\fR" : "\\fR");
    }
    if (!arguments && !option.value.empty()) title += " \\fI" + escaped(option.value) + "\\fR";
    out += ".TP\n" + title + "\n" + paragraph(meaningOf(option));
  }
  return out;
}

std::string options(const CommandTable& table) {
  std::string out = entries(table, "", true);
  for (const std::string& group : groupsOf(table)) {
    out += ".SS \"" + escaped(group) + "\"\n" + entries(table, group, false);
  }
  return out;
}

std::string footer(const std::string& title, const CommandTable& table) {
  if (table.footer.empty()) return "";
  std::string out = ".SH \"" + escaped(title) + "\"\n.nf\n";
  std::istringstream lines(table.footer);
  for (std::string line; std::getline(lines, line);) {
    if (line == "Examples:") continue;
    out += line.empty() ? ".sp\n" : escaped(line) + "\n";
  }
  return out + ".fi\n";
}

}  // namespace

std::string formatManual(const CommandTable& table) {
  std::string out = ".TH " + upper(table.word) +
                    " 1 \"" TG_RELEASE_DATE "\" \"Textured Gaussians " TG_VERSION "\" \"User Commands\"\n";
  std::string subject = table.description.substr(0, table.description.find('.'));
  if (!subject.empty() && subject[0] >= 'A' && subject[0] <= 'Z')
    subject[0] = static_cast<char>(subject[0] - 'A' + 'a');
  out += ".SH NAME\n" + escaped(table.word) + " \\- " + escaped(subject) + "\n.SH SYNOPSIS\n.nf\n";
  out += escaped(usageOf(table)) + "\n";
  for (const CommandTable& command : table.commands) out += escaped(usageOf(command)) + "\n";
  out += ".fi\n.SH DESCRIPTION\n" + paragraph(table.description) + ".SH OPTIONS\n" + options(table);
  for (const CommandTable& command : table.commands) {
    out += ".SH \"" + escaped(upper(command.name)) + "\"\n" + paragraph(command.description) + options(command);
  }
  out += footer("EXAMPLES", table);
  for (const CommandTable& command : table.commands) out += footer("EXAMPLES OF " + upper(command.word), command);
  out += ".SH EXIT STATUS\n";
  for (const auto& [code, meaning] : {std::pair("0", "Success."),
                                      {"1", "Wrong command line."},
                                      {"2", "Cannot read."},
                                      {"3", "The data is wrong."},
                                      {"4", "Cannot write."},
                                      {"5", "Device, or memory ran out."},
                                      {"128 + N", "Ended or cut short by signal N."}}) {
    out += ".TP\n\\fB" + escaped(code) + "\\fR\n" + escaped(meaning) + "\n";
  }
  return out;
}

}  // namespace tg
