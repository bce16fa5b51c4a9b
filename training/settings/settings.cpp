// SPDX-License-Identifier: Apache-2.0
// One table drives flags, configuration files and JSON.
#include "training/settings/settings.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <type_traits>

#include "core/model/texture_dictionary.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/member_count.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

[[noreturn]] void refuse(const std::string& entry, const std::string& expected, const std::string& found) {
  throw Error(ErrorKind::usage, "--" + entry + ": expected " + expected + ", found '" + found + "'");
}

template <Named Enum>
SettingEntry choice(std::string entry, Enum TrainSettings::* member, std::string help) {
  const std::string names = allNames<Enum>(", ");
  constexpr auto choices = namesOf(Enum{});
  return {entry,
          "",
          std::move(help) + " (" + names + ")",
          [member](const TrainSettings& s) { return std::string(name(s.*member)); },
          [entry, member, names](TrainSettings& s, const std::string& text) {
            const std::optional<Enum> value = parse<Enum>(text);
            if (!value) refuse(entry, names, text);
            s.*member = *value;
          },
          std::vector<std::string>(choices.begin(), choices.end())};
}

SettingEntry onOff(std::string entry, bool TrainSettings::* member, std::string help) {
  return {entry, "", std::move(help), [member](const TrainSettings& s) { return s.*member ? "on" : "off"; },
          [entry, member](TrainSettings& s, const std::string& text) {
            if (text != "on" && text != "off") refuse(entry, "on, off", text);
            s.*member = text == "on";
          }};
}

// Whole numbers without an exponent.
std::string boundText(double value) {
  const bool whole = value == std::trunc(value) && std::abs(value) < 0x1p53;
  return whole ? numberText(static_cast<long long>(value)) : numberText(value);
}

template <typename Number>
SettingEntry number(std::string entry, Number TrainSettings::* member, double low, double high, std::string unit,
                    std::string help) {
  return {entry, std::move(unit), std::move(help), [member](const TrainSettings& s) { return numberText(s.*member); },
          [entry, member, low, high](TrainSettings& s, const std::string& text) {
            const std::optional<Number> value = parseWhole<Number>(text);
            if (!value || !(static_cast<double>(*value) >= low && static_cast<double>(*value) <= high)) {
              const char* kind = std::is_floating_point_v<Number> ? "a number" : "an integer";
              refuse(entry, std::string(kind) + " from " + boundText(low) + " to " + boundText(high), text);
            }
            s.*member = *value;
          }};
}

constexpr double kMostIterations = 10'000'000;
constexpr double kMostGaussians = 100'000'000;
constexpr double kLargestRate = 10;

