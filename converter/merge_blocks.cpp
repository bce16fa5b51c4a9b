// SPDX-License-Identifier: Apache-2.0
// Crop, then join.
#include "converter/merge_blocks.h"

#include <algorithm>
#include <cstdint>
#include <set>
#include <tuple>
#include <utility>

#include "converter/edit/merge.h"
#include "converter/edit/select.h"
#include "converter/registry/file_format.h"
#include "core/bundle/blocks.h"
#include "core/bundle/training_json.h"
#include "core/file/atomic_files.h"
#include "core/file/file.h"
#include "core/system/error.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

fs::path modelOf(const fs::path& models, const std::string& name) {
  const fs::path inside = models / name / "model.tgz", beside = models / (name + ".tgz");
  if (isFile(inside)) return inside;
  if (isFile(beside)) return beside;
  throw Error(ErrorKind::cannotRead, inside.string(), "the block's model is not there, nor is " + beside.string());
}

// The block in whose cell most of a model lies, by some thousand of its Gaussians.
std::size_t mostlyIn(const std::vector<SceneBlock>& scene, std::size_t own, const GaussianModel& model) {
  constexpr std::size_t kLooks = 4096;
  std::vector<std::size_t> counts(scene.size());
  for (std::size_t k = 0; k < model.size(); k += model.size() / kLooks + 1) {
    const glm::dvec3 mean(model.mean[k]);
    const auto at = std::ranges::find_if(scene, [&](const SceneBlock& block) { return block.cell.contains(mean); });
    if (at != scene.end()) ++counts[static_cast<std::size_t>(at - scene.begin())];
  }
  const auto most = std::ranges::max_element(counts);
  return *most > counts[own] ? static_cast<std::size_t>(most - counts.begin()) : own;
}

}  // namespace

MergeReport mergeBlocks(const fs::path& blocks, const fs::path& models, const fs::path& output, bool overwrite) {
  const Format& format = modelFormat(output);
  std::error_code ignored;
  if (!overwrite && fs::exists(output, ignored)) {
    throw Error(ErrorKind::cannotWrite, output.string(), "exists already (--overwrite replaces it)");
  }
  requireWritable(format, output);
  const std::vector<SceneBlock> scene = readBlocks(blocks);
  std::vector<fs::path> files;
  for (const SceneBlock& block : scene) files.push_back(modelOf(models, block.name));  // before any is read

  MergeReport report;
  Bundle merged;
  merged.knows_background = false;
  std::set<std::tuple<std::string, bool, double, double, double>> cameras;  // by name and place
  for (std::size_t i = 0; i < scene.size(); ++i) {
    const std::string path = files[i].string();
    Bundle bundle = readModel(files[i]);
    for (const std::string& warning : bundle.warnings) report.warnings.push_back(path + ": " + warning);
    if (wasInterrupted(bundle.training_json)) report.warnings.push_back(path + ": " + kInterruptedTraining);
    if (bundle.knows_background) {
      if (merged.knows_background && bundle.background != merged.background) {
        throw Error(ErrorKind::badData, path, "has another background than the blocks before it");
      }
      merged.background = bundle.background;
      merged.knows_background = true;
    }
    for (Camera& camera : bundle.cameras) {
      const glm::dvec3 at = camera.position();
      if (cameras.emplace(camera.name, camera.test, at.x, at.y, at.z).second)
        merged.cameras.push_back(std::move(camera));
    }
    GaussianModel& model = bundle.model;
    if (const std::size_t other = mostlyIn(scene, i, model); other != i) {
      report.warnings.push_back(path + ": more of it lies in the cell of " + scene[other].name + " than in that of " +
                                scene[i].name + " (is it the model of another block or scene?)");
    }
    std::vector<std::uint8_t> inside(model.size());
    std::ranges::transform(model.mean, inside.begin(),
                           [&](const glm::vec3& mean) { return scene[i].cell.contains(glm::dvec3(mean)); });
    report.blocks.push_back({scene[i].name, model.size(), 0});
    keepGaussians(model, inside);
    report.blocks.back().kept = model.size();
    if (model.size() == 0) continue;
    if (merged.model.size() == 0) {
      merged.model = std::move(model);
    } else {
      mergeModel(merged.model, model, path);
    }
  }
  report.gaussians = merged.model.size();
  if (report.gaussians == 0) throw Error(ErrorKind::badData, blocks.string(), "no Gaussian lies in its block's cell");
  Written written;
  const KeepExisting no_other_run(!overwrite);
  writeModel(format, output, merged, {}, written);
  report.warnings.insert(report.warnings.end(), written.warnings.begin(), written.warnings.end());
  return report;
}

}  // namespace tg
