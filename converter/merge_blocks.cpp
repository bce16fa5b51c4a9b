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

// The block whose cell and padding hold more of a model than those of `own`, if the latter lack a tenth of it, by some
// thousand of its Gaussians. Where neighbours are narrow their paddings hold much the same, and either may be right.
std::size_t mostlyOf(const std::vector<SceneBlock>& scene, std::size_t own, const GaussianModel& model) {
  constexpr std::size_t kLooks = 4096;
  std::vector<std::size_t> counts(scene.size());
  std::size_t looks = 0;
  for (std::size_t k = 0; k < model.size(); k += model.size() / kLooks + 1, ++looks) {
    const glm::dvec3 mean(model.mean[k]);
    for (std::size_t i = 0; i < scene.size(); ++i) counts[i] += scene[i].cell.padded(scene[i].padding).contains(mean);
  }
  const auto most = std::ranges::max_element(counts);
  const bool apart = 10 * counts[own] < 9 * looks && *most > counts[own];
  return apart ? static_cast<std::size_t>(most - counts.begin()) : own;
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
    if (const std::size_t other = mostlyOf(scene, i, model); other != i) {
      report.warnings.push_back(path + ": lies outside of " + scene[i].name +
                                " and its padding, more of it in those of " + scene[other].name +
                                " (is it the model of another block or scene?)");
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