std::vector<SettingEntry> makeEntries() {
  using S = TrainSettings;
  const SettingEntry entries[] = {
      number("iterations", &S::iterations, 0, kMostIterations, "steps", "Stage 1: plain Gaussians"),
      number("texture-iterations", &S::texture_iterations, 0, kMostIterations, "steps", "Stage 2: with textures"),
      number("quantize-iterations", &S::quantize_iterations, 0, kMostIterations, "steps",
             "Stage 3: with parameters as --output will hold them (without the flag: a tenth of the others with "
             "--target-size or --steps)"),
      number("seed", &S::seed, 0, 0x1p53, "", "Same seed, same model"),
      choice("start", &S::start, "Start from the data set's points, or from random ones"),
      number("init-count", &S::init_count, 0, kMostGaussians, "points",
             "Points to start from (0: all; 100000 if random)"),
      number("gaussians", &S::gaussians, 0, kMostGaussians, "Gaussians", "Most Gaussians in the end (0: no limit)"),
      number("percent", &S::percent, 0, 100, "%", "The limit as a share of default-gaussians (0: off)"),
      number("default-gaussians", &S::default_gaussians, 0, kMostGaussians, "Gaussians",
             "Gaussians that stage 1 reaches without a limit (0: a stage 1 of its own finds out)"),
      choice("limit-by", &S::limit_by, "adc: how the limit is kept"),
      number("sh-degree", &S::sh_degree, 0, 3, "", "Highest degree of the spherical harmonics"),
      choice("intersection", &S::intersection, "Where a ray meets a Gaussian"),
      onOff("filter-3d", &S::filter_3d, "No Gaussian thinner than the training views can resolve"),
      choice("densification", &S::densification, "How stage 1 adds and removes Gaussians"),
      choice("densify-score", &S::densify_score, "adc: what Gaussians are ranked by"),
      number("densify-threshold", &S::densify_threshold, 0, 1, "NDC", "adc: mean screen gradient that densifies"),
      number("prune-opacity", &S::prune_opacity, 0, 1, "", "Opacity below which a Gaussian is removed or relocated"),
      number("prune-radius", &S::prune_radius, 0, 1e6, "px",
             "adc: also remove what reaches further from its centre on screen, after the first reset (0: off, as 3DGS "
             "in effect)"),
      number("wide-sigma", &S::wide_sigma, 0, 1e3, "of the distance",
             "adc: split what has a larger sigma for its distance to the nearest training camera (0: off)"),
      number("densify-every", &S::densify_every, 1, kMostIterations, "steps", "Steps between two densifications"),
      number("densify-from", &S::densify_from, -1, kMostIterations, "steps",
             "First densification after this (-1: auto)"),
      number("densify-until", &S::densify_until, -1, kMostIterations, "steps", "No densification from here (-1: auto)"),
      number("reset-every", &S::reset_every, -1, kMostIterations, "steps",
             "adc: steps between opacity resets (0: none, -1: auto)"),
      number("sh-every", &S::sh_every, -1, kMostIterations, "steps", "Steps between two SH degrees (-1: auto)"),
      number("mcmc-growth", &S::mcmc_growth, -1, 1, "", "mcmc: growth of the count each round, as a share (-1: auto)"),
      number("mcmc-noise", &S::mcmc_noise, 0, 1e9, "", "mcmc: noise on positions, times the position rate of 3DGS"),
      number("mcmc-opacity-weight", &S::mcmc_opacity_weight, 0, 100, "", "mcmc: weight of mean opacity in the loss"),
      number("mcmc-scale-weight", &S::mcmc_scale_weight, 0, 100, "", "mcmc: weight of mean sigma in the loss"),
      choice("texture-mode", &S::texture_mode, "What a texture changes"),
      number("texture-size", &S::texture_size, 0, kMostTextureSize, "texels",
             "Texels along each side (0: 4, with percent round(4 sqrt(100 / percent)), as far as there are pixels)"),
      number("pixels-per-texel", &S::pixels_per_texel, 0, 1e6, "pixels",
             "Of the training views for each texel at least, where texture-size is 0 (0: no limit)"),
      number("texel-budget", &S::texel_budget, 0, 4e9, "texels",
             "Texels of the whole model instead of texture-size, one a Gaussian at least (0: off)"),
      choice("texture-sizes", &S::texture_sizes, "One size for all, or in proportion to the pixels a Gaussian covers"),
      number("adaptive-texels", &S::adaptive_texels, 0, 65536, "texels a Gaussian",
             "After half of stage 2 textures are cut to as many in the mean, where they show most (0: off)"),
      number("texture-dictionary", &S::texture_dictionary, 0, static_cast<double>(kMostSharedTextures), "textures",
             "After a quarter of stage 2 Gaussians share as many different textures (0: each has its own)"),
      choice("texture-init", &S::texture_init, "First texels: no change, or the paper's 25/255"),
      choice("texture-intersection", &S::texture_intersection, "Where a ray meets a Gaussian in stage 2"),
      choice("texture-outside", &S::texture_outside,
             "Beyond new textures: the base, or with clip nothing (edge is not trained)"),
      onOff("texture-gradient-geometry", &S::texture_gradient_geometry,
            "Texture gradients reach the geometry (off: ablation)"),
      onOff("texture-gradient-suffix", &S::texture_gradient_suffix,
            "Colour behind a splat includes its texture (off: ablation)"),
      number("ssim-weight", &S::ssim_weight, 0, 1, "", "Share of 1 - SSIM in the loss, beside L1"),
      number("extent-distances", &S::extent_distances, 0, 1e6, "distances",
             "Most that the extent is, of the median point to the nearest camera that sees it (0: the cameras' span "
             "alone)"),
      number("rate-position", &S::rate_position, 0, kLargestRate, "extent per step",
             "At the start of a stage (0: to its end)"),
      number("rate-position-end", &S::rate_position_end, 0, kLargestRate, "extent per step", "At the end of a stage"),
      number("rate-position-texture", &S::rate_position_texture, -1, kLargestRate, "extent per step",
             "At the start of stage 2 (-1: rate-position, 0: to its end)"),
      number("rate-rotation", &S::rate_rotation, 0, kLargestRate, "per step", "Of the quaternion"),
      number("rate-scale", &S::rate_scale, 0, kLargestRate, "ln sigma per step", "Of the scale"),
      number("rate-opacity", &S::rate_opacity, 0, kLargestRate, "logit per step", "Of the opacity"),
      number("rate-sh-dc", &S::rate_sh_dc, 0, kLargestRate, "SH per step", "Of the constant colour"),
      number("rate-sh-rest", &S::rate_sh_rest, 0, kLargestRate, "SH per step", "Of the other coefficients"),
      number("rate-texels", &S::rate_texels, 0, kLargestRate, "per step",
             "Of colour and alpha texels, at the start of stage 2 (0: to its end)"),
      number("rate-texels-end", &S::rate_texels_end, -1, kLargestRate, "per step",
             "At the end of stage 2 (-1: the same)"),
      number("texel-decay", &S::texel_decay, 0, 1, "of the rate",
             "Weight decay of texels, towards those that change nothing"),
      onOff("compare-untextured", &S::compare_untextured,
            "Also run stage 2 without textures from the same stage-1 model, and report both"),
  };
  static_assert(std::size(entries) == memberCount<S>(), "every member of TrainSettings has its row here");
  return {std::begin(entries), std::end(entries)};
}

}  // namespace

