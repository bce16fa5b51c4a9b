// SPDX-License-Identifier: Apache-2.0
// Small scenes that together show every setting and every output, drawn by the reference and by another renderer.
#include "support/setting_values.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>

#include "core/system/error.h"
#include "core/system/numbers.h"
#include "render/reference/reference.h"
#include "support/compare.h"

namespace tg::test {
namespace {

constexpr float kVisible = 1.0f / 255;  // pictures of 8 bits are half of it off
constexpr double kStrays = 0.005;       // of the pixels: a threshold fell differently; measured: below 0.0005
constexpr double kShown = 0.01;         // of the pixels, that a value has to change in a scene; measured: from 0.016 on

std::string percent(double share) { return formatted("%.1f %%", 100 * share); }

// The share of the pixels that differ visibly.
double share(const Image& a, const Image& b) {
  const int channels = a.channels;
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.data.size(); i += static_cast<std::size_t>(channels)) {
    bool differs = false;
    for (int c = 0; c < channels; ++c) differs |= !(std::abs(a.data[i + c] - b.data[i + c]) <= kVisible);
    different += differs;
  }
  return static_cast<double>(different) / static_cast<double>(a.data.size() / static_cast<std::size_t>(channels));
}

std::vector<TestScene> scenes() {
  std::vector<TestScene> all;
  for (const SceneKind kind : {SceneKind::ordinary, SceneKind::stacked, SceneKind::oddTextures}) {
    all.push_back(makeScene(kind, 5, 100, 48, 36));
    all.back().model.intersection = IntersectionModel::maxResponse;
  }
  all.back().camera = resized(all.back().camera, 24, 18);  // texels smaller than pixels
  return all;
}

Output firstOutput(const RenderSetting& setting) {
  constexpr auto outputs = valuesOf<Output>();
  return *std::ranges::find_if(outputs, [&](Output output) { return setting.outputs.has(output); });
}

Image truth(const ReferenceModel& model, const Camera& camera, RenderSettings settings, Output output) {
  settings.outputs = kBlendedOutputs | OutputSet{output};
  return visualize(rounded(renderReference(model, camera, settings)), output, settings);
}

}  // namespace

const std::string& otherValue(const RenderSetting& setting) {
  static const std::map<std::string_view, std::string> values = {{"textures", "off"},
                                                                 {"intersection", "plane"},
                                                                 {"outside", "clip"},
                                                                 {"sort", "per-pixel"},
                                                                 {"texture-filter", "footprint"},
                                                                 {"antialiasing", "screen"},
                                                                 {"opacity-scale", "0.3"},
                                                                 {"splat-scale", "0.5"},
                                                                 {"sh-degree", "0"},
                                                                 {"near", "3.5"},
                                                                 {"crop", "-9,-9,-9,0.2,9,9"},
                                                                 {"exposure", "-1.5"},
                                                                 {"background", "0.25,0.5,1"},
                                                                 {"gain", "4"},
                                                                 {"colors", "turbo"},
                                                                 {"range", "10,90"}};
  const auto found = values.find(setting.name);
  if (found == values.end()) {
    throw Error(ErrorKind::usage, "tests/support/setting_values.cpp",
                "no value for " + std::string(setting.name) + " (expected one that is not the default)");
  }
  return found->second;
}

std::string ignoredSettings(const DrawPictures& draw) {
  std::map<std::string_view, double> shown, wrong;
  for (const TestScene& scene : scenes()) {
    const ReferenceModel model(scene.model);
    std::map<Output, Image> usual;
    for (const RenderSetting& setting : renderSettings()) {
      const Output output = firstOutput(setting);
      if (!usual.contains(output)) usual[output] = truth(model, scene.camera, {}, output);
      RenderSettings settings;
      setting.set(settings, otherValue(setting), "");
      const Image right = truth(model, scene.camera, settings, output);
      shown[setting.name] = std::max(shown[setting.name], share(right, usual[output]));
      for (const Image& picture : draw(scene, settings, output)) {
        wrong[setting.name] = std::max(wrong[setting.name], share(picture, right));
      }
    }
  }
  std::string lines;
  for (const RenderSetting& setting : renderSettings()) {
    const std::string name(setting.name), with = name + " " + otherValue(setting);
    if (shown[name] < kShown) lines += with + " changes " + percent(shown[name]) + " of the reference's pixels\n";
    if (wrong[name] > kStrays)
      lines += with + " is unlike the reference's in " + percent(wrong[name]) + " of the pixels\n";
  }
  return lines;
}

std::string undrawnOutputs(const DrawPictures& draw) {
  std::map<Output, double> shown, wrong;
  for (const TestScene& scene : scenes()) {
    RenderSettings settings;
    settings.outputs = kAllOutputs;
    const Frame frame = rounded(renderReference(ReferenceModel(scene.model), scene.camera, settings));
    for (const Output output : valuesOf<Output>()) {
      const Image numbers = extract(frame, output), right = visualize(frame, output);
      const auto zeros = static_cast<double>(std::ranges::count(numbers.data, 0.0f));
      shown[output] = std::max(shown[output], 1 - zeros / static_cast<double>(numbers.data.size()));
      for (const Image& picture : draw(scene, {}, output)) {
        wrong[output] = std::max(wrong[output], share(picture, right));
      }
    }
  }
  std::string lines;
  for (const Output output : valuesOf<Output>()) {
    const std::string named(name(output));
    if (shown[output] < kShown) {
      lines += named +
               " is 0 in the reference's pictures of the scenes of tests/support/setting_values.cpp (drawn by " +
               "render/reference/reference.cpp; add a scene that shows it)\n";
    }
    if (wrong[output] > kStrays) {
      lines += named + " is unlike the reference's in " + percent(wrong[output]) +
               " of the pixels (where it is drawn: " + "\"An output\" in CONTRIBUTING.md)\n";
    }
  }
  return lines;
}

}  // namespace tg::test
