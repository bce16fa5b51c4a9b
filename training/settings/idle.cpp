// SPDX-License-Identifier: Apache-2.0
// The rules by which a setting counts for nothing.
#include "training/settings/idle.h"

#include <algorithm>
#include <initializer_list>
#include <string_view>

#include "core/model/verbs.h"
#include "training/settings/schedule.h"

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

bool isOneOf(const SettingEntry& entry, std::initializer_list<std::string_view> names) {
  return std::ranges::find(names, entry.name) != names.end();
}

// What the schedule of a stage 1 that densifies leaves no use for; not what may be why it does.
void addIdleBySchedule(std::vector<std::string>& lines, const ChosenSetting& chosen, const TrainSettings& settings) {
  const Schedule schedule = makeSchedule(settings);
  const int last = schedule.lastRound(settings.iterations);
  if (last == 0) {
    addIdle(lines, chosen, "a schedule without a round of densification", [&](const SettingEntry& entry) {
      if (isOfOneDensification(entry) && !isOf(entry, settings.densification)) return false;
      return isOneOf(entry, {"densify-score", "densify-threshold", "prune-opacity", "mcmc-growth"}) ||
             (settings.prune_radius > 0 && entry.name == "prune-radius") ||
             (settings.wide_sigma > 0 && entry.name == "wide-sigma");
    });
  } else if (settings.prune_radius > 0 && !schedule.prunesLarge(last) &&
             traitsOf(settings.densification).resets_opacity) {
    addIdle(lines, chosen, "a schedule without a round after the first opacity reset",
            [](const SettingEntry& entry) { return entry.name == "prune-radius"; });
  }
}

// Of a start model that has textures, which is past stage 1 and keeps them.
void addIdlePastStage1(std::vector<std::string>& lines, const ChosenSetting& chosen, const TrainSettings& settings,
                       const GaussianModel& start, bool by_size) {
  if (settings.texture_iterations == 0 && !by_size) {
    addIdle(lines, chosen, "--texture-iterations 0", [&](const SettingEntry& entry) {
      // A stage 3 keeps what textures share.
      if (entry.name == "texture-dictionary") return settings.quantize_iterations == 0;
      return isOneOf(entry, {"adaptive-texels", "rate-position-texture", "texel-decay"});
    });
  }
  // Shared textures count in the plan of a size by their side.
  const bool plans_side = by_size && settings.texture_dictionary > 0;
  addIdle(lines, chosen, "a start model that has textures", [&](const SettingEntry& entry) {
    if (entry.name == "iterations") return settings.iterations > 0;
    if (entry.name == "intersection") return settings.intersection != start.intersection;
    if (entry.name == "texture-mode") return settings.texture_mode != start.texture_mode;
    if (entry.name == "texture-outside") return settings.texture_outside != start.outside;
    if (entry.name == "texture-size") return !plans_side;
    return entry.name.starts_with("densif") || entry.name.starts_with("mcmc-") ||
           isOneOf(entry,
                   {"gaussians", "percent", "default-gaussians", "limit-by", "prune-opacity", "prune-radius",
                    "wide-sigma", "reset-every", "sh-every", "pixels-per-texel", "texel-budget", "texture-sizes"});
  });
}

}  // namespace

std::vector<std::string> idleSettings(const TrainSettings& settings, const ChosenSetting& chosen,
                                      const GaussianModel* start, bool by_size) {
  const bool has_mode = settings.texture_mode != TextureMode::none;
  const bool textured = has_mode && settings.texture_iterations > 0;
  std::vector<std::string> lines;
  const auto warn = [&](const std::string& why, const auto& idle) { addIdle(lines, chosen, why, idle); };
  if (start) warn("--start-model", [](const SettingEntry& entry) { return isOneOf(entry, {"start", "init-count"}); });
  if (start && isTextured(*start)) {
    addIdlePastStage1(lines, chosen, settings, *start, by_size);
    return lines;
  }
  const auto is_of_stage_2 = [&](const SettingEntry& entry) {
    const std::string_view name = entry.name;
    // A plan for a size gives stage 1 the iterations that stage 2 does not have.
    if (name == "texture-iterations") return !has_mode && settings.texture_iterations > 0 && !by_size;
    return name != "texture-mode" &&
           (name.starts_with("texture-") || name.find("texel") != name.npos || name == "rate-position-texture");
  };
  const bool planned = has_mode && by_size;  // what it has of textures
  if (!textured && !planned) warn(has_mode ? "--texture-iterations 0" : "--texture-mode none", is_of_stage_2);
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
    warn("--densification none", [](const SettingEntry& entry) {
      return entry.name == "prune-opacity" || (entry.name.starts_with("densify-") && !isOfOneDensification(entry));
    });
  } else if (!by_size) {  // which may plan for more iterations
    addIdleBySchedule(lines, chosen, settings);
  }
  for (const Densification other : valuesOf<Densification>()) {
    if (other == settings.densification) continue;
    warn("--densification " + std::string(name(settings.densification)),
         [&](const SettingEntry& entry) { return isOf(entry, other); });
  }
  return lines;
}

}  // namespace tg
