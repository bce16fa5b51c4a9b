// SPDX-License-Identifier: Apache-2.0
// Writes a model twice as large in the format of OUT: `convert MODEL OUT`.
#include <cstdio>

#include "textured_gaussians/textured_gaussians.h"

namespace tg = textured_gaussians;

int main(int count, char** arguments) try {
  if (count != 3) return 1;
  tg::ConvertOptions options;
  options.overwrite = true;
  options.edits = {{"scale", "2"}};
  const tg::ConvertReport report = tg::convert(arguments[1], arguments[2], options);
  std::printf("%s -> %s, %zu Gaussians, %llu bytes\n", report.input_format.c_str(), report.output_format.c_str(),
              report.gaussians, static_cast<unsigned long long>(report.output_bytes));
  for (const std::string& warning : report.warnings) std::fprintf(stderr, "convert: %s\n", warning.c_str());
} catch (const tg::Error& error) {
  std::fprintf(stderr, "convert: %s\n", error.what());
  return static_cast<int>(error.kind());
}
