// SPDX-License-Identifier: Apache-2.0
// Makes one GLB of a glTF file that stands in several files or whose attributes are packed with meshopt.
#pragma once
#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "converter/gltf/container.h"

namespace tg {

// The extension of meshopt that an object of the JSON has, or null.
const char* codecOf(const nlohmann::json& object);

// Whether a document has external files or packed views.
bool needsResolving(const nlohmann::json& root);

// The name of a file beside the document that a URI says; none where it is no relative path, or one with "..".
std::optional<std::string> nameBeside(std::string_view uri);

// Makes a GLB without external files and packed views of the document `root`, which is the GLB's JSON afterwards;
// nothing when it has neither. `folder`: of the file; without one, external files are refused. Names of files are
// relative, without "..", scheme and leading slash. Nothing is allocated that the sizes of files and streams do not
// justify. `splats_alone`: packed views that neither splats nor their textures need are full of zeros. Throws
// Error(badData) with a JSON pointer.
std::optional<std::vector<std::uint8_t>> resolveGltf(nlohmann::json& root, std::span<const std::uint8_t> bytes,
                                                     const GltfParts& parts,
                                                     const std::optional<std::filesystem::path>& folder,
                                                     const std::string& path, bool splats_alone);

}  // namespace tg
