// SPDX-License-Identifier: Apache-2.0
// What the reader and the writer of lod-meta.json agree on. Private to converter/lod.
#pragma once
#include <filesystem>
#include <glm/glm.hpp>
#include <string>

namespace tg::lod {

constexpr const char* kOwn = "TG_levels_of_detail";  // key of what only our files say
constexpr const char* kMeans = "TG_means";           // of a leaf
constexpr int kVersion = 1;                          // of these
constexpr int kFormatVersion = 1;                    // of lod-meta.json
constexpr double kFarthest = 1e30;                   // [world units] that a box reaches, where Gaussians have no end

inline glm::vec3 reached(const glm::vec3& place) {
  const glm::vec3 most(static_cast<float>(kFarthest));
  return glm::clamp(place, -most, most);
}

// `relative` beside lod-meta.json, as messages name it.
inline std::string besideMeta(const std::string& meta, const std::string& relative) {
  return (std::filesystem::path(meta).parent_path() / relative).string();
}

inline std::string quoted(const std::string& text) { return "\"" + text + "\""; }

}  // namespace tg::lod
