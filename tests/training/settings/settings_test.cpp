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

#include "core/model/atlas.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "training/every_setting.h"
#include "training/settings/idle.h"

namespace {

using Lines = std::vector<std::string>;

// "--gaussians 5 --filter-3d on", and which of the settings that names.
struct Flags {
  explicit Flags(const std::string& text) {
    std::istringstream words(text);
    for (std::string flag, value; words >> flag >> value;) {
      const auto entry = std::ranges::find(tg::settingEntries(), flag.substr(2), &tg::SettingEntry::name);
      REQUIRE(entry != tg::settingEntries().end());
      entry->set(settings, value);
      named.insert(entry->name);
    }
  }
  tg::ChosenSetting chosen() const {
    return [this](const tg::SettingEntry& entry) { return named.contains(entry.name); };
  }

  tg::TrainSettings settings;
  std::set<std::string> named;
};

Lines idle(const std::string& text, bool by_size = false, const tg::GaussianModel* start = nullptr) {
  const Flags flags(text);
  return tg::idleSettings(flags.settings, flags.chosen(), start, by_size);
}

// Past stage 1: rgb, maxResponse, base.
tg::GaussianModel texturedStart() {
  tg::GaussianModel start = tg::test::makeScene(tg::test::SceneKind::ordinary, 3, 5).model;
  start.texture_mode = tg::TextureMode::rgb;
  start.atlas = tg::makeUniformAtlas(start.size(), 2, 2);
  return start;
}

}  // namespace

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

TEST_CASE("tiny and huge shares lead to textures of a size that there is", "[settings]") {
  for (const double percent : {1e-300, 1e-17, 1e-6, 0.024}) {
    CHECK(tg::textureSizeForPercent(percent) == tg::kMostTextureSize);
  }
  CHECK(tg::textureSizeForPercent(1e9) == 1);
}

TEST_CASE("the paper's texel budget", "[settings]") {
  const int expected[][2] = {{1, 40}, {2, 28}, {5, 18}, {10, 13}, {20, 9}, {50, 6}, {100, 4}};
  for (const auto& [percent, size] : expected) CHECK(tg::textureSizeForPercent(percent) == size);
}

TEST_CASE("settings of stage 2 count for nothing where no textures are trained", "[settings]") {
  CHECK(idle("--texture-mode none --texture-iterations 9 --texture-size 4 --rate-position-texture 1e-4") ==
        Lines{"--texture-iterations, --texture-size, --rate-position-texture: does nothing with --texture-mode none"});
  CHECK(idle("--texture-mode none --texture-iterations 0").empty());
  // A plan adds them to stage 1.
  CHECK(idle("--texture-mode none --texture-iterations 9", true).empty());
  CHECK(idle("--texture-iterations 9 --rate-position-texture 1e-4").empty());
  // A plain start model is as points.
  const tg::GaussianModel plain;
  CHECK(idle("--texture-mode none --texture-size 4", false, &plain) ==
        Lines{"--texture-size: does nothing with --texture-mode none"});
  CHECK(idle("--texture-iterations 0 --texture-size 4 --adaptive-texels 2 --start random", false, &plain) ==
        Lines{"--start: does nothing with --start-model",
              "--texture-size, --adaptive-texels: does nothing with --texture-iterations 0"});
  CHECK(idle("--texture-iterations 0 --texture-dictionary 4 --quantize-iterations 9", false, &plain) ==
        Lines{"--texture-dictionary: does nothing with --texture-iterations 0"});
}

TEST_CASE("settings of stage 2 count for nothing where a start model that has textures skips it", "[settings]") {
  const tg::GaussianModel start = texturedStart();
  const std::string why = ": does nothing with --texture-iterations 0";
  CHECK(idle("--texture-iterations 0 --rate-position-texture 1e-4 --rate-texels 1e-3 --texel-decay 1", false, &start) ==
        Lines{"--rate-position-texture, --texel-decay" + why});
  CHECK(idle("--texture-iterations 0 --texture-dictionary 4", false, &start) == Lines{"--texture-dictionary" + why});
  // Stage 3 keeps what is shared.
  CHECK(idle("--texture-iterations 0 --quantize-iterations 9 --texture-dictionary 4", false, &start).empty());
}

