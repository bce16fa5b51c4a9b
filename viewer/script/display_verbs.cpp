// SPDX-License-Identifier: Apache-2.0
// Script commands of what is shown and how.
#include <array>

#include "viewer/script/verb.h"
#include "viewer/view/inspection.h"

namespace tg {
namespace {

constexpr std::array kDisplayVerbs = {
    Verb{"output", 1, 0, [](const Call& c) { c.state.display.output = c.named<Output>(); }},
    Verb{"hold-textures-off", 1, 0, [](const Call& c) { c.state.display.textures_held_off = c.on(); }},
    Verb{"crop", 1, 0,
         [](const Call& c) {
           if (c[0] == "fit") {
             fitCrop(c.state);
           } else if (c[0] == "reset") {
             resetCrop(c.state);
           } else if (c[0] != "on" && c[0] != "off") {
             c.state.display.box = parseCrop(c[0], c.what);
           }
           c.state.display.crop = c[0] != "off";
         }},
    Verb{"inspect", 2, kFramesOfPanels,
         [](const Call& c) { inspect(c.state, {c.count(0, 0, kMaxImageSide - 1), c.count(1, 0, kMaxImageSide - 1)}); }},
    Verb{"pick", 1, kFramesOfPanels,
         [](const Call& c) { pickHit(c.state, static_cast<int>(c.index(c.state.inspect.hits.size()))); }},
    Verb{"isolate", 1, 0, [](const Call& c) { c.state.inspect.isolated = c.on(); }},
    Verb{"clear-inspection", 0, 0, [](const Call& c) { clearInspection(c.state); }},
    Verb{"continuous", 1, 0, [](const Call& c) { c.state.ui.continuous = c.on(); }},
    Verb{"splat-budget", 1, 1,
         [](const Call& c) {
           c.state.stream.budget = static_cast<std::size_t>(c.count(0, kLeastSplatBudget, kMostSplatBudget));
         }},
    Verb{"resolution", 1, 0,
         [](const Call& c) { c.state.display.resolution = c.number(0, kMinResolution, kMaxResolution); }},
};

}  // namespace

std::span<const Verb> displayVerbs() { return kDisplayVerbs; }

std::span<const Verb> settingVerbs() {
  static const std::vector<Verb> verbs = [] {
    std::vector<Verb> rows;
    for (const RenderSetting& setting : renderSettings()) {
      rows.push_back({setting.name, 1, 0, nullptr, nullptr, &setting});
    }
    return rows;
  }();
  return verbs;
}

}  // namespace tg
