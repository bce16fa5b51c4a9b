// SPDX-License-Identifier: Apache-2.0
// Every choice of a training run, by name, with its unit: what flags, configuration files and training.json share.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/model.h"
#include "core/system/names.h"

namespace tg {

// How stage 1 changes the set of Gaussians: not at all; clone, split and prune by screen gradient (3DGS); relocation
// and growth to a cap as Markov chain Monte Carlo (Kheradmand et al. 2024).
enum class Densification { none, adc, mcmc };
constexpr auto namesOf(Densification) { return enumNames("none", "adc", "mcmc"); }
// In what they differ beside their rounds (Trainer::densify).
struct DensificationTraits {
  bool finds_count = false;         // without a limit it ends at a count, which percent may be a share of
  bool needs_limit = false;         // without one it does not begin; its rounds keep those that are seen most
  bool heeds_limit_by = false;      // else no limit is kept by LimitBy
  bool resets_opacity = false;      // in rounds of their own
  bool gathers_statistics = false;  // of every step (DensityStatistics)
  bool grows_by_share = false;      // of the count, a round (Trainer::mcmcGrowth)
  bool explores = false;  // half opaque and small at first; noise, and weights of opacity and sigma in the loss
};
constexpr DensificationTraits traitsOf(Densification densification) {
  switch (densification) {
    case Densification::none:
      return {};
    case Densification::adc:
      return {.finds_count = true, .heeds_limit_by = true, .resets_opacity = true, .gathers_statistics = true};
    case Densification::mcmc:
      return {.needs_limit = true, .grows_by_share = true, .explores = true};
  }
  return {};
}
// What adc ranks by: |sum of the pixels' gradients| (3DGS), also the sum of their magnitudes with the quantile rule of
// GOF (docs/math.md 6.9), or that sum instead, under a threshold that as many pass.
enum class DensifyScore { sum, magnitudes, magnitudesOnly };
constexpr auto namesOf(DensifyScore) { return enumNames("sum", "magnitudes", "magnitudes-only"); }
// How adc keeps to a limit: the highest scores grow while there is room; or those that the training views show least
// make room for them, a twentieth a round; or these do under a higher limit (grownLimit), and then pairs are merged.
enum class LimitBy { room, swap, merge };
constexpr auto namesOf(LimitBy) { return enumNames("room", "swap", "merge"); }
// Where stage 1 starts: the data set's points, or random ones.
enum class Start { points, random };
constexpr auto namesOf(Start) { return enumNames("points", "random"); }
// How texels are shared out: the same rectangle for all, or in proportion to the pixels each Gaussian covers.
enum class TextureSizes { uniform, footprint };
constexpr auto namesOf(TextureSizes) { return enumNames("uniform", "footprint"); }
// Where a ray meets a Gaussian in stage 2.
enum class TextureIntersection { same, plane, maxResponse };
constexpr auto namesOf(TextureIntersection) { return enumNames("same", "plane", "maxResponse"); }
// Texels that change nothing (colour 0, alpha 1), or the paper's: colour 25/255, kept in [0, 1].
enum class TextureInit { neutral, paper };
constexpr auto namesOf(TextureInit) { return enumNames("neutral", "paper"); }

constexpr int kLeastQuantizeIterations = 5;  // of a stage 3: one for each kind of parameter that a file rounds

// Rates are Adam step sizes; "extent" is sceneExtent(). -1 in a schedule entry: chosen from the iterations
// (schedule.h).
struct TrainSettings {
  int iterations = 7000;          // stage 1
  int texture_iterations = 7000;  // stage 2; none with texture mode none
  int quantize_iterations = 0;    // stage 3, for a file that holds coarser numbers
  std::uint64_t seed = 1;

  Start start = Start::points;
  std::size_t init_count = 0;  // points to start from; 0: all, or 100,000 random ones
  std::size_t gaussians = 0;   // most Gaussians in the end; 0: no limit
  double percent = 0;          // the limit as a share of default_gaussians [%]; 0: off
  std::size_t default_gaussians = 0;
  LimitBy limit_by = LimitBy::merge;
  int sh_degree = 3;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  bool filter_3d = false;