TrainSettings presetSettings(std::string_view preset) {
  TrainSettings settings;
  if (preset == "default") return settings;
  if (preset == "quick") {
    settings.iterations = 600;
    settings.texture_iterations = 400;
    settings.gaussians = 25'000;
    settings.densify_every = 50;
    settings.densify_from = 50;
    settings.densify_until = 350;
    settings.sh_every = 60;
    settings.rate_sh_dc = 5e-3f;
    settings.rate_sh_rest = 1e-3f;
    return settings;
  }
  if (preset != "paper") refuse("preset", "default, quick, paper", std::string(preset));
  settings.iterations = 30'000;
  settings.texture_iterations = 30'000;
  settings.limit_by = LimitBy::swap;
  settings.densify_score = DensifyScore::magnitudesOnly;
  settings.wide_sigma = 0;
  settings.extent_distances = 0;
  settings.rate_position = 1.6e-4f;
  settings.rate_position_end = 1.6e-6f;
  settings.rate_scale = 5e-3f;
  settings.rate_sh_rest = 1.25e-4f;  // a twentieth of rate_sh_dc
  settings.rate_texels = 1e-3f;
  settings.rate_texels_end = -1;
  settings.texture_init = TextureInit::paper;
  settings.pixels_per_texel = 0;
  settings.texture_intersection = TextureIntersection::plane;
  return settings;
}

const std::vector<std::string>& presetNames() {
  static const std::vector<std::string> names = {"default", "quick", "paper"};
  return names;
}

