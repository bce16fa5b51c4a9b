// SPDX-License-Identifier: Apache-2.0
// The table of render settings: values as text, and that no member is left out.
#include "render/settings.h"

#include <map>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/setting_values.h"

using namespace tg;

namespace {

RenderSettings with(std::string_view name, const std::string& text) {
  RenderSettings settings;
  renderSetting(name).set(settings, text, "--" + std::string(name));
  return settings;
}

}  // namespace

TEST_CASE("every member of the render settings has a row in the table") {
  RenderSettings settings;
  for (const RenderSetting& row : renderSettings()) {
    INFO(row.name);
    row.set(settings, test::otherValue(row), "");
    CHECK(row.get(settings) == test::otherValue(row));
    CHECK(row.get({}) != row.get(settings));
  }
  const RenderSettings usual;
  const auto& [textures, intersection, outside, background, outputs, order, texture_filter, antialiasing, opacity_scale,
               splat_scale, max_sh_degree, near, crop, exposure, gain, colors, range] = settings;
  CHECK(textures != usual.textures);
  CHECK(intersection != usual.intersection);
  CHECK(outside != usual.outside);
  CHECK(background != usual.background);
  CHECK(outputs == usual.outputs);
  CHECK(order != usual.order);
  CHECK(texture_filter != usual.texture_filter);
  CHECK(antialiasing != usual.antialiasing);
  CHECK(opacity_scale != usual.opacity_scale);
  CHECK(splat_scale != usual.splat_scale);
  CHECK(max_sh_degree != usual.max_sh_degree);
  CHECK(near != usual.near);
  CHECK(crop != usual.crop);
  CHECK(exposure != usual.exposure);
  CHECK(gain != usual.gain);
  CHECK(colors != usual.colors);
  CHECK(range != usual.range);
}

TEST_CASE("what a panel shows of a setting is a value of it") {
  for (const RenderSetting& row : renderSettings()) {
    INFO(row.name);
    for (const RenderSetting::Choice& choice : row.choices) {
      CHECK(row.get(with(row.name, std::string(choice.name))) == choice.name);
    }
    CHECK(row.section.empty() == (row.choices.empty() && !row.number && !row.whole));
    if (!row.number && !row.whole) continue;
    for (const float end : {row.slider.low, row.slider.high}) {
      const std::string text = row.whole ? std::to_string(static_cast<int>(end)) : std::to_string(end);
      CHECK_NOTHROW(checkSettings(with(row.name, text)));
    }
  }
}

TEST_CASE("colours: three numbers in [0,1] or a name") {
  CHECK(with("background", "white").background == glm::vec3(1));
  CHECK(with("background", "black").background == glm::vec3(0));
  CHECK(with("background", "0.25,0.5,1").background == glm::vec3(0.25f, 0.5f, 1));
  for (const char* bad : {"", "red", "1", "1,1", "1,1,", ",,", "1,1,1,1", "2,0,0", "-0.1,0,0", "nan,0,0", "inf,0,0"}) {
    CHECK_THROWS_WITH(with("background", bad),
                      "--background: expected r,g,b in [0,1], white or black, found \"" + std::string(bad) + "\"");
  }
}

TEST_CASE("settings: a wrong name, number or box says what was expected") {
  CHECK(with("textures", "off").textures == TextureMode::none);
  const CropBox box = *with("crop", "1,-2,3,0.5,2,-3").crop;
  CHECK(box.min == glm::vec3(0.5f, -2, -3));
  CHECK(box.max == glm::vec3(1, 2, 3));
  const auto refuses = [](std::string_view name, const std::string& text, const std::string& expected) {
    CHECK_THROWS_WITH(with(name, text),
                      "--" + std::string(name) + ": expected " + expected + ", found \"" + text + "\"");
  };
  refuses("textures", "on", "off, alpha, rgb or rgba");
  refuses("intersection", "flat", "plane or maxResponse");
  refuses("outside", "skip", "base, clip or edge");
  refuses("sort", "pixel", "global or per-pixel");
  refuses("texture-filter", "nearest", "bilinear or footprint");
  refuses("antialiasing", "on", "off or screen");
  for (const char* bad : {"", "1,2,3", "1,2,3,4,5,", "1,2,3,4,5,x", "1,2,3,4,5,6,7", "1,2,3,4,5,inf"}) {
    refuses("crop", bad, "two corners of a box x0,y0,z0,x1,y1,z1");
  }
  for (const char* bad : {"4", "-1", "1.5", ""}) refuses("sh-degree", bad, "a degree from 0 to 3");
  refuses("splat-scale", "0", "a number from 0.01 to 10");
  refuses("opacity-scale", "-1", "a number from 0 to 10");
  refuses("near", "0", "a number from 1e-06 to 1e+06");
  refuses("exposure", "11", "a number from -10 to 10");
  refuses("gain", "0", "a number from 0.1 to 64");
  refuses("colors", "jet", "auto, turbo, viridis or grey");
  for (const char* bad : {"", "2", "98,2", "5,5", "-1,50", "0,101", "nan,50", "1,2,3"}) {
    refuses("range", bad, "two percentiles low,high from 0 to 100");
  }
  CHECK_THROWS_AS(renderSetting("colour"), Error);
}

TEST_CASE("what a backend without a setting's formulas says") {
  const auto problem = [](const RenderSettings& settings) -> std::string {
    try {
      requireBlendingDefaults(settings, kBlendedOutputs, "training");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  CHECK(problem({}) == "");
  CHECK(problem(with("textures", "rgb")) == "");
  CHECK(problem(with("sort", "per-pixel")) == "per-pixel order: not supported by training");
  CHECK(problem(with("near", "0.5")) == "near plane: not supported by training");
  CHECK(problem(with("crop", "0,0,0,1,1,1")) == "crop box: not supported by training");
  CHECK(problem(with("outside", "edge")) == "");  // pictures of training have it, gradients do not
  CHECK_NOTHROW(requireDifferentiable(TextureOutside::base, "training"));
  CHECK_THROWS_WITH(requireDifferentiable(TextureOutside::edge, "training"), "outside edge: not supported by training");
  RenderSettings settings;
  settings.outputs = {Output::overdraw};
  CHECK(problem(settings) == "output overdraw: not supported by training");
}
