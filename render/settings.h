// SPDX-License-Identifier: Apache-2.0
// What a frame holds and how it is drawn: every choice by name, with its unit, as flags, scripts and panels share it.
#pragma once
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/model.h"
#include "core/system/names.h"
#include "shared/limits.h"

namespace tg {

enum class Output : unsigned {
  final = kOutputFinal,
  base = kOutputBase,
  texture = kOutputTexture,
  alpha = kOutputAlpha,
  depth = kOutputDepth,  // expected
  normal = kOutputNormal,
  count = kOutputCount,
  depthMedian = kOutputDepthMedian,
  overdraw = kOutputOverdraw,
  ellipsoids = kOutputEllipsoids,
  centers = kOutputCenters,
  texelDensity = kOutputTexelDensity,
};
constexpr auto namesOf(Output) {
  return enumNames("final", "base", "texture", "alpha", "depth", "normal", "count", "depth-median", "overdraw",
                   "ellipsoids", "centers", "texel-density");
}

class OutputSet {
 public:
  constexpr OutputSet() = default;
  constexpr OutputSet(std::initializer_list<Output> outputs) {
    for (Output output : outputs) bits_ |= bit(output);
  }
  template <typename Outputs>
  static constexpr OutputSet of(const Outputs& outputs) {
    OutputSet set;
    for (Output output : outputs) set.bits_ |= bit(output);
    return set;
  }
  constexpr bool has(Output output) const { return (bits_ & bit(output)) != 0; }
  constexpr bool hasAny(OutputSet others) const { return (bits_ & others.bits_) != 0; }
  constexpr bool hasAll(OutputSet others) const { return (others.bits_ & ~bits_) == 0; }
  constexpr OutputSet without(OutputSet others) const { return OutputSet(bits_ & ~others.bits_); }
  constexpr OutputSet operator|(OutputSet other) const { return OutputSet(bits_ | other.bits_); }
  constexpr bool operator==(const OutputSet&) const = default;

 private:
  constexpr explicit OutputSet(std::uint32_t bits) : bits_(bits) {}
  static constexpr std::uint32_t bit(Output output) { return 1u << static_cast<unsigned>(output); }
  std::uint32_t bits_ = 0;
};
// What blending yields anyway, and what every backend gives.
constexpr OutputSet kBlendedOutputs = {Output::final, Output::base,   Output::texture, Output::alpha,
                                       Output::depth, Output::normal, Output::count};
// What blending yields as fast as the picture alone.
constexpr OutputSet kPictureOutputs = {Output::final, Output::alpha};
// What blending yields at all, up to the transmittance stop.
constexpr OutputSet kOrderedOutputs = kBlendedOutputs | OutputSet{Output::depthMedian, Output::texelDensity};
// What hits of splats decide, in whichever order.
constexpr OutputSet kHitOutputs = kOrderedOutputs | OutputSet{Output::overdraw};
// Without blending: the nearest alone.
constexpr OutputSet kSolidOutputs = {Output::ellipsoids, Output::centers};
constexpr OutputSet kAllOutputs = kHitOutputs | kSolidOutputs;

// One number a pixel: pictures of them have a scale, which spans a frame's own numbers or is always the same.
constexpr OutputSet kRangedOutputs = {Output::depth, Output::count, Output::depthMedian, Output::overdraw};
constexpr OutputSet kNumberOutputs = kRangedOutputs | OutputSet{Output::alpha, Output::texelDensity};
// Three: colours and normals.
constexpr OutputSet kVectorOutputs =
    kSolidOutputs | OutputSet{Output::final, Output::base, Output::texture, Output::normal};

static_assert(kAllOutputs == OutputSet::of(valuesOf<Output>()) && !kHitOutputs.hasAny(kSolidOutputs),
              "an output is one of hits or solid");
static_assert(kAllOutputs == (kNumberOutputs | kVectorOutputs) && !kNumberOutputs.hasAny(kVectorOutputs),
              "an output has one number a pixel or three");

// In what order a pixel's splats are blended: by the camera z of their means, one order for all pixels; or by that of
// the pixel's own hits, so that nothing pops when the camera turns (docs/math.md 5.1).
enum class SplatOrder { global, perPixel };
constexpr auto namesOf(SplatOrder) { return enumNames("global", "per-pixel"); }
// bilinear, or faded to the texture's mean as its texels get smaller than a pixel (docs/math.md 3.1).
enum class TextureFilter { bilinear, footprint };
constexpr auto namesOf(TextureFilter) { return enumNames("bilinear", "footprint"); }
// screen: no Gaussian is narrower than about a pixel, and its opacity makes up for it (docs/math.md 1.4).
enum class Antialiasing { off, screen };
constexpr auto namesOf(Antialiasing) { return enumNames("off", "screen"); }

// What outputs of one number a pixel are coloured with. automatic: grey for alpha and depths, heat for the others.
enum class Colors { automatic, turbo, viridis, grey };
constexpr auto namesOf(Colors) { return enumNames("auto", "turbo", "viridis", "grey"); }
// Whose numbers the ends of the colours stand for: percentiles of the pixels that are above 0. The whole range is the
// output's own.
struct PercentRange {
  float low = 0;  // 0 <= low < high <= 100
  float high = 100;
  bool operator==(const PercentRange&) const = default;
};

// World space, faces included.
struct CropBox {
  glm::vec3 min{0.0f};
  glm::vec3 max{0.0f};
  bool operator==(const CropBox&) const = default;
};

// settings.cpp has a row for each member, and does not compile before it knows a new one.
struct RenderSettings {
  TextureMode textures = TextureMode::rgba;       // switches terms off; what counts is model mode AND this
  std::optional<IntersectionModel> intersection;  // default: the model's
  std::optional<TextureOutside> outside;          // default: the model's
  glm::vec3 background{0.0f};