  Densification densification = Densification::adc;
  DensifyScore densify_score = DensifyScore::sum;
  float densify_threshold = 2e-4f;  // NDC gradient, mean over views
  float prune_opacity = 0.005f;
  float prune_radius = 0;   // [px] on screen, in runs with opacity resets; 0: off
  float wide_sigma = 0.3f;  // of the distance to the nearest training camera: wider Gaussians are split; 0: off
  int densify_every = 100;
  int densify_from = -1;
  int densify_until = -1;
  int reset_every = -1;
  int sh_every = -1;
  float mcmc_growth = -1;             // of the count, a round
  float mcmc_noise = 5e5f;            // times the position rate of 3DGS
  float mcmc_opacity_weight = 0.01f;  // of mean opacity in the loss
  float mcmc_scale_weight = 0.01f;    // of mean sigma [world units] in the loss

  TextureMode texture_mode = TextureMode::rgba;
  int texture_size = 0;          // [texels] a side; 0: 4, or what percent leads to, as far as there are pixels
  float pixels_per_texel = 2;    // of the training views, at least, where texture_size is 0; 0: no limit
  std::size_t texel_budget = 0;  // [texels] of the model; 0: texture_size rules
  TextureSizes texture_sizes = TextureSizes::uniform;
  // [texels a Gaussian] in the mean, to which textures are cut after half of stage 2, each to the size where its texels
  // take most error off the pictures; 0: they keep theirs.
  float adaptive_texels = 0;
  int texture_dictionary = 0;  // different textures that are left after a quarter of stage 2; 0: each has its own
  TextureInit texture_init = TextureInit::neutral;
  TextureIntersection texture_intersection = TextureIntersection::same;  // as stage 1
  TextureOutside texture_outside = TextureOutside::base;                 // of new textures; not edge
  bool texture_gradient_geometry = true;  // off: as the public re-implementation, for ablation
  bool texture_gradient_suffix = true;    // likewise

  float ssim_weight = 0.2f;
  float extent_distances = 2;        // that the extent may be at most, as sceneExtent() has them; 0: any
  float rate_position = 4e-4f;       // of the extent, at the start of a stage
  float rate_position_end = 4e-6f;   // of the extent, at its end
  float rate_position_texture = -1;  // of the extent, at the start of stage 2; -1: rate_position
  float rate_rotation = 1e-3f;
  float rate_scale = 1e-2f;
  float rate_opacity = 5e-2f;
  float rate_sh_dc = 2.5e-3f;
  float rate_sh_rest = 5e-4f;
  float rate_texels = 5e-3f;      // at the start of stage 2
  float rate_texels_end = 5e-4f;  // at its end; -1: the same
  float texel_decay = 0;          // of the rate, towards texels that change nothing

  bool compare_untextured = false;  // stage 2 once more without textures, from the same stage-1 model

  bool operator==(const TrainSettings&) const = default;
};

// The table of presets in docs/training.md. Throws Error(usage) for another name.
TrainSettings presetSettings(std::string_view preset);
const std::vector<std::string>& presetNames();

// One entry of TrainSettings. Values travel as text: numbers in the C locale, enums by name, on / off.
struct SettingEntry {
  std::string name;  // as the flag, without --
  std::string unit;  // "" for names and pure numbers
  std::string help;
  std::function<std::string(const TrainSettings&)> get;
  // Throws Error(usage) naming the entry, what it expects and what it found.
  std::function<void(TrainSettings&, const std::string&)> set;
  std::vector<std::string> choices{};  // all values of a name
};
// In the order of the struct.
const std::vector<SettingEntry>& settingEntries();

// "name = value" with the meaning and the unit of each entry above it: a configuration file.
std::string formatSettings(const TrainSettings& settings);

// Throws Error(usage) for entries that contradict each other.
void checkSettings(const TrainSettings& settings);

constexpr int kMostTextureSize = 256;  // [texels] along a side, where the size is the same for all
// D12 of the design: side of the square textures with which `percent` % of the Gaussians, more than 0, have as many
// texels as all of them at 4 x 4: round(4 sqrt(100 / percent)), at most kMostTextureSize. [texels]
int textureSizeForPercent(double percent);
// Side of the largest square textures of `gaussians` Gaussians with `pixels_per_texel` of all `pixels` for each texel,
// at least 1.
int textureSizeForPixels(std::uint64_t pixels, std::size_t gaussians, double pixels_per_texel);

}  // namespace tg
