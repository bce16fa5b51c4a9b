// SPDX-License-Identifier: Apache-2.0
// One table drives flags, script commands, sliders, buttons and checks.
#include "render/settings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "render/settings_members.h"

namespace tg {
namespace {

using S = RenderSettings;

[[noreturn]] void refuse(std::string_view what, const std::string& problem) {
  throw Error(ErrorKind::usage, std::string(what), problem);
}
template <typename Number>
void require(bool holds, std::string_view what, const std::string& expected, Number found) {
  if (!holds) refuse(what, "out of range" + expectedFound(expected, numberText(found)));
}

// `low` and `high` bound text. Code may go further, but never below 0 where `low` is not.
RenderSetting number(std::string_view name, float S::* member, std::string_view title, double low, double high,
                     std::string_view unit, std::string help, std::string_view section, RenderSetting::Slider slider) {
  RenderSetting row{name, unit, std::move(help), title};
  row.get = [member](const S& s) { return numberText(s.*member); };
  row.set = [member, low, high](S& s, const std::string& text, const std::string& what) {
    s.*member = static_cast<float>(parseNumber(text, low, high, what));
  };
  if (low >= 0) {
    row.check = [member, title, low](const S& s) {
      const float value = s.*member;
      require(std::isfinite(value) && (low > 0 ? value > 0 : value >= 0), title, low > 0 ? "above 0" : "0 or more",
              value);
    };
  }
  row.section = section;
  row.number = member;
  row.slider = slider;
  return row;
}

// `noun`: what the text is called where it is wrong.
RenderSetting whole(std::string_view name, int S::* member, std::string_view title, int low, int high, std::string noun,
                    const std::string& help, std::string_view section, RenderSetting::Slider slider) {
  const std::string range = std::to_string(low) + " to " + std::to_string(high);
  RenderSetting row{name, "", range + ": " + help, title};
  row.get = [member](const S& s) { return numberText(s.*member); };
  row.set = [=](S& s, const std::string& text, const std::string& what) {
    const auto value = parseWhole<int>(text);
    if (!value || *value < low || *value > high) refuseValue(what, text, noun + " from " + range);
    s.*member = *value;
  };
  row.check = [=](const S& s) { require(s.*member >= low && s.*member <= high, title, range, s.*member); };
  row.section = section;
  row.whole = member;
  row.slider = slider;
  return row;
}

// `help`: what follows the names. `labels`: a button each, and what it means.
template <Named E>
RenderSetting choice(std::string_view name, E S::* member, std::string_view title, const std::string& help,
                     std::string_view section, const std::array<std::array<const char*, 2>, kCount<E>>& labels) {
  RenderSetting row{name, "", allNames<E>() + help, title};
  row.get = [member](const S& s) { return std::string(tg::name(s.*member)); };
  row.set = [member](S& s, const std::string& text, const std::string& what) { s.*member = parse<E>(text, what); };
  row.section = section;
  for (const E value : valuesOf<E>()) {
    const auto& [label, meaning] = labels[static_cast<std::size_t>(value)];
    row.choices.push_back({tg::name(value), label, meaning});
  }
  return row;
}

RenderSetting textures() {
  static const std::string names = "off, alpha, rgb or rgba";
  constexpr const char* kHelp = "Hold Tab to compare with none";
  RenderSetting row{"textures", "", names + ": what of the textures counts", ""};
  row.get = [](const S& s) { return texturesName(s.textures); };
  row.set = [](S& s, const std::string& text, const std::string& what) {
    const auto mode = text == "off" ? TextureMode::none : parse<TextureMode>(text);
    if (!mode) refuseValue(what, text, names);
    s.textures = *mode;
  };
  row.section = "TEXTURES";
  row.choices = {{"off", "Off", kHelp}, {"alpha", "Alpha", kHelp}, {"rgb", "RGB", kHelp}, {"rgba", "RGBA", kHelp}};
  return row;
}

RenderSetting intersection() {
  RenderSetting row{"intersection", "", allNames<IntersectionModel>() + " instead of the model's own", ""};
  row.get = [](const S& s) { return std::string(s.intersection ? name(*s.intersection) : ""); };
  row.set = [](S& s, const std::string& text, const std::string& what) {
    s.intersection = parse<IntersectionModel>(text, what);
  };
  row.section = "INTERSECTION";
  row.choices = {{name(IntersectionModel::plane), "Plane", nullptr},
                 {name(IntersectionModel::maxResponse), "Max response", nullptr}};
  return row;
}

RenderSetting outside() {
  RenderSetting row{"outside", "", allNames<TextureOutside>() + " beyond textures instead of the model's own", ""};
  row.get = [](const S& s) { return std::string(s.outside ? name(*s.outside) : ""); };
  row.set = [](S& s, const std::string& text, const std::string& what) {
    s.outside = parse<TextureOutside>(text, what);
  };
  row.section = "TEXTURES";
  row.choices = {
      {name(TextureOutside::base), "Base", "Beyond +-3 sigma a textured Gaussian shows its base colour"},
      {name(TextureOutside::clip), "Clip", "A textured Gaussian ends at +-3 sigma"},
      {name(TextureOutside::edge), "Edge", "Beyond +-3 sigma a texture goes on with the texels of its border"}};
  return row;
}

RenderSetting crop() {
  RenderSetting row{"crop", "", "x0,y0,z0,x1,y1,z1: only Gaussians whose mean lies in this box", "crop box"};
  row.get = [](const S& s) {
    std::string text;
    for (int i = 0; s.crop && i < 6; ++i) {
      if (i > 0) text += ',';
      text += numberText(i < 3 ? s.crop->min[i] : s.crop->max[i - 3]);
    }
    return text;
  };
  row.set = [](S& s, const std::string& text, const std::string& what) { s.crop = parseCrop(text, what); };
  row.check = [](const S& s) {
    for (int k = 0; s.crop && k < 3; ++k) {
      require(s.crop->min[k] <= s.crop->max[k], "crop box", "its minimum below its maximum", s.crop->min[k]);
    }
  };
  return row;
}

RenderSetting range() {
  RenderSetting row{"range", "", "low,high percentiles of the numbers above 0 that the colours span, 0,100: all", ""};
  row.get = [](const S& s) { return numberText(s.range.low) + "," + numberText(s.range.high); };
  row.set = [](S& s, const std::string& text, const std::string& what) {
    std::array<float, 2> ends{};
    if (!parseList<float>(text, ends) || !(ends[0] >= 0 && ends[0] < ends[1] && ends[1] <= 100)) {
      refuseValue(what, text, "two percentiles low,high from 0 to 100");
    }
    s.range = {ends[0], ends[1]};
  };
  row.section = "COLOURS";
  row.more_values = true;
  row.choices = {{"0,100", "Whole range", "The ends of the colours are the output's own"},
                 {"2,98", "2 - 98 %", "The 2 % at either end have its colour: a few outliers take no contrast"}};
  return row;
}

RenderSetting background() {
  RenderSetting row{"background", "", "r,g,b in [0,1], white or black instead of the model's own", ""};
  row.get = [](const S& s) {
    return numberText(s.background.x) + "," + numberText(s.background.y) + "," + numberText(s.background.z);
  };
  row.set = [](S& s, const std::string& text, const std::string& what) {
    const std::optional<std::array<float, 3>> color = parseColor(text);
    if (!color) refuseValue(what, text, "r,g,b in [0,1], white or black");
    s.background = {(*color)[0], (*color)[1], (*color)[2]};
  };
  return row;
}

std::vector<RenderSetting> makeSettings() {
  std::vector<RenderSetting> rows = {
      textures(),
      intersection(),
      outside(),
      choice("sort", &S::order, "per-pixel order", ": the order in which a pixel's splats are blended",
             "ORDER AND ANTIALIASING",
             {{{"Global", "One order for all pixels: fast, may pop as the camera turns"},
               {"Per pixel", "Every pixel's own order: no popping, slower"}}}),
      choice("texture-filter", &S::texture_filter, "footprint filter", ", which fades texels smaller than a pixel",
             "TEXTURES",
             {{{"Bilinear", "Texels as they are"},
               {"Footprint", "Texels smaller than a pixel fade to the texture's mean: no shimmer far away"}}}),
      choice("antialiasing", &S::antialiasing, "screen antialiasing", ": no Gaussian narrower than a pixel",
             "ORDER AND ANTIALIASING",
             {{{"AA off", "Gaussians as they are"},
               {"Screen", "No Gaussian narrower than a pixel, its opacity makes up for it"}}}),
      number("opacity-scale", &S::opacity_scale, "opacity scale", 0, 10, "", "on every opacity", "SCALES",
             {"Opacity x %.2f", "On every opacity; double click to type", 0, 10, true}),
      number("splat-scale", &S::splat_scale, "splat scale", 0.01, 10, "", "on every sigma", "SCALES",
             {"Size x %.2f", "On every sigma", 0.01f, 10, true}),
      whole("sh-degree", &S::max_sh_degree, "SH degree", 0, 3, "a degree", "higher bands are left out", "SCALES",
            {"SH degree %d", "Higher bands of the model are left out", 0, 3}),
      number("near", &S::near, "near plane", 1e-6, 1e6, "world units", "nothing nearer than this is drawn", "CAMERA",
             {"Near plane %.3f", "Nothing nearer than this is drawn [world units]", 0.001f, 100, true}),
      crop(),
      number("exposure", &S::exposure, "", -10, 10, "stops", "brighter or darker, of final and base", "BACKGROUND",
             {"Exposure %+.2f stops", "Of final and base, before they are clamped; double click to type", -10, 10}),
      number("gain", &S::gain, "", 0.1, 64, "", "on the colour of textures, or on --compare-mode difference", "COLOURS",
             {"Texture x %.1f", "On what textures add to the colour", 0.1f, 64, true}),
      choice("colors", &S::colors, "", ", of outputs with one number a pixel: depths, counts, texels", "COLOURS",
             {{{"Own", "Grey for alpha and depths; black, red, yellow, white for the others"},
               {"Turbo", "A rainbow without false edges"},
               {"Viridis", "Even steps of brightness, also for eyes that tell few colours apart"},
               {"Grey", "Black to white"}}}),
      range(),
      background(),
  };
  const auto only = [&rows](OutputSet outputs, std::initializer_list<std::string_view> names) {
    for (const std::string_view name : names) std::ranges::find(rows, name, &RenderSetting::name)->outputs = outputs;
  };
  only(kOrderedOutputs, {"sort"});
  only(kHitOutputs, {"textures", "intersection", "outside", "texture-filter", "opacity-scale"});
  only(kHitOutputs | OutputSet{Output::ellipsoids}, {"antialiasing", "splat-scale"});
  only(kSolidOutputs | OutputSet{Output::final, Output::base}, {"sh-degree", "background"});
  only({Output::final, Output::base}, {"exposure"});
  only({Output::texture}, {"gain"});
  only(kNumberOutputs, {"colors", "range"});
  return rows;
}

}  // namespace

const std::vector<RenderSetting>& renderSettings() {
  // Never destroyed: a thread may still draw while the process ends.
  static const std::vector<RenderSetting>& settings = *new std::vector<RenderSetting>(makeSettings());
  return settings;
}

const RenderSetting& renderSetting(std::string_view name) {
  const std::vector<RenderSetting>& settings = renderSettings();
  const auto at = std::find_if(settings.begin(), settings.end(), [name](const auto& row) { return row.name == name; });
  if (at == settings.end()) refuse(name, "no such render setting");
  return *at;
}

void checkSettings(const RenderSettings& settings) {
  for (const RenderSetting& row : renderSettings()) {
    if (row.check) row.check(settings);
  }
}

void requireBlendingDefaults(const RenderSettings& settings, OutputSet outputs, std::string_view backend) {
  const std::string problem = "not supported by " + std::string(backend);
  for (const Output output : valuesOf<Output>()) {
    if (settings.outputs.has(output) && !outputs.has(output)) refuse("output " + std::string(name(output)), problem);
  }
  for (const RenderSetting& row : renderSettings()) {
    if (!row.title.empty() && row.get(settings) != row.get({})) refuse(row.title, problem);
  }
}

void requireDifferentiable(TextureOutside outside, std::string_view backend) {
  if (outside != TextureOutside::edge) return;
  refuse("outside " + std::string(name(outside)), "not supported by " + std::string(backend));
}

std::string texturesName(TextureMode mode) { return mode == TextureMode::none ? "off" : std::string(name(mode)); }

std::string drawnTextures(const GaussianModel& model, const RenderSettings& settings) {
  return isTextured(model) ? texturesName(settings.textures) : "none";
}

CropBox parseCrop(const std::string& text, const std::string& what) {
  std::array<float, 6> at{};
  if (!parseList<float>(text, at) || !std::all_of(at.begin(), at.end(), [](float x) { return std::isfinite(x); })) {
    refuseValue(what, text, "two corners of a box x0,y0,z0,x1,y1,z1");
  }
  const glm::vec3 first(at[0], at[1], at[2]), second(at[3], at[4], at[5]);
  return {glm::min(first, second), glm::max(first, second)};
}

}  // namespace tg
