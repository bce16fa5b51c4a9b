// SPDX-License-Identifier: Apache-2.0
// What tgconvert prints.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>

#include "converter/convert.h"
#include "converter/edit/statistics.h"
#include "core/file/json.h"
#include "core/model/texture_dictionary.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;  // keys in the order they are written here

struct ModelFacts {
  glm::vec3 low{std::numeric_limits<float>::max()};
  glm::vec3 high{std::numeric_limits<float>::lowest()};
  std::size_t textured = 0;
  std::uint64_t texels = 0;
  std::size_t different = 0;  // textures, where Gaussians share them
  int smallest = 0;           // [texels] sides of textured Gaussians
  int largest = 0;
};

ModelFacts factsOf(const GaussianModel& model) {
  ModelFacts facts;
  for (const glm::vec3& p : model.mean) {
    facts.low = glm::min(facts.low, p + 0.0f);  // + 0: no "-0" in print
    facts.high = glm::max(facts.high, p + 0.0f);
  }
  for (const TextureRect& rect : model.atlas.rects) {
    if (rect.texelCount() == 0) continue;
    const int shorter = std::min(rect.width, rect.height);
    facts.smallest = facts.textured == 0 ? shorter : std::min(facts.smallest, shorter);
    facts.largest = std::max<int>(facts.largest, std::max(rect.width, rect.height));
    facts.texels += rect.texelCount();
    ++facts.textured;
  }
  if (const std::vector<std::uint32_t> groups = textureGroups(model.atlas); areShared(model.atlas, groups)) {
    facts.different = firstOfGroups(groups).size();
    if (facts.textured < model.size()) --facts.different;  // that of those without
  }
  return facts;
}

template <typename... Args>
std::string format(const char* pattern, Args... args) {
  char line[256];
  std::snprintf(line, sizeof(line), pattern, args...);
  return line;
}

// The corners of a box, with digits enough for its sides.
std::string spoken(glm::vec3 low, glm::vec3 high) {
  std::array<int, 3> digits{};
  for (int axis = 0; axis < 3; ++axis) {
    const double farthest = std::max(std::abs(low[axis]), std::abs(high[axis]));
    const double side = static_cast<double>(high[axis]) - low[axis];
    const double whole = side > 0 ? std::ceil(std::log10(farthest / side)) + 4 : 0;
    digits[axis] = static_cast<int>(std::clamp(whole, 6.0, double{std::numeric_limits<float>::max_digits10}));
  }
  const auto corner = [&](glm::vec3 at) {
    return format("(%.*g, %.*g, %.*g)", digits[0], at.x, digits[1], at.y, digits[2], at.z);
  };
  return corner(low) + " to " + corner(high);
}

std::string decibels(double psnr) { return std::isinf(psnr) ? std::string("identical") : format("%.2f dB", psnr); }

// JSON has no infinity: null says "identical" beside the number of views.
Json decibelsJson(const std::optional<double>& psnr) {
  return psnr && std::isfinite(*psnr) ? Json(*psnr) : Json(nullptr);
}

std::string dump(const Json& json) { return dumpJson(json, 2) + "\n"; }

struct ShownAxes {
  std::string words;
  glm::vec3 signs;
};

// `own`: a file's, where they are not its format's.
ShownAxes axesOf(const std::string& file_format, const std::optional<glm::vec3>& own = {}) {
  const Format* known = findFormat(file_format);
  const FileAxes& axes = known && own != kModelAxes.signs ? known->axes : kModelAxes;
  if (!own || *own == axes.signs) return {std::string(axes.words), axes.signs};
  const auto word = [&](int axis, const char* model, const char* other) { return (*own)[axis] > 0 ? model : other; };
  return {format("x %s, y %s, z %s", word(0, "right", "left"), word(1, "down", "up"), word(2, "forward", "back")),
          *own};
}

// What takes one's numbers to the other's.
std::string turnOf(glm::vec3 signs) {
  if (signs == glm::vec3(1.0f)) return "kept";
  if (signs.x * signs.y * signs.z < 0) return "mirrored";
  return std::string("a half turn about ") + (signs.x > 0 ? "x" : signs.y > 0 ? "y" : "z");
}

}  // namespace

