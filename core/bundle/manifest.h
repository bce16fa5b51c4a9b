// SPDX-License-Identifier: Apache-2.0
// manifest.json, the first entry of a bundle, and the names and bounds of the others. Private to core.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"
#include "core/model/model.h"

namespace tg {

// The names a reader knows; all others are skipped with a warning.
inline constexpr const char* kManifestName = "manifest.json";
inline constexpr const char* kGaussiansName = "gaussians.ply";
inline constexpr const char* kRectsName = "rects.npy";
inline constexpr const char* kAtlasIdName = "atlas_id.npy";
inline constexpr const char* kCamerasName = "cameras.json";
inline constexpr const char* kTrainingName = "training.json";
inline constexpr const char* kPreviewName = "preview.png";
std::string atlasPageName(int page);                          // "atlas_000.exr"
std::optional<int> atlasPageNumber(const std::string& name);  // 0..254

inline constexpr std::uint64_t kMaxManifestBytes = 1 << 20;
inline constexpr std::uint64_t kMaxTrainingBytes = 16 << 20;
inline constexpr std::uint64_t kMaxPreviewBytes = 4 << 20;
inline constexpr int kMaxPreviewSide = 512;
inline constexpr int kMaxAtlasPageSide = 4096;

struct ManifestFile {
  std::string name;
  std::uint64_t bytes = 0;
  std::string sha256;
};

struct Manifest {
  std::uint64_t gaussians = 0;
  std::uint64_t cameras = 0;
  int sh_degree = 0;
  TextureMode mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  TextureOutside outside = TextureOutside::base;
  glm::vec3 background{0.0f};
  int atlas_pages = 0;
  int atlas_width = 0;  // 0 when there are no pages
  int atlas_height = 0;
  std::vector<ManifestFile> files;

  const ManifestFile* find(const std::string& name) const;
};

std::string formatManifest(const Manifest& manifest);
// Throws Error(badData): another format or major version, a value this program cannot honour, impossible counts.
Manifest parseManifest(const std::string& json, const std::string& path);

}  // namespace tg
