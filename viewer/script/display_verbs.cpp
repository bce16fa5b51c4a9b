// SPDX-License-Identifier: Apache-2.0
// Script commands of what is shown and how.
#include <array>

#include "viewer/script/verb.h"
#include "viewer/view/inspection.h"
#include "viewer/view/parse.h"

namespace tg {
namespace {

RenderSettings& settings(ViewerState& state) { return state.display.settings; }

constexpr std::array kDisplayVerbs = {
    Verb{"output", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { s.display.output = parseShow(w[0], at); }},
    Verb{"textures", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { settings(s).textures = parseTextures(w[0], at); }},
    Verb{"hold-textures-off", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           s.display.textures_held_off = parseSwitch(w[0], at);
         }},
    Verb{"intersection", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           settings(s).intersection = parseIntersection(w[0], at);
         }},
    Verb{"background", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { settings(s).background = parseColor(w[0], at); }},
    Verb{"exposure", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { s.display.exposure = parseExposure(w[0], at); }},
    Verb{"sort", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { settings(s).order = parseOrder(w[0], at); }},
    Verb{"texture-filter", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           settings(s).texture_filter = parseFilter(w[0], at);
         }},
    Verb{"antialiasing", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           settings(s).antialiasing = parseAntialias(w[0], at);
         }},
    Verb{"opacity-scale", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           settings(s).opacity_scale = parseScale(w[0], at);
         }},
    Verb{"splat-scale", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           settings(s).splat_scale = parseSplatScale(w[0], at);
         }},
    Verb{"sh-degree", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           settings(s).max_sh_degree = parseDegree(w[0], at);
         }},
    Verb{"near", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { settings(s).near = parseNear(w[0], at); }},
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
         [](ViewerState& s, const Words& w,
            const std::string& at) { s.display.resolution = parseNumber(w[0], kMinResolution, kMaxResolution, at); }},
};

}  // namespace

std::span<const Verb> displayVerbs() { return kDisplayVerbs; }

}  // namespace tg
