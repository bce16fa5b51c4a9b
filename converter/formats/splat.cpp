// SPDX-License-Identifier: Apache-2.0
// .splat files in and out.
#include "converter/formats/splat.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "converter/formats/repair.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "shared/limits.h"

namespace tg {
namespace {

struct SplatFileRow {  // as stored, little endian
  float position[3];
  float scale[3];  // linear
  std::uint8_t color[4];
  std::uint8_t rotation[4];  // w, x, y, z; 128 is 0
};
constexpr std::size_t kSplatBytes = 32;
static_assert(sizeof(SplatFileRow) == kSplatBytes);

std::uint8_t toByte(double value) { return static_cast<std::uint8_t>(std::clamp(std::floor(value + 0.5), 0.0, 255.0)); }

SplatFileRow rowOf(const GaussianModel& model, std::size_t i) {
  SplatFileRow row;
  const glm::vec3& dc = model.sh[i * model.shCount()];
  const glm::dvec4 q = glm::normalize(glm::dvec4(model.rotation[i]));
  for (int k = 0; k < 3; ++k) {
    row.position[k] = model.mean[i][k];
    row.scale[k] = scaleFromLog(model.log_scale[i][k]);
    row.color[k] = toByte(255.0 * (0.5 + double{kShC0} * static_cast<double>(dc[k])));
  }
  row.color[3] = toByte(sigmoid(model.opacity_logit[i], 255.0));
  for (int k = 0; k < 4; ++k) row.rotation[k] = toByte(128.0 + 128.0 * q[k]);
  return row;
}

}  // namespace

Bundle parseSplat(std::span<const std::uint8_t> bytes, const std::string& path) {
  if (bytes.empty() || bytes.size() % kSplatBytes != 0) {
    throw Error(ErrorKind::badData, path,
                "is no .splat file (expected a multiple of " + std::to_string(kSplatBytes) + " bytes, found " +
                    std::to_string(bytes.size()) + ")");
  }
  const std::size_t count = bytes.size() / kSplatBytes;
  if (count > kMaxGaussians) {
    throw Error(ErrorKind::badData, path, "too many splats" + atMost(kMaxGaussians, count));
  }
  Bundle loaded;
  GaussianModel& model = loaded.model;
  resizeGaussians(model, count, 0);
  LinearRepair repair;
  std::size_t at = 0;
  for (std::size_t i = 0; i < count; ++i) {
    SplatFileRow record;
    std::memcpy(&record, bytes.data() + i * kSplatBytes, sizeof(record));
    LinearSplat splat;
    for (int k = 0; k < 3; ++k) {
      splat.mean[k] = record.position[k];
      splat.scale[k] = record.scale[k];
    }
    for (int k = 0; k < 4; ++k) splat.rotation[k] = (static_cast<float>(record.rotation[k]) - 128.0f) / 128.0f;
    if (!repair.mend(splat)) continue;
    glm::vec3 dc;
    for (int c = 0; c < 3; ++c) dc[c] = (static_cast<float>(record.color[c]) / 255.0f - 0.5f) / kShC0;
    model.mean[at] = splat.mean;
    model.rotation[at] = splat.rotation;
    model.log_scale[at] = logFromScale(splat.scale);
    model.opacity_logit[at] = logitFromOpacity(record.color[3] / 255.0);
    model.sh[at++] = dc;
  }
  resizeGaussians(model, at, 0);
  repair.report(loaded.repairs);
  if (model.size() == 0) throw Error(ErrorKind::badData, path, "no splat is left: none had finite values");
  return loaded;
}

Bundle readSplat(const std::filesystem::path& path) {
  return parseSplat(readFile(path, kMaxGaussians * kSplatBytes), path.string());
}

std::vector<std::uint8_t> formatSplat(const GaussianModel& model, SplatReport& report) {
  std::vector<std::uint8_t> bytes(model.size() * kSplatBytes);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const SplatFileRow row = rowOf(model, i);
    std::memcpy(bytes.data() + i * kSplatBytes, &row, sizeof(row));
    const glm::vec3 color = 0.5f + kShC0 * model.sh[i * model.shCount()];
    const auto outside = [](float value) { return value < -0.5f / 255.0f || value > 255.5f / 255.0f; };
    report.clipped_scales += clipsScale(model.log_scale[i]);
    report.clipped_colors += outside(color.x) || outside(color.y) || outside(color.z);
  }
  return bytes;
}

SplatReport writeSplat(const std::filesystem::path& path, const GaussianModel& model) {
  if (model.size() == 0) throw Error(ErrorKind::badData, path.string(), "the model has no Gaussians");
  SplatReport report;
  writeFileAtomically(path, formatSplat(model, report));
  return report;
}

}  // namespace tg