  OutputSet outputs = kBlendedOutputs;  // what the frame must hold; asking for the picture alone is the fastest
  SplatOrder order = SplatOrder::global;
  TextureFilter texture_filter = TextureFilter::bilinear;
  Antialiasing antialiasing = Antialiasing::off;
  float opacity_scale = 1.0f;   // >= 0: on the opacity after the sigmoid; the product is cut at 1
  float splat_scale = 1.0f;     // > 0: on every sigma
  int max_sh_degree = 3;        // 0..3: higher bands of the model are left out
  float near = kNear;           // [world units] > 0: no mean and no hit at or before this camera z is drawn
  std::optional<CropBox> crop;  // Gaussians whose mean lies outside are not drawn
  // Of pictures alone, never of a frame: visualize().
  float exposure = 0.0f;  // [stops] of final and base
  float gain = 1.0f;      // on the texture's colour
  Colors colors = Colors::automatic;
  PercentRange range;

  bool operator==(const RenderSettings&) const = default;
};
// Throws Error(usage) naming the first member that breaks a promise above. Every backend calls it.
void checkSettings(const RenderSettings& settings);

// One member of RenderSettings. Values travel as text: numbers in the C locale, enumerators by name.
struct RenderSetting {
  // A value as a button of the panel.
  struct Choice {
    std::string_view name;  // the value as text
    const char* label;
    const char* help;  // nullptr: the panel knows more
  };
  // A number as a slider of the panel; text may be beyond its ends.
  struct Slider {
    const char* format = "";  // printf's, of the number
    const char* help = "";
    float low = 0, high = 0;
    bool logarithmic = false;
  };

  std::string_view name;   // of the flag, without --, and of the script's command
  std::string_view unit;   // "" for names and pure numbers
  std::string help;        // of the flag
  std::string_view title;  // in errors: what is out of range, or not supported; "": neither can be
  std::function<std::string(const RenderSettings&)> get{};  // "": the model's, or none
  // Throws Error(usage): `what: expected X, found "text"`.
  std::function<void(RenderSettings&, const std::string& text, const std::string& what)> set{};
  std::function<void(const RenderSettings&)> check{};  // the part of checkSettings(); empty: there is none
  std::string_view section{};                          // heading in the panel; "": widgets of its own
  std::vector<Choice> choices{};                       // in the enumeration's order
  bool more_values = false;                            // than the choices
  float RenderSettings::* number = nullptr;            // what the slider moves, or
  int RenderSettings::* whole = nullptr;
  Slider slider{};
  OutputSet outputs = kAllOutputs;  // that the setting may change, in frames or pictures
};
// In the order of the help.
const std::vector<RenderSetting>& renderSettings();
const RenderSetting& renderSetting(std::string_view name);  // throws Error(usage) for another name

std::string texturesName(TextureMode mode);  // as --textures has it: "off" instead of "none"
std::string drawnTextures(const GaussianModel& model, const RenderSettings& settings);  // "none" of a model without
CropBox parseCrop(const std::string& text, const std::string& what);  // x0,y0,z0,x1,y1,z1; either corner first

// For what has no gradient: training and the backward pass. Throws Error(usage) naming the first output outside of
// `outputs`, or the first setting with a title that is not its default.
void requireBlendingDefaults(const RenderSettings& settings, OutputSet outputs, std::string_view backend);
// The same of what a picture shows beyond its textures: TextureOutside::edge has no gradient.
void requireDifferentiable(TextureOutside outside, std::string_view backend);

}  // namespace tg
