// SPDX-License-Identifier: Apache-2.0
// Checks a glTF file's JSON before a library that trusts its numbers gets it.
#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>

namespace tg {

// The parts of a GLB container, or the whole file as `json`.
struct GltfParts {
  std::span<const std::uint8_t> json;
  std::optional<std::uint64_t> bin_bytes;  // length of the BIN chunk
  std::uint64_t bin_offset = 0;            // of its content in the file
  bool binary = false;
};

inline constexpr std::size_t kGlbHeaderBytes = 12, kChunkHeaderBytes = 8;
inline constexpr std::size_t kMaxJsonBytes = std::size_t{256} << 20;

// Of a file of `file_bytes`, of which `bytes` reach to the content of the last chunk or further. Throws Error(badData):
// magic, version, length, chunk lengths and types.
GltfParts splitGlb(std::span<const std::uint8_t> bytes, std::uint64_t file_bytes, const std::string& path);

// Throws Error(badData) on syntax, on nesting deeper than 64 and on text that is too long.
nlohmann::json parseGltfJson(std::span<const std::uint8_t> text, const std::string& path);

// Throws Error(badData) with a JSON pointer for: another major version, a required extension that this reader lacks,
// references that name nothing, views and accessors that leave their buffer (64-bit sums), external files, numbers
// that 32-bit readers would cut short.
void checkGltfJson(const nlohmann::json& root, const GltfParts& parts, const std::string& path);

}  // namespace tg
