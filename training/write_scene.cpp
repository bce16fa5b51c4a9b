// SPDX-License-Identifier: Apache-2.0
// What tgtrain writes.
#include "training/write_scene.h"

#include <cstdio>
#include <filesystem>
#include <utility>
#include <vector>

#include "converter/edit/quality.h"
#include "converter/edit/target.h"
#include "converter/registry/file_format.h"
#include "core/system/error.h"

namespace tg {

std::uint64_t bytesAsSog(const std::string& path, std::uint64_t bytes) {
  if (path.empty()) {
    throw Error(ErrorKind::usage, "--target-size is that of an output (expected -o scene.sog or scene.glb)");
  }
  const std::string_view format = outputFormat(path).name;
  if (format == "sog") return bytes;
  constexpr double kGlbPart = 1.5;  // 1.4 to 1.7 times a .sog (docs/lab/converter.md)
  if (format == "glb") return static_cast<std::uint64_t>(static_cast<double>(bytes) / kGlbPart);
  throw Error(ErrorKind::usage, path, "a size is only for .sog and .glb");
}

std::string writeScene(const std::string& path, Bundle scene, bool replace, std::uint64_t bytes) {
  const Format& format = outputFormat(path);
  const std::vector<Camera> views = qualityViews(scene.model, scene.cameras);
  if (!format.holds(kKeepsCameras) || bytes > 0) scene.cameras.clear();
  WriteOptions options{.replace = replace};
  if (bytes > 0) {
    try {
      options.steps = stepsFor(format, scene, views, options, {.bytes = bytes});
    } catch (const Error& error) {
      if (error.kind != ErrorKind::usage) throw;
      std::fprintf(stderr, "tgtrain: %s: %s\n", path.c_str(), error.what());
      options.steps = kMostSteps;
    }
  }
  Written written;
  writeModel(format, path, scene, options, written);
  for (const std::string& warning : written.warnings) std::fprintf(stderr, "tgtrain: %s\n", warning.c_str());
  std::string facts = "(" + std::to_string(std::filesystem::file_size(path)) + " bytes";
  if (!format.holds(kKeepsFloats) || bytes > 0) {
    char text[64];
    std::snprintf(text, sizeof text, ", %.1f dB to the model",
                  renderedPsnr(scene.model, readModel(path).model, views, scene.background));
    facts += text;
  }
  return facts + ")";
}

}  // namespace tg
