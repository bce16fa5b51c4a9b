// SPDX-License-Identifier: Apache-2.0
// Checks a glTF file's JSON before a library that trusts its numbers gets it.
#pragma once
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "converter/gltf/container.h"

namespace tg {

struct GltfJson;

inline constexpr std::size_t kMaxJsonBytes = std::size_t{256} << 20;

// Of "MAJOR.MINOR"; none of another text.
std::optional<std::pair<std::uint32_t, std::uint32_t>> versionOf(std::string_view text);

// Whether an extension is read, or says nothing of splats, nor of where they and their textures lie.
bool isKnownExtension(std::string_view name);

// Of glTF's names for types; 0 for others.
int componentBytes(std::uint64_t component_type);
int componentCount(std::string_view type);

// How many bytes a base64 data URI holds; 0 for another text.
std::uint64_t dataUriBytes(std::string_view uri);

// Whole numbers outside of extras, bounds, transforms and weights come as integers, as glTF 2.0 has it of those that
// are written 0.0 or 1e2. Throws Error(badData) on syntax, on nesting deeper than 64 and on text that is too long.
GltfJson parseGltfJson(std::span<const std::uint8_t> text, const std::string& path);

// Throws Error(badData) with a JSON pointer for: a version that is not 2 or a minVersion above 2.0, a required
// extension that this reader lacks, references that name nothing, views and accessors that leave their buffer (64-bit
// sums), external files, numbers that 32-bit readers would cut short.
void checkGltfJson(const nlohmann::json& root, const GltfParts& parts, const std::string& path);

}  // namespace tg
