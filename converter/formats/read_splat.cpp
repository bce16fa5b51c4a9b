// SPDX-License-Identifier: Apache-2.0
// Reads .splat files.
#include "converter/formats/read_splat.h"

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

bool isFinite(const SplatFileRow& record) {
  for (int k = 0; k < 3; ++k) {
    if (!std::isfinite(record.position[k]) || !std::isfinite(record.scale[k])) return false;
  }
  return true;
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
    throw Error(ErrorKind::badData, path,
                "too many splats (expected at most " + std::to_string(kMaxGaussians) + ", found " +
                    std::to_string(count) + ")");
  }
  Bundle loaded;
  GaussianModel& model = loaded.model;
  resizeGaussians(model, count, 0);
  std::size_t at = 0, dropped = 0, negative = 0, directionless = 0;
  for (std::size_t i = 0; i < count; ++i) {
    SplatFileRow record;
    std::memcpy(&record, bytes.data() + i * kSplatBytes, sizeof(record));
    if (!isFinite(record)) {
      ++dropped;
      continue;
    }
    glm::vec3 scale(record.scale[0], record.scale[1], record.scale[2]);
    if (scale.x < 0.0f || scale.y < 0.0f || scale.z < 0.0f) ++negative;
    scale = glm::abs(scale);
    glm::vec4 q;
    for (int k = 0; k < 4; ++k) q[k] = (static_cast<float>(record.rotation[k]) - 128.0f) / 128.0f;
    if (q == glm::vec4(0.0f)) {
      ++directionless;
      q.x = 1.0f;
    }
    glm::vec3 dc;
    for (int c = 0; c < 3; ++c) dc[c] = (static_cast<float>(record.color[c]) / 255.0f - 0.5f) / kShC0;
    model.mean[at] = {record.position[0], record.position[1], record.position[2]};
    model.rotation[at] = q;
    model.log_scale[at] = logFromScale(scale);
    model.opacity_logit[at] = logitFromOpacity(record.color[3] / 255.0);
    model.sh[at++] = dc;
  }
  resizeGaussians(model, at, 0);
  warnRepair(loaded.warnings, dropped, "with values that are not finite: dropped");
  warnRepair(loaded.warnings, negative, "with a negative scale: sign dropped");
  warnRepair(loaded.warnings, directionless, "with a quaternion of length 0: not turned");
  if (model.size() == 0) throw Error(ErrorKind::badData, path, "no splat is left: none had finite values");
  return loaded;
}

Bundle readSplat(const std::filesystem::path& path) {
  return parseSplat(readFile(path, kMaxGaussians * kSplatBytes), path.string());
}

}  // namespace tg
