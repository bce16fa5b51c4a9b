// SPDX-License-Identifier: Apache-2.0
// Size first: how long a stage for the file takes follows from the stages before it.
#include "training/plan.h"

#include <algorithm>
#include <initializer_list>
#include <string_view>

#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "training/run/size_plan.h"
#include "training/settings/schedule.h"
#include "training/write_scene.h"

namespace tg {
namespace {

// Whether a flag says it, or a file of settings, which names them all, other than the preset.
template <typename Named>
bool given(const TrainFlags& options, const TrainSettings& settings, const Named& named) {
  const TrainSettings preset = presetSettings(options.preset);
  return std::ranges::any_of(options.chosen, [&](const auto& setting) {
    const SettingEntry& entry = *setting.first;
    const bool by_flag = options.settings_file.empty() || options.by_flag.contains(&entry);
    const bool chosen = !setting.second.empty() && (by_flag || entry.get(settings) != entry.get(preset));
    return chosen && named(std::string_view(entry.name));
  });
}

bool givenOneOf(const TrainFlags& options, const TrainSettings& settings,
                std::initializer_list<std::string_view> names) {
  return given(options, settings, [&](std::string_view name) { return std::ranges::find(names, name) != names.end(); });
}

// A plain start model is drawn as it was trained, unless a flag names another intersection.
void followStart(const TrainFlags& options, const GaussianModel* start, TrainSettings& settings) {
  if (!start || isTextured(*start)) return;
  if (!givenOneOf(options, settings, {"intersection"})) settings.intersection = start->intersection;
}

// A file of the size that is asked for, by what is best at equal bytes (docs/frontier.md, docs/lab/quality.md): SH
// degree 1, and no textures where neither a flag nor the start model speaks of them; where one does, textures that
// Gaussians share, if these can be trained. A start model keeps its SH degree, one with textures its Gaussians and
// their texels.
class PlanOfSize {
 public:
  PlanOfSize(const TrainFlags& options, const GaussianModel* start, TrainSettings& settings);

  void chooseDegree();
  void chooseTextures(bool shares);
  void chooseCounts(std::uint64_t training_pixels);
  std::string said() const;

 private:
  std::string beyondRoom() const;
  bool isGiven(std::initializer_list<std::string_view> names) const { return givenOneOf(options_, settings_, names); }
  bool shared() const { return settings_.texture_mode != TextureMode::none && settings_.texture_dictionary > 0; }

