// SPDX-License-Identifier: Apache-2.0
// What a COLMAP model says of itself, for whoever had it made.
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace tg {

struct ColmapSummary {
  std::vector<std::string> images;  // that have a pose
  std::size_t points = 0;
  double error = 0;  // mean over the points of their mean reprojection errors [px]
};
// Of a folder with cameras.bin, images.bin and points3D.bin, all read to their ends. Throws Error(cannotRead /
// badData).
ColmapSummary summarizeColmap(const std::filesystem::path& model);

}  // namespace tg
