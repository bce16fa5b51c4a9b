// SPDX-License-Identifier: Apache-2.0
// tgconvert as a function.
#include "textured_gaussians/convert.h"

#include "converter/convert.h"

#include <algorithm>
#include <exception>
#include <limits>
#include <set>

#include "converter/gltf/write_gltf.h"
#include "converter/idle.h"
#include "core/system/numbers.h"
#include "core/system/shortened.h"
#include "library/access.h"

namespace textured_gaussians {
namespace {

template <typename Number>
void requireRange(const char* flag, const std::optional<Number>& found, Number low, Number high) {
  if (!found || (*found >= low && *found <= high)) return;  // a NaN is not
  throw tg::Error(
      tg::ErrorKind::usage, flag,
      "out of range" + tg::expectedFound(tg::numberText(low) + " to " + tg::numberText(high), tg::numberText(*found)));
}

template <typename Enum>
Enum named(const std::string& value, const char* flag) {
  return tg::parse<Enum>(tg::shortened(value), flag);
}

// The flags that these options are on tgconvert's command line.
std::set<std::string> flagsOf(const ConvertOptions& options) {
  const std::pair<const char*, bool> all[] = {
      {"--quantize", options.quantize},
      {"--meshopt", options.meshopt},
      {"--psnr", options.measure},
      {"--steps", options.steps.has_value()},
      {"--target-size", options.target_size.has_value()},
      {"--target-psnr", options.target_psnr.has_value()},
      {"--texture-step", options.texture_step.has_value()},
      {"--no-cameras", !options.cameras},
      {"--views", !options.views.empty()},
      {"--base-only", options.base_only},
      {"--lean", options.lean},
      {"--atlas", options.atlas.has_value()},
      {"--spz-version", options.spz_version.has_value()},
      {"--spz-axes", options.spz_axes.has_value()},
      {"--for", options.viewer.has_value()},
      {"--for-aim", options.viewer_aim.has_value()},
      {"--dry-run", options.dry_run},
  };
  std::set<std::string> flags;
  for (const auto& [flag, given] : all) {
    if (given) flags.insert(flag);
  }
  return flags;
}

std::vector<tg::Edit> editsOf(const ConvertOptions& options, const tg::ReadOptions& reading) {
  std::vector<tg::Edit> edits;
  for (const auto& [given, value] : options.edits) {
    const std::string name = withoutDashes(given);
    const std::string flag = "--" + name;
    const auto option = std::ranges::find(tg::editOptions(), flag, &tg::EditOption::name);
    if (option == tg::editOptions().end()) {
      throw tg::Error(tg::ErrorKind::usage, calledBy(given), "no such edit (docs/converter.md has them)");
    }
    if (std::string_view(option->value).empty() && !value.empty()) {
      throw tg::Error(tg::ErrorKind::usage, name,
                      "takes no value (expected \"\", found \"" + tg::shortened(value) + "\")");
    }
    const bool is_file = option->value == "FILE";
    if (is_file) requirePath(value, name);
    edits.push_back({flag, is_file ? value : tg::shortened(value), reading});
  }
  return edits;
}

// Throws tg::Error(usage).
tg::ConvertOptions optionsOf(const ConvertOptions& options) {
  if (options.steps.has_value() + options.target_size.has_value() + options.target_psnr.has_value() > 1) {
    throw tg::Error(tg::ErrorKind::usage, "--steps, --target-size and --target-psnr exclude one another");
  }
  requireRange("--steps", options.steps, tg::kLeastSteps, tg::kMostSteps);
  requireRange<std::uint64_t>("--target-size", options.target_size, 1, std::numeric_limits<std::uint64_t>::max());
  requireRange("--target-psnr", options.target_psnr, tg::kLeastTargetPsnr, tg::kMostTargetPsnr);
  requireRange("--texture-step", options.texture_step, tg::kLeastTextureStep, tg::kMostTextureStep);
  requireRange("--spz-version", options.spz_version, tg::kOldestSpz, tg::kNewestSpz);
  tg::ConvertOptions own;
  own.overwrite = options.overwrite;
  own.base_only = options.base_only;
  own.measure = options.measure ? tg::Measure::always : tg::Measure::never;
  own.cameras = options.cameras;
  own.lean = options.lean;
  own.dry_run = options.dry_run;
  if (options.atlas) own.atlas = named<tg::AtlasFormat>(*options.atlas, "--atlas");
  own.quantize = options.quantize;
  own.meshopt = options.meshopt;
  own.steps = options.steps;
  own.texture_step = options.texture_step;
  own.spz_version = options.spz_version;
  if (options.spz_axes) own.spz_axes = named<tg::SpzAxes>(*options.spz_axes, "--spz-axes");
  for (const Camera& view : options.views) own.views.push_back(cameraOf(view));
  own.target = {options.target_size.value_or(0), options.target_psnr.value_or(0)};
  own.edits = editsOf(options, {.base_only = own.base_only, .spz_axes = own.spz_axes});
  if (options.viewer) own.viewer = named<tg::SplatViewer>(*options.viewer, "--for");
  if (options.viewer_aim) own.aim = named<tg::FitAim>(*options.viewer_aim, "--for-aim");
  return own;
}

}  // namespace

ConvertReport convert(const std::filesystem::path& input, const std::filesystem::path& output,
                      const ConvertOptions& options) {
  std::exception_ptr thrown;  // by the caller's own progress: reaches the caller as it is
  const auto tell = [&](tg::ConvertPart part, std::size_t done, std::size_t steps) {
    try {
      options.progress(std::string(tg::name(part)), done, steps);
    } catch (...) {
      thrown = std::current_exception();
      throw;
    }
  };
  const auto convertFile = [&] {
    requirePath(input);
    requirePath(output);
    tg::ConvertOptions own = optionsOf(options);
    if (options.progress) own.listener = tell;
    const tg::Format& format = tg::outputFormat(output);
    if (options.measure && !format.read) {  // nor of an edit is there a number in the report
      throw tg::Error(tg::ErrorKind::usage,
                      "--psnr does nothing here: a ." + std::string(format.name) + " is not read again");
    }
    tg::refuseIdle(flagsOf(options), &format, [&] { return std::vector{input}; }, own);
    tg::ConvertReport report = tg::convert(input, output, own);
    const std::optional<double> psnr = report.textured_psnr ? report.textured_psnr : report.base_psnr;
    return ConvertReport{report.input_format,
                         report.output_format,
                         report.input_bytes,
                         report.output_bytes,
                         report.gaussians,
                         report.steps,
                         psnr,
                         std::move(report.warnings)};
  };
  try {
    return guarded(convertFile);
  } catch (...) {
    if (thrown) std::rethrow_exception(thrown);
    throw;
  }
}

}  // namespace textured_gaussians
