// SPDX-License-Identifier: Apache-2.0
// Script commands of what is shown and how.
#include <array>

#include "viewer/script/verb.h"
#include "viewer/view/inspection.h"
#include "viewer/view/parse.h"

namespace tg {
namespace {

constexpr std::array kDisplayVerbs = {
    Verb{"output", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { s.display.output = parse<Output>(w[0], at); }},
    Verb{"hold-textures-off", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           s.display.textures_held_off = parseSwitch(w[0], at);
         }},
    Verb{"crop", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           if (w[0] == "fit")
             fitCrop(s);
           else if (w[0] == "reset")
             resetCrop(s);
           else if (w[0] != "on" && w[0] != "off")
             s.display.box = parseCrop(w[0], at);
           s.display.crop = w[0] != "off";
         }},
    Verb{"inspect", 2, kFramesOfPanels,
         [](ViewerState& s, const Words& w, const std::string& at) {
           inspect(s, {static_cast<int>(parseNumber(w[0], 0, kMaxImageSide - 1, at)),
                       static_cast<int>(parseNumber(w[1], 0, kMaxImageSide - 1, at))});
         }},
    Verb{"pick", 1, kFramesOfPanels,
         [](ViewerState& s, const Words& w, const std::string& at) {
           pickHit(s, static_cast<int>(parseIndex(w[0], s.inspect.hits.size(), at)));
         }},
    Verb{"isolate", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { s.inspect.isolated = parseSwitch(w[0], at); }},
    Verb{"clear-inspection", 0, 0, [](ViewerState& s, const Words&, const std::string&) { clearInspection(s); }},
    Verb{"continuous", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { s.ui.continuous = parseSwitch(w[0], at); }},
    Verb{"resolution", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           s.display.resolution = parseNumber(w[0], kMinResolution, kMaxResolution, at);
         }},
};

}  // namespace

std::span<const Verb> displayVerbs() { return kDisplayVerbs; }

std::span<const Verb> settingVerbs() {
  static const std::vector<Verb> verbs = [] {
    std::vector<Verb> rows;
    for (const RenderSetting& setting : renderSettings())
      rows.push_back({setting.name, 1, 0, nullptr, nullptr, &setting});
    return rows;
  }();
  return verbs;
}

}  // namespace tg
