// SPDX-License-Identifier: Apache-2.0
// docs/viewer.md against the tables of the program: no setting and no key without its line.
#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>

#include "core/system/error.h"
#include "render/settings.h"
#include "support/catch.h"
#include "viewer/view/actions.h"

using namespace tg;

namespace {

std::string manual() {
  std::ifstream file("docs/viewer.md");
  std::stringstream text;
  text << file.rdbuf();
  REQUIRE(file);
  return text.str();
}

// From that heading to the next one.
std::string section(const std::string& text, const std::string& heading) {
  const std::size_t begin = text.find("\n## " + heading + "\n");
  INFO("## " + heading);
  REQUIRE(begin != std::string::npos);
  return text.substr(begin, text.find("\n## ", begin + 1) - begin);
}

// The row of a table whose first cell names it.
std::string rowOf(const std::string& table, const std::string& name) {
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("| ") && line.substr(0, line.find(" | ")).find("`" + name + "`") != std::string::npos) {
      return line;
    }
  }
  return "";
}

}  // namespace

TEST_CASE("the manual has every render setting, with its names or limits, as a flag and as a script command") {
  const std::string flags = section(manual(), "Flags"), scripts = section(manual(), "Scripts");
  for (const RenderSetting& setting : renderSettings()) {
    const std::string name(setting.name), row = rowOf(flags, "--" + name);
    INFO("docs/viewer.md: a row of --" << name << " with its values under Flags, and " << name << " under Scripts");
    REQUIRE(row != "");
    for (const RenderSetting::Choice& choice : setting.choices) {
      CHECK_THAT(row, Contains("`" + std::string(choice.name) + "`"));
    }
    if (setting.number || setting.whole) {
      std::string expected;  // "a number from 0 to 10"
      try {
        RenderSettings settings;
        setting.set(settings, "nonsense", "");
      } catch (const Error& error) {
        expected = error.what();
      }
      const std::size_t from = expected.find(" from ") + 6;
      CHECK_THAT(row, Contains(expected.substr(from, expected.find(", found") - from)));
    }
    const bool in_scripts =
        scripts.find("`" + name + "`") != std::string::npos || scripts.find("`" + name + " ") != std::string::npos;
    CHECK(in_scripts);
  }
}

TEST_CASE("the manual says of every output what it shows") {
  const std::string flags = section(manual(), "Flags"), outputs = section(manual(), "Outputs");
  for (const Output output : valuesOf<Output>()) {
    INFO("docs/viewer.md: " << name(output) << " in the row of --show under Flags, and a row of it under Outputs");
    CHECK_THAT(rowOf(flags, "--show OUTPUT"), Contains("`" + std::string(name(output)) + "`"));
    CHECK_THAT(outputs, Contains(" | " + std::string(name(output)) + " | "));
  }
}

TEST_CASE("the manual lists the keys as the help does") {
  const std::string keys = section(manual(), "Keys and mouse"), outputs = section(manual(), "Outputs");
  for (const KeyBinding& binding : keyBindings()) {
    INFO("docs/viewer.md: a row for each key of kBindings (viewer/view/actions.cpp), under Keys and mouse or Outputs");
    const std::string row = "\n| " + std::string(binding.keys) + " | ";
    if (*binding.keys && outputs.find(row) == std::string::npos) {
      CHECK_THAT(keys, Contains(row + binding.text + " |\n"));
    }
  }
}

TEST_CASE("a key that steps through a setting names one that has choices") {
  for (const KeyBinding& binding : keyBindings()) {
    INFO(binding.keys);
    CHECK((binding.run == nullptr) == !binding.setting.empty());
    if (!binding.setting.empty()) CHECK(renderSetting(binding.setting).choices.size() > 1);
  }
}