std::string describe(const ConvertReport& report) {
  std::string text;
  for (const EditReport& edit : report.edits) {
    text += edit.edit.option + (edit.edit.value.empty() ? "" : " " + edit.edit.value) + ": ";
    text += edit.before == edit.after ? format("%zu Gaussians", edit.after)
                                      : format("%zu -> %zu Gaussians", edit.before, edit.after);
    if (edit.psnr) text += ", " + decibels(*edit.psnr) + " against before";
    text += "\n";
  }
  if (report.adapted) {
    const AdaptReport& a = *report.adapted;
    text += "for " + std::string(profileOf(a.viewer).program) + ": ";
    text += a.wide > 0 ? format("%zu wide Gaussians in %zu pieces, ", a.wide, a.pieces) : "no Gaussian too wide, ";
    if (a.skirts > 0) text += format("%zu skirts, ", a.skirts);
    if (a.parts > 1) text += "what is far a primitive of its own, ";
    text += a.fitted ? format("fitted over %zu views\n", a.fit_views) : "nothing gained by fitting\n";
    text += format("emulated, %zu other views, against our picture: there ", a.held_views) +
            decibels(a.to_model.after) + ", without --for " + decibels(a.to_model.before) +
            "; against ours of the base " + decibels(a.to_base.after) + ", without " + decibels(a.to_base.before) +
            "; here " + decibels(a.ours) + "\n";
  }
  text += format("%zu Gaussians, SH degree %d, %zu cameras\n", report.gaussians, report.sh_degree, report.cameras);
  const ShownAxes from = axesOf(report.input_format, report.input_axes), to = axesOf(report.output_format);
  text += "axes: " + from.words + (from.signs == to.signs ? "" : " -> " + to.words) + ", " +
          turnOf(from.signs * to.signs) + "\n";
  text += format("size: %llu -> %llu bytes%s\n", static_cast<unsigned long long>(report.input_bytes),
                 static_cast<unsigned long long>(report.output_bytes), report.dry_run ? " (nothing is written)" : "");
  if (report.steps) text += format("steps: %.3g\n", static_cast<double>(*report.steps));
  text += "textures: " + report.texture_mode;
  if (report.texels > 0) text += format(", %llu texels", static_cast<unsigned long long>(report.texels));
  if (report.atlases > 0) {
    text += format(" in %d atlas%s of %d x %d, %llu clipped", report.atlases, report.atlases == 1 ? "" : "es",
                   report.atlas_width, report.atlas_height, static_cast<unsigned long long>(report.clipped_texels));
  }
  text += "\n";
  if (report.deviation && !report.deviation->isZero()) {
    const Deviation& d = *report.deviation;
    text += "largest differences:";
    const auto add = [&](const char* what, double value) {
      if (value != 0.0) text += format(" %s %.2g", what, value);
    };
    add("mean", d.mean);
    add("shape", d.shape);
    add("opacity", d.opacity);
    add("colour", d.color);
    add("SH", d.sh);
    add("texel", d.texel);
    text += "\n";
  }
  if (report.views == 0) return text;
  text += format("against the %s, %zu views: ", report.edits.empty() ? "source" : "edited source", report.views);
  if (report.textured_psnr) text += (report.base_psnr ? "textured " : "") + decibels(*report.textured_psnr);
  if (report.textured_psnr && report.base_psnr) text += ", ";
  if (report.base_psnr) text += "base only " + decibels(*report.base_psnr);
  return text + "\n";
}

std::string describeJson(const ConvertReport& report) {
  Json json = {{"format", "tgconvert-summary"}, {"version", 1}};
  json["input"] = {{"file_format", report.input_format},
                   {"bytes", report.input_bytes},
                   {"axes", axesOf(report.input_format, report.input_axes).words}};
  json["output"] = {{"file_format", report.output_format},
                    {"bytes", report.output_bytes},
                    {"axes", axesOf(report.output_format).words}};
  json["dry_run"] = report.dry_run;
  json["steps"] = report.steps ? Json(*report.steps) : Json(nullptr);
  Json edits = Json::array();
  for (const EditReport& edit : report.edits) {
    Json entry = {
        {"option", edit.edit.option}, {"value", edit.edit.value}, {"before", edit.before}, {"after", edit.after}};
    if (edit.psnr) entry["psnr"] = decibelsJson(edit.psnr);
    edits.push_back(std::move(entry));
  }
  if (!edits.empty()) json["edits"] = std::move(edits);
  if (report.adapted) {
    const AdaptReport& a = *report.adapted;
    json["for"] = {{"viewer", name(a.viewer)},
                   {"program", profileOf(a.viewer).program},
                   {"wide", a.wide},
                   {"pieces", a.pieces},
                   {"skirts", a.skirts},
                   {"primitives", a.parts},
                   {"fitted", a.fitted},
                   {"fit_views", a.fit_views},
                   {"held_views", a.held_views},
                   {"psnr_before", decibelsJson(a.to_model.before)},
                   {"psnr", decibelsJson(a.to_model.after)},
                   {"psnr_base_before", decibelsJson(a.to_base.before)},
                   {"psnr_base", decibelsJson(a.to_base.after)},
                   {"psnr_ours", decibelsJson(a.ours)}};
  }
  json["gaussians"] = report.gaussians;
  json["sh_degree"] = report.sh_degree;
  json["cameras"] = report.cameras;
  json["textures"] = {{"mode", report.texture_mode},       {"atlases", report.atlases},
                      {"atlas_width", report.atlas_width}, {"atlas_height", report.atlas_height},
                      {"texels", report.texels},           {"clipped_texels", report.clipped_texels}};
  if (report.deviation) {
    const Deviation& d = *report.deviation;
    json["largest_differences"] = {{"mean", d.mean},   {"shape", d.shape}, {"opacity", d.opacity},
                                   {"color", d.color}, {"sh", d.sh},       {"texel", d.texel}};
  }
  if (report.views > 0) {
    Json psnr;
    psnr["views"] = report.views;
    if (report.textured_psnr) {
      psnr["textured"] = decibelsJson(report.textured_psnr);
      psnr["identical"] = std::isinf(*report.textured_psnr);
    }
    if (report.base_psnr) psnr["base_only"] = decibelsJson(report.base_psnr);
    json["psnr"] = std::move(psnr);
  }
  json["warnings"] = report.warnings;
  return dump(json);
}

