// SPDX-License-Identifier: Apache-2.0
// A value off its default for every setting of a training, all of one that is an enumeration, and runs of a few steps
// that have to show them.
#pragma once
#include <algorithm>
#include <map>
#include <memory>
#include <ranges>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "support/catch.h"
#include "training/run/trainer.h"
#include "training/sample_dataset.h"

namespace tg::test {

struct OffDefault {
  std::string value;
  std::vector<std::pair<std::string, std::string>> beside = {};  // other settings without which it does nothing
};

inline const std::multimap<std::string, OffDefault, std::less<>> kOffDefaults = {
    {"iterations", {"13"}},
    {"texture-iterations", {"9"}},
    {"quantize-iterations", {"5"}},
    {"seed", {"2"}},
    {"start", {"random", {{"init-count", "50"}}}},
    {"init-count", {"30"}},
    {"gaussians", {"40"}},
    {"percent", {"50"}},
    {"default-gaussians", {"50", {{"percent", "50"}}}},
    {"limit-by", {"room", {{"gaussians", "40"}}}},
    {"limit-by", {"swap", {{"gaussians", "40"}}}},
    {"sh-degree", {"1"}},
    {"intersection", {"plane"}},
    {"filter-3d", {"on"}},
    {"densification", {"none", {{"gaussians", "150"}}}},
    {"densification", {"mcmc", {{"gaussians", "150"}}}},
    {"densify-score", {"magnitudes"}},
    {"densify-score", {"magnitudes-only"}},
    {"densify-threshold", {"1e-6"}},
    {"prune-opacity", {"0.09"}},
    {"prune-radius", {"3", {{"reset-every", "3"}}}},
    {"wide-sigma", {"0.01"}},
    {"densify-every", {"2"}},
    {"densify-from", {"4"}},
    {"densify-until", {"6"}},
    {"reset-every", {"4"}},
    {"sh-every", {"2"}},
    {"mcmc-growth", {"0.5", {{"densification", "mcmc"}, {"gaussians", "150"}}}},
    {"mcmc-noise", {"5e6", {{"densification", "mcmc"}, {"gaussians", "150"}}}},
    {"mcmc-opacity-weight", {"1", {{"densification", "mcmc"}, {"gaussians", "150"}}}},
    {"mcmc-scale-weight", {"1", {{"densification", "mcmc"}, {"gaussians", "150"}}}},
    {"texture-mode", {"rgb"}},
    {"texture-mode", {"alpha"}},
    {"texture-mode", {"none"}},
    {"texture-size", {"2"}},
    {"pixels-per-texel", {"8"}},
    {"texel-budget", {"300"}},
    {"texture-sizes", {"footprint"}},
    {"adaptive-texels", {"3"}},
    {"texture-dictionary", {"4"}},
    {"texture-init", {"paper"}},
    {"texture-intersection", {"plane"}},
    {"texture-intersection", {"maxResponse", {{"intersection", "plane"}}}},
    {"texture-outside", {"clip"}},
    {"texture-gradient-geometry", {"off"}},
    {"texture-gradient-suffix", {"off"}},
    {"ssim-weight", {"0.7"}},
    {"extent-distances", {"0.5"}},
    {"rate-position", {"1e-3"}},
    {"rate-position-end", {"1e-4"}},
    {"rate-position-texture", {"1e-3"}},
    {"rate-rotation", {"0.01"}},
    {"rate-scale", {"0.02"}},
    {"rate-opacity", {"0.1"}},
    {"rate-sh-dc", {"0.01"}},
    {"rate-sh-rest", {"0.01"}},
    {"rate-texels", {"0.02"}},
    {"rate-texels-end", {"0.003"}},
    {"texel-decay", {"0.5"}},
    {"compare-untextured", {"on"}},
};

// Two runs that differ in one setting.
struct SettingRuns {
  TrainSettings usual, changed;
};
// One pair for each line of kOffDefaults.
inline std::vector<SettingRuns> runsOf(const SettingEntry& entry) {
  INFO("add a value of --" << entry.name << " that a few steps show to kOffDefaults in tests/training/every_setting.h");
  const auto [first, last] = kOffDefaults.equal_range(entry.name);
  REQUIRE(first != last);
  TrainSettings usual;
  usual.iterations = 12;
  usual.texture_iterations = 8;
  usual.densify_every = 3;
  usual.densify_from = 2;
  usual.densify_until = 10;
  usual.sh_every = 3;
  usual.reset_every = 0;
  usual.pixels_per_texel = 0;
  std::vector<SettingRuns> runs;
  for (const auto& [setting, off] : std::ranges::subrange(first, last)) {
    runs.push_back({usual, usual});
    for (const auto& [name, value] : off.beside) {
      std::ranges::find(settingEntries(), name, &SettingEntry::name)->set(runs.back().usual, value);
    }
    runs.back().changed = runs.back().usual;
    entry.set(runs.back().changed, off.value);
  }
  return runs;
}

inline Dataset tinyDataset(int size = 24, int points = 60) {
  return sampleDataset({.size = size, .train_views = 4, .test_views = 0, .points = points, .supersampling = 1});
}

inline TrainResult trainOn(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer) {
  Trainer trainer(dataset, settings, renderer);
  trainer.onQuantizing([](GaussianModel model, float& steps) {
    steps = 1;
    for (glm::vec3& mean : model.mean) mean = glm::round(mean * 64.0f) / 64.0f;
    return model;
  });
  while (trainer.step()) {
  }
  return trainer.result();
}
inline bool sameModels(const TrainResult& a, const TrainResult& b) {
  return a.model == b.model && a.untextured == b.untextured;
}

// Whether settings change what a renderer trains.
class SettingEffects {
 public:
  using MakeRenderer = std::unique_ptr<DifferentiableRenderer> (*)();
  SettingEffects(const Dataset& dataset, MakeRenderer make) : dataset_(dataset), make_(make) {}
  // All of them train different models, as well.
  bool changesModel(std::span<const SettingRuns> runs) {
    std::vector<TrainResult> changed;
    for (const SettingRuns& each : runs) {
      auto usual = std::ranges::find(usual_, each.usual, &Trained::first);  // most have the same
      if (usual == usual_.end()) usual = usual_.insert(usual, {each.usual, trained(each.usual)});
      changed.push_back(trained(each.changed));
      if (sameModels(changed.back(), usual->second)) return false;
      const auto same = [&](const TrainResult& other) { return sameModels(other, changed.back()); };
      if (std::any_of(changed.begin(), changed.end() - 1, same)) return false;
    }
    return true;
  }

 private:
  using Trained = std::pair<TrainSettings, TrainResult>;
  TrainResult trained(const TrainSettings& settings) const { return trainOn(dataset_, settings, *make_()); }
  const Dataset& dataset_;
  const MakeRenderer make_;
  std::vector<Trained> usual_;
};

}  // namespace tg::test
