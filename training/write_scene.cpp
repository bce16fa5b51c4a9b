// SPDX-License-Identifier: Apache-2.0
// What tgtrain writes.
#include "training/write_scene.h"

#include <cstdio>
#include <filesystem>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "converter/edit/quality.h"
#include "converter/edit/target.h"
#include "converter/gltf/meshopt.h"
#include "converter/registry/file_format.h"
#include "core/system/error.h"

namespace tg {

double partOfSog(const std::string& path) {
  if (path.empty()) {
    throw Error(ErrorKind::usage, "--target-size is that of an output (expected -o scene.sog or scene.glb)");
  }
  const std::string_view format = outputFormat(path).name;
  if (format == "sog") return 1;
  if (format != "glb") throw Error(ErrorKind::usage, path, "a size is only for .sog and .glb");
  if (!hasMeshopt()) throw Error(ErrorKind::usage, path, std::string(missingMeshopt()));
  return 1.5;  // 1.4 to 1.7 (docs/lab/converter.md)
}

namespace {

void write(const std::string& path, Bundle& scene, bool replace, std::uint64_t bytes, std::span<const Camera> views) {
  const Format& format = outputFormat(path);
  WriteOptions options{.replace = replace};
  if (bytes > 0) {
    try {
      options.steps = stepsFor(format, path, scene, views, options, {.bytes = bytes});
    } catch (const Error& error) {
      if (error.kind != ErrorKind::usage) throw;
      std::fprintf(stderr, "tgtrain: %s: %s\n", path.c_str(), error.what());
      options.steps = kMostSteps;
    }
  }
  Written written;
  writeModel(format, path, scene, options, written);
  for (const std::string& warning : written.warnings) std::fprintf(stderr, "tgtrain: %s\n", warning.c_str());
}

// Where the model is when it cannot be what was asked for: PATH.tgz, or the first PATH-N.tgz that is free.
void keep(const std::string& path, const Bundle& scene) {
  std::string kept = path + ".tgz";
  for (int number = 2; std::filesystem::exists(kept); ++number) kept = path + "-" + std::to_string(number) + ".tgz";
  writeBundle(kept, scene);
  std::fprintf(stderr, "tgtrain: the model is kept as %s\n", kept.c_str());
}

}  // namespace

std::string writeScene(const std::string& path, Bundle scene, bool replace, bool kept, std::uint64_t bytes) {
  const Format& format = outputFormat(path);
  const std::vector<Camera> views = qualityViews(scene.model, scene.cameras);
  const std::vector<Camera> cameras = scene.cameras;
  if (!format.holds(kKeepsCameras) || bytes > 0) scene.cameras.clear();
  try {
    write(path, scene, replace, bytes, views);
  } catch (const Error&) {
    scene.cameras = cameras;
    if (!kept && format.name != "tgz") keep(path, scene);
    throw;
  }
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
