// SPDX-License-Identifier: Apache-2.0
// Reads glTF and GLB files with KHR_gaussian_splatting, with or without our texture extension (docs/gltf.md).
#pragma once
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <span>
#include <string>
#include <vector>

#include "converter/formats/read_options.h"
#include "core/bundle/bundle.h"

namespace tg {

// All splat primitives of the scene as one model in the toolchain's axes. `world_from_scene`: where the scene stands,
// in glTF's axes; decompose() of nodes.h must take it. Throws Error(cannotRead / badData); a broken texture layer is an
// error, never a silent fall back to the base.
Bundle readGltf(const std::filesystem::path& path, const ReadOptions& options = {},
                const glm::dmat4& world_from_scene = glm::dmat4(1.0));
// The same from memory; `path` starts the messages.
Bundle parseGltf(std::span<const std::uint8_t> bytes, const std::string& path, const ReadOptions& options = {});

// What is wrong with a file as its base and with its textures, and what reading it gets by: alignment, extensionsUsed,
// extensionsRequired, glTF's own rules. Adds "JSON pointer: what"; the number of Gaussians, 0 where none can be read.
// Throws Error where the structure (container, JSON, references, sizes) is broken.
std::size_t checkGltf(const std::filesystem::path& path, std::vector<std::string>& errors,
                      std::vector<std::string>& warnings);

}  // namespace tg
