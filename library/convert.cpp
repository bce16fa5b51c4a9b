// SPDX-License-Identifier: Apache-2.0
// tgconvert as a function.
#include "textured_gaussians/convert.h"

#include "converter/convert.h"

#include <algorithm>

#include "converter/gltf/write_gltf.h"
#include "library/access.h"

namespace textured_gaussians {

ConvertReport convert(const std::filesystem::path& input, const std::filesystem::path& output,
                      const ConvertOptions& options) {
  return guarded([&] {
    requirePath(input);
    requirePath(output);
    tg::ConvertOptions own;
    own.overwrite = options.overwrite;
    own.quantize = options.quantize;
    own.meshopt = options.meshopt;
    if (options.steps && !(*options.steps >= tg::kLeastSteps && *options.steps <= tg::kMostSteps)) {  // nor a NaN
      throw tg::Error(tg::ErrorKind::usage, "steps", "out of range (expected 0.125 to 64)");
    }
    const tg::Format& format = tg::outputFormat(output);
    const auto refuseIdle = [&](bool given, bool does, const char* what) {
      if (given && !does) throw tg::Error(tg::ErrorKind::usage, what, "does nothing for ." + std::string(format.name));
    };
    refuseIdle(options.quantize, format.is_gltf, "quantize");
    refuseIdle(options.meshopt, format.is_gltf, "meshopt");
    refuseIdle(options.steps.has_value(), format.has_steps, "steps");
    own.steps = options.steps;
    own.measure = options.measure ? tg::Measure::always : tg::Measure::never;
    for (const auto& [name, value] : options.edits) {
      const std::string flag = "--" + name;
      const auto option = std::ranges::find(tg::editOptions(), flag, &tg::EditOption::name);
      if (option == tg::editOptions().end()) {
        throw tg::Error(tg::ErrorKind::usage, name, "no such edit (docs/converter.md has them)");
      }
      if (std::string_view(option->value).empty() && !value.empty()) {
        throw tg::Error(tg::ErrorKind::usage, name, "takes no value (expected \"\", found \"" + value + "\")");
      }
      if (option->value == "FILE") requirePath(value);
      own.edits.push_back({flag, value});
    }
    tg::ConvertReport report = tg::convert(input, output, own);
    const std::optional<double> psnr = report.textured_psnr ? report.textured_psnr : report.base_psnr;
    return ConvertReport{report.input_format,       report.output_format, report.input_bytes,
                         report.output_bytes,       report.gaussians,     psnr,
                         std::move(report.warnings)};
  });
}

}  // namespace textured_gaussians
