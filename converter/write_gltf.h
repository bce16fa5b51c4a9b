// SPDX-License-Identifier: Apache-2.0
// Writes a model as GLB: KHR_gaussian_splatting for everybody, our texture extension inside it (docs/gltf.md).
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>

#include "core/camera.h"
#include "core/model.h"

namespace tg {

struct GltfContent {
  const GaussianModel& model;  // the toolchain's axes
  std::span<const Camera> cameras;
  glm::vec3 background{0.0f};
  bool lean = false;  // without the source numbers of converter/gltf_numbers.h
};

struct GltfReport {
  std::uint64_t bytes = 0;
  int atlases = 0;
  int atlas_width = 0;  // [texels]
  int atlas_height = 0;
  std::uint64_t texels = 0;          // in rectangles
  std::uint64_t clipped_texels = 0;  // with a channel outside what the atlas's scale and offset can say
};

// Same model in, same bytes out. Atomic. Throws Error(badData) for a model beyond GLB's 4 GiB or the atlas's limits,
// Error(cannotWrite).
GltfReport writeGlb(const std::filesystem::path& path, const GltfContent& content);

}  // namespace tg
