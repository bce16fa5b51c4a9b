// SPDX-License-Identifier: Apache-2.0
// The rules by which a setting counts for nothing.
#include "training/settings/idle.h"

#include <algorithm>
#include <string_view>

namespace tg {
namespace {

void addIdle(std::vector<std::string>& lines, const ChosenSetting& chosen, const std::string& why,
             const std::function<bool(const SettingEntry&)>& idle) {
  std::string flags;
  for (const SettingEntry& entry : settingEntries()) {
    if (chosen(entry) && idle(entry)) flags += (flags.empty() ? "--" : ", --") + entry.name;
  }
  if (!flags.empty()) lines.push_back(flags + ": does nothing with " + why);
}

// As its help says: "adc: what ...".
bool isOf(const SettingEntry& entry, Densification densification) {
  return entry.help.starts_with(std::string(name(densification)) + ": ");
}

bool isOfOneDensification(const SettingEntry& entry) {
  return std::ranges::any_of(valuesOf<Densification>(), [&](Densification each) { return isOf(entry, each); });
}

}  // namespace

std::vector<std::string> idleSettings(const TrainSettings& settings, const ChosenSetting& chosen, bool start_model,
                                      bool by_size) {
  const bool textured = settings.texture_mode != TextureMode::none && settings.texture_iterations > 0;
  std::vector<std::string> lines;
  const auto warn = [&](const std::string& why, const auto& idle) { addIdle(lines, chosen, why, idle); };
  const auto is_of_stage_2 = [](const SettingEntry& entry) {
    const std::string_view name = entry.name;
    const bool is_of_stage = name == "texture-mode" || name == "texture-iterations";
    return !is_of_stage && (name.starts_with("texture-") || name.find("texel") != name.npos);
  };
  const bool planned = by_size || start_model;  // what they have of textures
  if (!textured && !planned) {
    const bool none = settings.texture_mode == TextureMode::none;
    warn(none ? "--texture-mode none" : "--texture-iterations 0", is_of_stage_2);
  }
  if (start_model) {
    warn("--start-model",
         [](const SettingEntry& entry) { return entry.name == "start" || entry.name == "init-count"; });
    if (settings.texture_iterations == 0 && !by_size) {
      warn("--texture-iterations 0", [](const SettingEntry& entry) {
        return entry.name == "adaptive-texels" || entry.name == "texture-dictionary";
      });
    }
  }
  const auto is_pixels = [](const SettingEntry& entry) { return entry.name == "pixels-per-texel"; };
  if (textured && settings.texel_budget > 0) {
    warn("--texel-budget", [&](const SettingEntry& entry) { return entry.name == "texture-size" || is_pixels(entry); });
  } else if (textured && settings.texture_size > 0) {
    warn("--texture-size", is_pixels);
  }
  if (settings.percent == 0) {
    warn("a limit that is no share (--percent)",
         [](const SettingEntry& entry) { return entry.name == "default-gaussians"; });
  }
  if (traitsOf(settings.densification).heeds_limit_by && settings.percent == 0 && settings.gaussians == 0 && !by_size) {
    warn("no limit (--gaussians, --percent or --target-size)",
         [](const SettingEntry& entry) { return entry.name == "limit-by"; });
  }
  if (settings.densification == Densification::none) {
    warn("--densification none",
         [](const SettingEntry& entry) { return entry.name.starts_with("densify-") && !isOfOneDensification(entry); });
  }
  for (const Densification other : valuesOf<Densification>()) {
    if (other == settings.densification) continue;
    warn("--densification " + std::string(name(settings.densification)),
         [&](const SettingEntry& entry) { return isOf(entry, other); });
  }
  return lines;
}

std::vector<std::string> idlePastStage1(const TrainSettings& settings, const ChosenSetting& chosen) {
  std::vector<std::string> lines;
  addIdle(lines, chosen, "a start model that has textures", [&](const SettingEntry& entry) {
    return (entry.name == "iterations" && settings.iterations > 0) || entry.name.starts_with("densif");
  });
  return lines;
}

}  // namespace tg