std::string describe(const Bundle& loaded, bool statistics) {
  const GaussianModel& model = loaded.model;
  const ModelFacts facts = factsOf(model);
  std::string text = "format: " + loaded.format + "\n";
  text += format("Gaussians: %zu\nSH degree: %d\n", model.size(), model.sh_degree);
  text += "textures: " + std::string(name(model.texture_mode));
  if (facts.textured > 0) {
    text += format(", %zu Gaussians, %llu texels, sides %d to %d", facts.textured,
                   static_cast<unsigned long long>(facts.texels), facts.smallest, facts.largest);
    if (facts.different > 0) text += format(", %zu different", facts.different);
  }
  text += "\nintersection: " + std::string(name(model.intersection)) + "\n";
  if (model.outside != TextureOutside::base) text += "outside: " + std::string(name(model.outside)) + "\n";
  if (model.size() > 0) {
    text += "bounds: " + spoken(facts.low, facts.high) + "\n";
  }
  text += format("cameras: %zu\n", loaded.cameras.size());
  if (!loaded.views.empty()) text += format("named views: %zu\n", loaded.views.size());
  const glm::vec3 background = loaded.background;
  text += "background: " +
          (loaded.knows_background ? format("(%g, %g, %g)", background.x, background.y, background.z) : "not known") +
          "\n";
  text += "axes: " + axesOf(loaded.format, loaded.axes).words + " in the file; bounds in " +
          std::string(kModelAxes.words) + "\n";
  if (!statistics) return text;
  text += format("\n%-22s %11s %11s %11s %11s %11s %11s\n", "", "low", "1 %", "median", "99 %", "high", "mean");
  for (const Distribution& d : distributions(model)) {
    text += format("%-22s %11.5g %11.5g %11.5g %11.5g %11.5g %11.5g  %s\n", d.name.c_str(), d.low, d.p1, d.median,
                   d.p99, d.high, d.mean, d.unit.c_str());
  }
  return text;
}

std::string describeJson(const Bundle& loaded, bool statistics) {
  const GaussianModel& model = loaded.model;
  const ModelFacts facts = factsOf(model);
  const auto triple = [](glm::vec3 v) { return Json{v.x, v.y, v.z}; };
  Json json = {{"format", "tgconvert-info"}, {"version", 1}, {"file_format", loaded.format}};
  json["gaussians"] = model.size();
  json["sh_degree"] = model.sh_degree;
  json["textures"] = {{"mode", name(model.texture_mode)},
                      {"gaussians", facts.textured},
                      {"texels", facts.texels},
                      {"smallest_side", facts.smallest},
                      {"largest_side", facts.largest}};
  if (facts.different > 0) json["textures"]["different"] = facts.different;
  json["intersection"] = name(model.intersection);
  json["outside"] = name(model.outside);
  if (model.size() > 0) json["bounds"] = {{"low", triple(facts.low)}, {"high", triple(facts.high)}};
  json["cameras"] = loaded.cameras.size();
  json["views"] = loaded.views.size();
  json["background"] = loaded.knows_background ? triple(loaded.background) : Json();
  json["axes"] = axesOf(loaded.format, loaded.axes).words;
  if (statistics) {
    Json list = Json::array();
    for (const Distribution& d : distributions(model)) {
      list.push_back({{"name", d.name},
                      {"unit", d.unit},
                      {"count", d.count},
                      {"low", d.low},
                      {"p1", d.p1},
                      {"median", d.median},
                      {"p99", d.p99},
                      {"high", d.high},
                      {"mean", d.mean}});
    }
    json["statistics"] = std::move(list);
  }
  json["warnings"] = loaded.warnings;
  return dump(json);
}

}  // namespace tg
