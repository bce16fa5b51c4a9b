// SPDX-License-Identifier: Apache-2.0
// INRIA's splat PLY (gaussians.ply of the bundle, and the format every splat viewer opens), and plain point clouds.
#pragma once
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/model/model.h"

namespace tg {

struct ReadProgress;

constexpr std::uint64_t kMaxGaussians = 64'000'000;
constexpr std::uint64_t kMaxPlyBytes = kMaxGaussians * 62 * 8;  // of a file of splats

// Reads by property name, so extra properties and any order are fine; ASCII, binary little and big endian; SH degree
// 0-3 from the number of f_rest_*; Mip-Splatting's filter_3D is applied. Throws Error(cannotRead / badData): missing
// property, count and size that disagree with the file's length, non-finite values (with Gaussian index and property).
// Bytes behind binary rows are passed over (SplatRows::trailing). The result has no textures and has passed checkModel,
// unless `broken` is given: it says then whether a value is not finite or a quaternion has no length. `progress` may be
// null; throws ReadCancelled when it says so.
GaussianModel readSplatPly(const std::filesystem::path& path, ReadProgress* progress = nullptr, bool* broken = nullptr);
GaussianModel parseSplatPly(std::span<const std::uint8_t> bytes, const std::string& path, bool* broken = nullptr);

// Strict INRIA layout, binary little endian: x y z nx ny nz f_dc_0..2 f_rest_* opacity scale_0..2 rot_0..3 as float32;
// 62 properties at degree 3. Log scale, logit opacity, quaternion wxyz.
std::vector<std::uint8_t> formatSplatPly(const GaussianModel& model);
void writeSplatPly(const std::filesystem::path& path, const GaussianModel& model);

struct PointCloud {
  std::vector<glm::vec3> position;
  std::vector<glm::vec3> color;  // [0,1]; grey 0.5 where the file has none
};
// x y z and, when present, red green blue (uchar or float). Positions are from `origin`, of which doubles keep all.
// Throws Error(cannotRead / badData), also for what is no regular file.
PointCloud readPointCloudPly(const std::filesystem::path& path, const glm::dvec3& origin = glm::dvec3(0.0));

}  // namespace tg
