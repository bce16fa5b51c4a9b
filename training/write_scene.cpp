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
#include "converter/gltf/axes.h"
#include "converter/gltf/meshopt.h"
#include "converter/registry/file_format.h"
#include "core/file/atomic_files.h"
#include "core/file/scratch_folder.h"
#include "core/model/equivalent_axes.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {

double partOfSog(const std::string& path) {
  if (path.empty()) {
    throw Error(ErrorKind::usage, "--target-size and --steps are of an output (expected -o scene.sog or scene.glb)");
  }
  const std::string_view format = modelFormat(path).name;
  if (format == "sog") return 1;
  if (format != "glb") throw Error(ErrorKind::usage, path, "--target-size and --steps are only for .sog and .glb");
  if (!hasMeshopt()) throw Error(ErrorKind::usage, path, std::string(missingMeshopt()));
  return 1.6;  // 1.6 at steps of 4, 1.5 at 2 (docs/lab/converter.md)
}

namespace {

// The finest for a file of so many bytes.
float stepsWithin(const std::string& path, const Bundle& scene, std::uint64_t bytes) {
  return stepsFor(outputFormat(path), path, scene, {}, {}, {.bytes = bytes});
}

// Of a scene that was trained for a file of `size.steps`: those, or coarser ones where it is too large. Where it has
// become so much smaller since that there is room, parts of them: what training has put on their grid stays where it
// is, at hardly any bytes, and what it has left free is held closer.
float stepsOf(const std::string& path, const Bundle& scene, SceneSize size) {
  if (size.bytes == 0) return size.steps;
  const Format& format = outputFormat(path);
  const auto bytesWith = [&](float steps) { return bytesOf(format, path, scene, {.steps = steps}); };
  const std::uint64_t bytes = size.steps > 0 ? bytesWith(size.steps) : 0;
  if (size.steps == 0 || bytes > size.bytes) return stepsWithin(path, scene, size.bytes);
  float steps = size.steps;
  if (bytes > size.bytes - size.bytes / 50) return steps;
  while (steps / 2 >= kLeastSteps && bytesWith(steps / 2) <= size.bytes) steps /= 2;
  return steps;
}

// Returns its steps; 0: the format's own, or none.
float write(const std::string& path, const Bundle& scene, bool replace, bool quiet, SceneSize size) {
  const Format& format = outputFormat(path);
  WriteOptions options{.replace = replace};
  const float steps = stepsOf(path, scene, size);
  if (steps > 0) options.steps = steps;
  Written written;
  writeModel(format, path, scene, options, written);
  for (const std::string& warning : written.warnings) {
    if (!quiet) std::fprintf(stderr, "tgtrain: %s\n", printable(warning).c_str());
  }
  return steps;
}

// Under the first name beside `path` that is free, which it returns.
std::string writeBeside(const std::string& path, const Bundle& scene) {
  const bool bundle = outputFormat(path).name == "tgz";
  const std::string stem = bundle ? path.substr(0, path.size() - 4) : path;
  const KeepExisting no_other_run;
  for (int number = bundle ? 2 : 1;; ++number) {
    const std::string kept = stem + (number == 1 ? "" : "-" + std::to_string(number)) + ".tgz";
    std::error_code ignored;
    if (std::filesystem::exists(kept, ignored)) continue;
    try {
      writeBundle(kept, scene);
      return kept;
    } catch (const Error&) {
      if (!std::filesystem::exists(kept, ignored)) throw;
    }
  }
}

// Beside `path`, or in the folder for temporary files where that has no room; returns the name.
std::string writeSomewhere(const std::string& path, const Bundle& scene) {
  try {
    return writeBeside(path, scene);
  } catch (const std::exception&) {
    std::error_code none;
    const std::filesystem::path folder = std::filesystem::temp_directory_path(none);
    if (none) throw;
    return writeBeside((folder / std::filesystem::path(path).filename()).string(), scene);
  }
}

}  // namespace

void writeAfterTraining(const std::string& path, bool replace, const std::function<void()>& write,
                        const std::function<std::string()>& keep) {
  try {
    const KeepExisting no_other_run(!replace);
    write();
  } catch (const Error&) {
    std::error_code ignored;
    if (replace || !std::filesystem::exists(path, ignored)) throw;
    throw Error(ErrorKind::cannotWrite, path,
                "came while the model was trained, which is kept as " + keep() + " (--overwrite replaces it)");
  }
}

Error keepModel(const std::string& path, const Bundle& scene, const Error& why) {
  try {
    return {why.kind, why.what() + (" (the model is kept as " + writeSomewhere(path, scene)) + ")"};
  } catch (const std::exception&) {  // the first reason says more
    return why;
  }
}

GaussianModel asStored(const std::string& path, const GaussianModel& model, std::uint64_t bytes, float& steps) {
  Bundle scene;
  scene.model = model;
  if (steps == 0) {
    try {
      steps = stepsWithin(path, scene, bytes - bytes / 100);
    } catch (const Error& error) {
      if (error.kind != ErrorKind::usage) throw;
      steps = stepsWithin(path, scene, bytes);
    }
  }
  const ScratchFolder folder;
  const std::filesystem::path file = folder.path() / std::filesystem::path(path).filename();
  Written written;
  writeTrial(outputFormat(path), file, path, scene, {.steps = steps}, written);
  GaussianModel stored = readModel(file).model;
  if (!written.order.empty()) {
    std::vector<std::uint32_t> place(written.order.size());
    for (std::size_t j = 0; j < place.size(); ++j) place[written.order[j]] = static_cast<std::uint32_t>(j);
    stored = select(stored, place);
  }
  renameAxesTowards(stored, model.rotation);
  if (!stored.atlas.rects.empty()) {
    parallelFor(static_cast<std::int64_t>(model.size()), 1024, [&](std::int64_t i) {
      if (stored.atlas.rects[i].texelCount() == 0) return;
      orderAxesForNormal(gltfAxisOrder(model.log_scale[i]).z, stored.log_scale[i], stored.rotation[i]);
    });
  }
  return stored;
}

WrittenScene writeScene(const std::string& path, Bundle scene, bool replace, const std::string& kept, bool quiet,
                        SceneSize size) {
  const Format& format = outputFormat(path);
  const std::vector<Camera> views = qualityViews(scene.model, scene.cameras);
  const std::vector<Camera> cameras = scene.cameras;
  const bool coarse = size.bytes > 0 || size.steps > 0;
  if (!format.holds(kKeepsCameras) || coarse) scene.cameras.clear();
  const auto whole = [&]() -> const Bundle& {
    scene.cameras = cameras;
    return scene;
  };
  WrittenScene written;
  const auto writeIt = [&] {
    try {
      written.steps = write(path, scene, replace, quiet, size);
    } catch (const Error& error) {
      std::error_code ignored;
      const bool came = !replace && std::filesystem::exists(path, ignored);
      if (came || !kept.empty()) throw;
      throw keepModel(path, whole(), error);
    }
  };
  writeAfterTraining(path, replace, writeIt, [&] { return kept.empty() ? writeSomewhere(path, whole()) : kept; });
  written.bytes = storedBytes(format, path);
  const bool rounded = !format.holds(kKeepsFloats) || coarse;
  if (rounded && isMeasuredUnasked(scene.model)) {
    written.psnr = renderedPsnr(scene.model, readModel(path).model, views, scene.background);
  }
  return written;
}

}  // namespace tg
