// SPDX-License-Identifier: Apache-2.0
// Writes .splat files.
#include "converter/formats/write_splat.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "converter/formats/read_splat.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "shared/limits.h"

namespace tg {
namespace {

std::uint8_t toByte(double value) { return static_cast<std::uint8_t>(std::clamp(std::floor(value + 0.5), 0.0, 255.0)); }

SplatFileRow rowOf(const GaussianModel& model, std::size_t i) {
  SplatFileRow row;
  const glm::vec3& dc = model.sh[i * model.shCount()];
  const glm::dvec4 q = glm::normalize(glm::dvec4(model.rotation[i]));
  for (int k = 0; k < 3; ++k) {
    row.position[k] = model.mean[i][k];
    row.scale[k] = std::exp(model.log_scale[i][k]);
    row.color[k] = toByte(255.0 * (0.5 + double{kShC0} * static_cast<double>(dc[k])));
  }
  row.color[3] = toByte(sigmoid(model.opacity_logit[i], 255.0));
  for (int k = 0; k < 4; ++k) row.rotation[k] = toByte(128.0 + 128.0 * q[k]);
  return row;
}

}  // namespace

std::vector<std::uint8_t> formatSplat(const GaussianModel& model, SplatReport& report) {
  std::vector<std::uint8_t> bytes(model.size() * kSplatBytes);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const SplatFileRow row = rowOf(model, i);
    std::memcpy(bytes.data() + i * kSplatBytes, &row, sizeof(row));
    const glm::vec3 color = 0.5f + kShC0 * model.sh[i * model.shCount()];
    const auto outside = [](float value) { return value < -0.5f / 255.0f || value > 255.5f / 255.0f; };
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