TEST_CASE("settings that the schedule of stage 1 has no use for are told", "[settings]") {
  const std::string no_round = ": does nothing with a schedule without a round of densification";
  const std::string no_late =
      "--prune-radius: does nothing with a schedule without a round after the first opacity reset";
  CHECK(idle("--densification none --prune-opacity 0.1") ==
        Lines{"--prune-opacity: does nothing with --densification none"});
  CHECK(idle("--iterations 300 --densify-from 250 --prune-radius 20 --wide-sigma 0.1") ==
        Lines{"--prune-radius, --wide-sigma" + no_round});
  CHECK(idle("--iterations 100 --gaussians 50 --densification mcmc --mcmc-growth 0.1") ==
        Lines{"--mcmc-growth" + no_round});
  CHECK(idle("--iterations 100 --densify-threshold 0.1 --limit-by swap --gaussians 50") ==
        Lines{"--densify-threshold" + no_round});
  CHECK(idle("--iterations 100 --densify-threshold 0.1 --gaussians 50", true).empty());

  CHECK(idle("--iterations 4000 --prune-radius 20") == Lines{no_late});
  CHECK(idle("--iterations 4000 --prune-radius 0").empty());
  CHECK(idle("--iterations 4000 --prune-radius 20 --reset-every 1500").empty());
  CHECK(idle("--iterations 4000 --prune-radius 20 --reset-every 1900") == Lines{no_late});
  CHECK(idle("--iterations 8000 --prune-radius 20").empty());
  CHECK(idle("--iterations 4000 --densify-every 10").empty());
}

TEST_CASE("settings by which a schedule has no round and no opacity reset are not told as idle", "[settings]") {
  CHECK(idle("--iterations 4000 --densify-from 1950").empty());
  CHECK(idle("--iterations 2000 --densify-every 1200").empty());
  CHECK(idle("--iterations 7000 --densify-from 0 --reset-every 10000").empty());
  // What is large is pruned from then on, without a reset and a --prune-radius, too.
  CHECK(idle("--iterations 4000 --densify-from 0 --densify-until 4000 --reset-every 3000").empty());
}

TEST_CASE("a start model that has textures has no use for what stage 1 and new textures are made by", "[settings]") {
  tg::GaussianModel start = texturedStart();
  const auto past = [&](const std::string& text, bool by_size = false) { return idle(text, by_size, &start); };
  const std::string why = ": does nothing with a start model that has textures";
  CHECK(past("--iterations 9 --percent 5 --default-gaussians 9 --limit-by swap --prune-opacity 0.1 --prune-radius 9 "
             "--wide-sigma 1 --reset-every 9 --sh-every 9 --mcmc-noise 1 --densify-every 9") ==
        Lines{"--iterations, --percent, --default-gaussians, --limit-by, --prune-opacity, --prune-radius, "
              "--wide-sigma, --densify-every, --reset-every, --sh-every, --mcmc-noise" +
              why});
  CHECK(past("--gaussians 9 --texture-size 4 --pixels-per-texel 1 --texel-budget 9 --texture-sizes footprint", true) ==
        Lines{"--gaussians, --texture-size, --pixels-per-texel, --texel-budget, --texture-sizes" + why});
  CHECK(past("--texture-mode rgba --intersection plane --texture-outside clip") ==
        Lines{"--intersection, --texture-mode, --texture-outside" + why});
  start.intersection = tg::IntersectionModel::plane;
  start.outside = tg::TextureOutside::clip;
  CHECK(past("--texture-mode rgb --intersection plane --texture-outside clip").empty());
  CHECK(past("--texture-dictionary 4 --texture-size 4", true).empty());
  // One line, also where there would be another reason without the model.
  CHECK(past("--iterations 100 --prune-opacity 0.1 --default-gaussians 9 --limit-by swap --mcmc-noise 1") ==
        Lines{"--iterations, --default-gaussians, --limit-by, --prune-opacity, --mcmc-noise" + why});
  CHECK(past("--texture-size 4 --pixels-per-texel 1 --texel-budget 9") ==
        Lines{"--texture-size, --pixels-per-texel, --texel-budget" + why});
  CHECK(
      past("--iterations 0 --texture-iterations 9 --adaptive-texels 2 --texture-intersection plane --rate-texels 1e-3 "
           "--filter-3d on --sh-degree 1 --seed 3 --ssim-weight 0.1 --extent-distances 1 --rate-position-texture 0 "
           "--texture-gradient-suffix off --quantize-iterations 9")
          .empty());
}
