// SPDX-License-Identifier: Apache-2.0
// Completions for bash, zsh and fish.
#include <algorithm>

#include "core/system/command_table.h"
#include "core/system/error.h"

namespace tg {
namespace {

std::string functionName(const std::string& name) {
  std::string text = "_" + name;
  std::ranges::replace_if(text, [](char c) { return c == ' ' || c == '-'; }, '_');
  return text;
}

std::string spaced(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = text.find(what); at != text.npos; at = text.find(what, at + by.size())) {
    text.replace(at, what.size(), by);
  }
  return text;
}

// The first sentence, on one line.
std::string brief(const std::string& help) {
  std::string text = help.substr(0, std::min(help.find(". "), help.find("; ")));
  if (text.ends_with(".")) text.pop_back();
  return text;
}

// --- bash

std::string bashCases(const CommandTable& table) {
  std::string out;
  for (const OptionRow& option : table.options) {
    if (option.argument || option.value.empty()) continue;
    std::string names;
    for (const std::string& name : option.names) names += (names.empty() ? "" : "|") + name;
    if (!option.choices.empty()) {
      out +=
          "        " + names + ") COMPREPLY=($(compgen -W '" + spaced(option.choices) + "' -- \"$cur\")); return ;;\n";
    } else if (option.takesFile()) {
      out += "        " + names + ") return ;;\n";  // files: complete -o default
    } else {
      out += "        " + names + ") compopt +o default; return ;;\n";
    }
  }
  return out;
}

std::string bashOptions(const CommandTable& table) {
  std::string out;
  for (const OptionRow& option : table.options) {
    if (!option.argument) out += (out.empty() ? "" : " ") + spaced(option.names);
  }
  return out;
}

std::string bash(const CommandTable& table) {
  const std::string function = functionName(table.word);
  std::string out = "# bash completion of " + table.word + ", written by " + table.word + " --completion bash\n";
  out += function +
         "() {\n"
         "  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD-1]} command=\n"
         "  COMPREPLY=()\n"
         "  # bash takes --name=value apart\n"
         "  if [[ $cur == = ]]; then cur=\n"
         "  elif [[ $prev == = ]]; then prev=${COMP_WORDS[COMP_CWORD-2]}; fi\n";
  std::vector<std::string> words;
  for (const CommandTable& command : table.commands) words.push_back(command.word);
  if (!words.empty()) {
    out += "  if (( COMP_CWORD > 1 )); then\n    case ${COMP_WORDS[1]} in\n      ";
    out += replaced(spaced(words), " ", "|") + ") command=${COMP_WORDS[1]} ;;\n    esac\n  fi\n";
  }
  out += "  case $command in\n";
  for (const CommandTable& command : table.commands) {
    out += "    " + command.word + ")\n      case $prev in\n" + bashCases(command) + "      esac\n";
    out += "      [[ $cur == -* ]] && COMPREPLY=($(compgen -W '" + bashOptions(command) + "' -- \"$cur\"))\n      ;;\n";
  }
  out += "    *)\n      case $prev in\n" + bashCases(table) + "      esac\n";
  out += "      if [[ $cur == -* ]]; then COMPREPLY=($(compgen -W '" + bashOptions(table) + "' -- \"$cur\"))\n";
  if (!words.empty()) {
    // A command while it may become one, a file else; both where nothing is typed yet.
    out += "      elif (( COMP_CWORD == 1 )); then COMPREPLY=($(compgen -W '" + spaced(words) + "' -- \"$cur\"))\n";
    out += "        [[ $cur ]] || COMPREPLY+=($(compgen -f))\n";
  }
  out += "      fi\n      ;;\n  esac\n}\ncomplete -o bashdefault -o default -F " + function + " " + table.word + "\n";
  return out;
}

// --- zsh

std::string zshText(std::string text) {
  for (const char* special : {"\\", "[", "]", ":"}) text = replaced(text, special, std::string("\\") + special);
  return replaced(text, "'", "'\\''");
}

std::string zshAction(const OptionRow& option) {
  if (!option.choices.empty()) return "(" + spaced(option.choices) + ")";
  if (option.value == "FOLDER") return "_files -/";
  return option.takesFile() ? "_files" : " ";
}

std::string zshSpecs(const CommandTable& table, const std::string& indent) {
  std::string out;
  for (const OptionRow& option : table.options) {
    if (option.argument) continue;
    for (const std::string& name : option.names) {
      const bool long_name = name.starts_with("--");
      out += indent + "'*" + name +
             (option.value.empty() ? ""
              : long_name          ? "="
                                   : "+") +
             "[" + zshText(brief(option.help)) + "]";
      if (!option.value.empty()) out += ":" + zshText(option.value) + ":" + zshAction(option);
      out += "' \\\n";
    }
  }
  return out;
}

std::string zsh(const CommandTable& table) {
  const std::string function = functionName(table.word);
  std::string out = "#compdef " + table.word + "\n# zsh completion, written by " + table.word + " --completion zsh\n\n";
  out += function + "() {\n";
  if (!table.commands.empty()) {
    out += "  if (( CURRENT > 2 )); then\n    case ${words[2]} in\n";
    for (const CommandTable& command : table.commands) {
      out += "      " + command.word + ")\n        shift words\n        (( CURRENT-- ))\n        _arguments \\\n";
      out += zshSpecs(command, "          ") + "          '*:file:_files'\n        return ;;\n";
    }
    out += "    esac\n  fi\n";
  }
  out += "  _arguments \\\n" + zshSpecs(table, "    ");
  if (!table.commands.empty()) {
    out += "    '1:command or file:{_alternative \"commands:command:((";
    for (const CommandTable& command : table.commands) {
      const std::string meaning = replaced(replaced(brief(command.description), "\"", ""), "'", "");
      out += command.word + "\\:" + replaced(replaced(replaced(meaning, "(", "\\("), ")", "\\)"), " ", "\\ ") + " ";
    }
    out += "))\" \"files:file:_files\"}' \\\n";
  }
  // Found in $fpath its first call runs it whole, as the function; sourced it only makes it known.
  return out + "    '*:file:_files'\n}\n\nif [[ $funcstack[1] == " + function + " ]]; then\n  " + function +
         " \"$@\"\nelse\n  compdef " + function + " " + table.word + "\nfi\n";
}

// --- fish

std::string fishOptions(const CommandTable& table, const std::string& program, const std::string& condition) {
  std::string out;
  for (const OptionRow& option : table.options) {
    if (option.argument) continue;
    out += "complete -c " + program + condition;
    for (const std::string& name : option.names) {
      out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
    }
    if (!option.choices.empty()) {
      out += " -x -a '" + spaced(option.choices) + "'";
    } else if (!option.value.empty()) {
      out += option.takesFile() ? " -r -F" : " -x";
    }
    out += " -d '" + replaced(replaced(brief(option.help), "\\", "\\\\"), "'", "\\'") + "'\n";
  }
  return out;
}

std::string fish(const CommandTable& table) {
  std::string out = "# fish completion of " + table.word + ", written by " + table.word + " --completion fish\n";
  std::vector<std::string> words;
  for (const CommandTable& command : table.commands) words.push_back(command.word);
  const std::string seen = "__fish_seen_subcommand_from ";
  for (const CommandTable& command : table.commands) {
    out += "complete -c " + table.word + " -n '__fish_is_first_arg' -a " + command.word + " -d '" +
           replaced(brief(command.description), "'", "\\'") + "'\n";
    out += fishOptions(command, table.word, " -n '" + seen + command.word + "'");
  }
  return out + fishOptions(table, table.word, words.empty() ? "" : " -n 'not " + seen + spaced(words) + "'");
}

}  // namespace

std::string formatCompletion(const CommandTable& table, std::string_view shell) {
  if (shell == "bash") return bash(table);
  if (shell == "zsh") return zsh(table);
  if (shell == "fish") return fish(table);
  throw Error(ErrorKind::usage, "--completion: expected bash, zsh or fish, found \"" + std::string(shell) + "\"");
}

}  // namespace tg