  const TrainFlags& options_;
  const GaussianModel* const start_;
  TrainSettings& settings_;
  const bool textured_start_;
  const double part_;  // times as many bytes as a .sog
  // Of flags and the start model, before anything is chosen.
  bool asks_for_textures_, counted_, sized_, dealt_out_, timed_;
  bool too_small_ = false;  // for textures: more Gaussians show more
  bool cut_ = false;        // textures, to `plan_.texels`
  std::uint64_t training_pixels_ = 0;
  SizePlan plan_;
};

PlanOfSize::PlanOfSize(const TrainFlags& options, const GaussianModel* start, TrainSettings& settings)
    : options_(options),
      start_(start),
      settings_(settings),
      textured_start_(start && isTextured(*start)),
      part_(partOfSog(options.output)) {
  const bool speaks_of_textures = settings.compare_untextured || given(options, settings, [](std::string_view name) {
                                    return name.find("texture") != name.npos || name.find("texel") != name.npos;
                                  });
  asks_for_textures_ =
      speaks_of_textures && settings.texture_mode != TextureMode::none && settings.texture_iterations > 0;
  counted_ = isGiven({"gaussians", "percent"});
  sized_ = isGiven({"texture-size"}) && settings.texture_size > 0;
  dealt_out_ = isGiven({"adaptive-texels", "texel-budget"});
  timed_ = isGiven({"iterations", "densify-until"});
}

void PlanOfSize::chooseDegree() {
  if (!isGiven({"sh-degree"})) settings_.sh_degree = start_ ? start_->sh_degree : kPlannedShDegree;
}

void PlanOfSize::chooseTextures(bool shares) {
  bool plain =
      !asks_for_textures_ && !textured_start_ && (settings_.iterations > 0 || settings_.texture_iterations == 0);
  const bool own = textured_start_ || dealt_out_ || isGiven({"texture-dictionary", "texture-sizes"});
  if (!plain && settings_.texture_mode != TextureMode::none && shares && !own) {
    const int side = sized_ ? settings_.texture_size : kPlannedTextureSize;
    settings_.texture_dictionary = planSharedTextures(options_.target_bytes, part_, side);
    too_small_ =
        settings_.texture_dictionary == 0 && settings_.iterations > 0 && !settings_.compare_untextured && !sized_;
    plain = too_small_;
  }
  if (!plain) return;
  settings_.texture_mode = TextureMode::none;
  if (!timed_ || too_small_) {
    settings_.densify_until = makeSchedule(settings_).densify_until;  // what is longer is for what stands
    settings_.iterations += settings_.texture_iterations;
  }
}

void PlanOfSize::chooseCounts(std::uint64_t training_pixels) {
  training_pixels_ = training_pixels;
  cut_ = settings_.texture_mode != TextureMode::none && !textured_start_ && !dealt_out_ && !shared();
  if ((cut_ || (shared() && !textured_start_)) && !sized_) settings_.texture_size = kPlannedTextureSize;
  plan_ = shared()
              ? planForDictionary(options_.target_bytes, part_, settings_.sh_degree, settings_.texture_dictionary,
                                  std::max(settings_.texture_size, 1))
              : planForSize(options_.target_bytes, part_, training_pixels, settings_.sh_degree, settings_.texture_mode);
  if (!textured_start_ && !counted_) settings_.gaussians = plan_.gaussians;
  if (cut_) settings_.adaptive_texels = static_cast<float>(plan_.texels);
  checkSettings(settings_);
}

// "" where a limit that was named is within the room.
std::string PlanOfSize::beyondRoom() const {
  const bool grows = settings_.iterations > 0 && settings_.densification != Densification::none;
  const std::size_t all = settings_.default_gaussians, room = plan_.gaussians;
  const double percent = settings_.percent;
  std::string limit;
  if (percent > 0 && all == 0 && grows) limit = formatted("%g %% of the Gaussians that stage 1 reaches", percent);
  if (percent == 0 && settings_.gaussians == 0 && grows) limit = "no limit of Gaussians";
  if (!limit.empty()) return ", " + limit + formatted(", of which it has room for %zu", room);
  if (percent > 0 && percent / 100 * static_cast<double>(all) > static_cast<double>(room)) {
    limit = formatted("%g %% of %zu", percent, all);
  }
  if (percent == 0 && settings_.gaussians > room) limit = std::to_string(settings_.gaussians);
  if (limit.empty()) return "";
  return ", " + limit +
         formatted(" Gaussians, whose numbers will be coarser than those of the %zu it has room for", room);
}

std::string PlanOfSize::said() const {
  const std::size_t gaussians = settings_.gaussians;
  std::string said =
      formatted("planned for %ju bytes: SH degree %d", std::uintmax_t{options_.target_bytes}, settings_.sh_degree);
  if (!textured_start_ && !counted_) {
    said += formatted(", %zu Gaussians", gaussians);
    const bool merges = settings_.iterations > 0 && makeSchedule(settings_).merge_after > 0;
    const std::size_t grown = grownLimit(gaussians, training_pixels_);
    if (merges && grown > gaussians) said += formatted(" (up to %zu until pairs are merged)", grown);
  } else if (!textured_start_) {
    said += beyondRoom();
  }
  if (cut_) said += formatted(", %.1f texels each", plan_.texels);
  if (shared()) said += formatted(", %d textures that they share", settings_.texture_dictionary);
  if ((cut_ || shared()) && part_ > 1) {  // docs/lab/quality.md, "Textures that Gaussians share"
    said += "; in a .glb as many bytes of Gaussians without textures show more";
  }
  if (too_small_) {
    said += formatted(
        ", no textures, for which so small a file has no room (--adaptive-texels N asks for them): %d iterations",
        settings_.iterations);
  }
  return said;
}

// For a file of coarser numbers, where nobody said how long: as long as it pays (docs/lab/quality.md).
constexpr int kQuantizedShare = 10;  // of the iterations of the other stages
void planQuantizing(const TrainFlags& options, const GaussianModel* start, TrainSettings& settings) {
  const bool coarse = options.target_bytes > 0 || options.steps > 0;
  if (settings.quantize_iterations > 0 && !coarse) {
    throw Error(ErrorKind::usage,
                "--quantize-iterations is for a file of coarser numbers (expected --target-size or --steps)");
  }
  if (options.steps > 0 && start && !givenOneOf(options, settings, {"sh-degree"})) {
    settings.sh_degree = start->sh_degree;
  }
  if (!coarse || settings.compare_untextured || givenOneOf(options, settings, {"quantize-iterations"})) return;
  const bool textured = settings.texture_mode != TextureMode::none;
  const int plain = start && isTextured(*start) ? 0 : settings.iterations;
  const int others = plain + (textured ? settings.texture_iterations : 0);
  if (others > 0) settings.quantize_iterations = std::max(others / kQuantizedShare, kLeastQuantizeIterations);
}

}  // namespace

std::string planRecipe(const TrainFlags& options, std::uint64_t training_pixels, const GaussianModel* start,
                       bool shares, TrainSettings& settings) {
  std::string said;
  followStart(options, start, settings);
  if (options.target_bytes > 0) {
    PlanOfSize size(options, start, settings);
    size.chooseDegree();
    size.chooseTextures(shares);
    size.chooseCounts(training_pixels);
    said = size.said();
  }
  planQuantizing(options, start, settings);
  return said;
}

bool plansCount(const TrainFlags& options, const TrainSettings& settings) {
  return options.target_bytes > 0 && !givenOneOf(options, settings, {"gaussians", "percent"});
}

}  // namespace tg
