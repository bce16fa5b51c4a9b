// SPDX-License-Identifier: Apache-2.0
// Makes one GLB of a glTF file that stands in several files or whose attributes are packed with meshopt.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "converter/gltf/document_check.h"

namespace tg {

// Whether a document has external files or packed views.
bool needsResolving(const nlohmann::json& root);

// The same document as a GLB without external files and packed views; nothing when it has neither. `folder`: of the
// file; without one, external files are refused. Names of files are relative, without "..", scheme and leading slash.
// Nothing is allocated that the sizes of files and streams do not justify. Throws Error(badData) with a JSON pointer.
std::optional<std::vector<std::uint8_t>> resolveGltf(std::span<const std::uint8_t> bytes, const GltfParts& parts,
                                                     const std::optional<std::filesystem::path>& folder,
                                                     const std::string& path);

}  // namespace tg
