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
#include "converter/sog/sog.h"
#include "core/system/error.h"

namespace tg {

void checkTarget(const std::string& path, std::uint64_t bytes) {
  if (bytes == 0) return;
  if (path.empty()) {
    throw Error(ErrorKind::usage, "--target-size is that of an output (expected -o scene.sog)");
  }
  if (!outputFormat(path).has_steps) throw Error(ErrorKind::usage, path, "a target is only for .sog");
}

std::string writeScene(const std::string& path, Bundle scene, bool replace, std::uint64_t bytes) {
  const Format& format = outputFormat(path);
  const std::vector<Camera> views = qualityViews(scene.model, scene.cameras);
  if (!format.holds(kKeepsCameras)) scene.cameras.clear();
  WriteOptions options{.replace = replace};
  if (bytes > 0) {
    try {
      options.steps = stepsFor(format, scene, options, {.bytes = bytes});
    } catch (const Error& error) {
      if (error.kind != ErrorKind::usage) throw;
      std::fprintf(stderr, "tgtrain: %s: %s\n", path.c_str(), error.what());
      options.steps = kMostSogSteps;
    }
  }
  Written written;
  writeModel(format, path, scene, options, written);
  for (const std::string& warning : written.warnings) std::fprintf(stderr, "tgtrain: %s\n", warning.c_str());
  std::string facts = "(" + std::to_string(std::filesystem::file_size(path)) + " bytes";
  if (!format.holds(kKeepsFloats)) {
    char text[64];
    std::snprintf(text, sizeof text, ", %.1f dB to the model",
                  renderedPsnr(scene.model, readModel(path).model, views, scene.background));
    facts += text;
  }
  return facts + ")";
}

}  // namespace tg