const std::vector<SettingEntry>& settingEntries() {
  static const std::vector<SettingEntry> entries = makeEntries();
  return entries;
}

std::string formatSettings(const TrainSettings& settings) {
  std::string text;
  for (const SettingEntry& entry : settingEntries()) {
    text += "# " + entry.help + (entry.unit.empty() ? "" : " [" + entry.unit + "]") + "\n" + entry.name + " = " +
            entry.get(settings) + "\n";
  }
  return text;
}

void checkSettings(const TrainSettings& settings) {
  // Values set in code rather than by text pass the same limits.
  for (const SettingEntry& entry : settingEntries()) {
    TrainSettings ignored;
    entry.set(ignored, entry.get(settings));
  }
  const DensificationTraits traits = traitsOf(settings.densification);
  if (settings.percent > 0 && settings.gaussians > 0) {
    throw Error(ErrorKind::usage, "--percent and --gaussians both limit the count (expected one of them)");
  }
  if (settings.percent > 0 && settings.default_gaussians == 0 && !traits.finds_count) {
    throw Error(ErrorKind::usage, "--densification " + std::string(name(settings.densification)) +
                                      " finds no count that --percent would be a share of (expected --gaussians, or "
                                      "--default-gaussians with --percent)");
  }
  if (settings.compare_untextured && (settings.texture_mode == TextureMode::none || settings.texture_iterations == 0)) {
    throw Error(ErrorKind::usage,
                "--compare-untextured and --untextured-output are of stage 2 (expected a texture mode and "
                "--texture-iterations)");
  }
  if (settings.texel_decay > 0 && settings.texture_init == TextureInit::paper) {
    throw Error(ErrorKind::usage,
                "--texel-decay is towards texels that change nothing (expected --texture-init neutral)");
  }
  if (settings.texture_outside == TextureOutside::edge) {
    throw Error(ErrorKind::usage, "--texture-outside edge has no gradient (expected base or clip)");
  }
  if (settings.quantize_iterations > 0 && settings.quantize_iterations < kLeastQuantizeIterations) {
    throw Error(ErrorKind::usage, "--quantize-iterations: too few for all parameters" +
                                      expectedFound("0 or at least " + std::to_string(kLeastQuantizeIterations),
                                                    std::to_string(settings.quantize_iterations)));
  }
  if (settings.quantize_iterations > 0 && settings.compare_untextured) {
    throw Error(ErrorKind::usage, "--quantize-iterations has no twin without textures (expected one of both)");
  }
  if (settings.texture_dictionary > 0 &&
      (settings.texture_mode == TextureMode::none || settings.texture_sizes != TextureSizes::uniform ||
       settings.adaptive_texels > 0)) {
    throw Error(ErrorKind::usage,
                "--texture-dictionary is of textures of one size (expected a texture mode, --texture-sizes uniform and "
                "no --adaptive-texels)");
  }
  if (traits.needs_limit && settings.gaussians == 0 && settings.percent == 0) {
    throw Error(ErrorKind::usage, "--densification " + std::string(name(settings.densification)) +
                                      " needs a count to grow to (expected --gaussians or --percent)");
  }
}

int textureSizeForPercent(double percent) {
  TG_ASSERT(percent > 0, "a share of the Gaussians");
  const double size = std::round(4 * std::sqrt(100 / percent));
  return static_cast<int>(std::clamp(size, 1.0, static_cast<double>(kMostTextureSize)));
}

int textureSizeForPixels(std::uint64_t pixels, std::size_t gaussians, double pixels_per_texel) {
  TG_ASSERT(gaussians > 0 && pixels_per_texel > 0, "textures of some Gaussians, with some pixels each");
  const double texels = static_cast<double>(pixels) / (pixels_per_texel * static_cast<double>(gaussians));
  return static_cast<int>(std::clamp(std::sqrt(texels), 1.0, 65535.0));
}

}  // namespace tg
