// SPDX-License-Identifier: Apache-2.0
// Every setting survives text; presets and budgets say what they promise.
#include "training/settings/settings.h"

#include <algorithm>
#include <fstream>
#include <iostream>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "core/system/numbers.h"
#include "support/catch.h"
#include "training/every_setting.h"

TEST_CASE("every setting has its own name and survives its text", "[settings]") {
  std::set<std::string> names;
  for (const char* preset : {"default", "quick", "paper"}) {
    const tg::TrainSettings settings = tg::presetSettings(preset);
    tg::checkSettings(settings);
    tg::TrainSettings copy;
    for (const tg::SettingEntry& entry : tg::settingEntries()) {
      names.insert(entry.name);
      CHECK_FALSE(entry.help.empty());
      entry.set(copy, entry.get(settings));
    }
    CHECK(copy == settings);
  }
  CHECK(names.size() == tg::settingEntries().size());
  CHECK_THROWS_WITH(tg::presetSettings("best"), Contains("expected default, quick, paper, found 'best'"));
}

TEST_CASE("every setting is of its own and has a value that is not its default", "[settings]") {
  for (const tg::SettingEntry& entry : tg::settingEntries()) {
    INFO(entry.name);
    for (const auto& [usual, changed] : tg::test::runsOf(entry)) {
      const auto differs = [&](const tg::SettingEntry& each) { return each.get(usual) != each.get(changed); };
      CHECK(std::ranges::count_if(tg::settingEntries(), differs) == 1);
      CHECK(differs(entry));
    }
  }
  for (const auto& [name, off] : tg::test::kOffDefaults) {
    INFO(name);
    CHECK(std::ranges::count(tg::settingEntries(), name, &tg::SettingEntry::name) == 1);
  }
}

TEST_CASE("every enumerator of a setting is its default or a run of its own or refused", "[settings]") {
  for (const tg::SettingEntry& entry : tg::settingEntries()) {
    const auto [first, last] = tg::test::kOffDefaults.equal_range(entry.name);
    for (const std::string& choice : entry.choices) {
      INFO("add { \"" << entry.name << "\", {\"" << choice
                      << "\"} } to kOffDefaults in tests/training/every_setting.h");
      const bool is_run = std::any_of(first, last, [&](const auto& line) { return line.second.value == choice; });
      if (is_run || choice == entry.get({})) continue;
      tg::TrainSettings settings;
      settings.gaussians = 100;
      entry.set(settings, choice);
      CHECK_THROWS_AS(tg::checkSettings(settings), tg::Error);
    }
  }
}

TEST_CASE("the manual has every setting with its values in presets and its help", "[settings]") {
  std::ifstream file("docs/training.md");
  std::stringstream manual;
  manual << file.rdbuf();
  std::vector<std::string> rows = {"| setting |", "|---|---|---|---|---|"};  // as they are to stand there
  for (const std::string& preset : tg::presetNames()) {
    rows[0] += preset == "default" ? " default |" : " `" + preset + "` |";
  }
  rows[0] += " |";
  for (const tg::SettingEntry& entry : tg::settingEntries()) {
    const std::string usual = entry.get({});
    std::string row = "| `--" + entry.name + "` |";
    for (const std::string& preset : tg::presetNames()) {
      const std::string value = entry.get(tg::presetSettings(preset));
      row += preset == "default" || value != usual ? " " + value + " |" : " |";
    }
    rows.push_back(row + " " + entry.help + (entry.unit.empty() ? "" : " [" + entry.unit + "]") + " |");
  }
  std::string table, missing;
  for (const std::string& row : rows) {
    table += row + "\n";
    if (manual.str().find("\n" + row + "\n") == std::string::npos) missing += row + "\n";
  }
  // Not by INFO, which breaks lines.
  if (!missing.empty()) std::cerr << "docs/training.md has no such row (in the order of settings.cpp):\n" << missing;
  INFO("the rows of docs/training.md are those of training/settings/settings.cpp, in its order, and no others");
  const bool has = manual.str().find("\n\n" + table + "\n") != std::string::npos;
  CHECK(has);
}

TEST_CASE("numbers of presets are those that one would type", "[settings]") {
  for (const std::string& preset : tg::presetNames()) {
    for (const tg::SettingEntry& entry : tg::settingEntries()) {
      const std::string text = entry.get(tg::presetSettings(preset));
      const std::optional<double> value = tg::parseWhole<double>(text);
      if (!value) continue;  // a name
      INFO(preset << ": " << entry.name << " = " << text);
      CHECK(tg::parseWhole<double>(tg::formatted("%.4g", *value)) == value);
    }
  }
}

TEST_CASE("values out of range and nonsense are refused by name", "[settings]") {
  tg::TrainSettings settings;
  for (const tg::SettingEntry& entry : tg::settingEntries()) {
    CHECK_THROWS_WITH(entry.set(settings, "nonsense"), Contains("--" + entry.name + ": expected"));
    CHECK_THROWS_WITH(entry.set(settings, ""), Contains("--" + entry.name));
    CHECK_THROWS_WITH(entry.set(settings, "1e300"), Contains("--" + entry.name));
    CHECK_THROWS_WITH(entry.set(settings, "-2"), Contains("--" + entry.name));
    CHECK_THROWS_WITH(entry.set(settings, "nan"), Contains("--" + entry.name));
  }
  CHECK(settings == tg::TrainSettings{});
}

TEST_CASE("settings that contradict each other are refused", "[settings]") {
  tg::TrainSettings settings;
  settings.percent = 5;
  settings.gaussians = 100;
  CHECK_THROWS_WITH(tg::checkSettings(settings), Contains("--percent and --gaussians"));
  settings = {};
  settings.densification = tg::Densification::mcmc;
  CHECK_THROWS_WITH(tg::checkSettings(settings), Contains("needs a count to grow to"));
  settings.gaussians = 100;
  CHECK_NOTHROW(tg::checkSettings(settings));
}

TEST_CASE("the paper's texel budget", "[settings]") {
  const int expected[][2] = {{1, 40}, {2, 28}, {5, 18}, {10, 13}, {20, 9}, {50, 6}, {100, 4}};
  for (const auto& [percent, size] : expected) CHECK(tg::textureSizeForPercent(percent) == size);
}
TEST_CASE("tiny and huge shares lead to textures of a size that there is", "[settings]") {
  for (const double percent : {1e-300, 1e-17, 1e-6, 0.024}) {
    CHECK(tg::textureSizeForPercent(percent) == tg::kMostTextureSize);
  }
  CHECK(tg::textureSizeForPercent(1e9) == 1);
}

