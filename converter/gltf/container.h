// SPDX-License-Identifier: Apache-2.0
// The container of a GLB: a header, JSON, and a binary part.
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace tg {

// The parts of a GLB container, or the whole file as `json`.
struct GltfParts {
  std::span<const std::uint8_t> json;
  std::optional<std::uint64_t> bin_bytes;  // length of the BIN chunk, which comes second where there is one
  std::uint64_t bin_offset = 0;            // of its content in the file
  bool binary = false;
};

inline constexpr std::uint64_t kMaxGltfBytes = 0xFFFFFFFF;  // what a GLB header can say
inline constexpr std::size_t kGlbHeaderBytes = 12, kChunkHeaderBytes = 8;

// Of a file of `file_bytes`, of which `bytes` reach to the content of the last chunk or further. Throws Error(badData):
// magic, version, length, chunk lengths, a first chunk that is not JSON. Chunks of other types are passed over.
GltfParts splitGlb(std::span<const std::uint8_t> bytes, std::uint64_t file_bytes, const std::string& path);

// What precedes the content of the BIN chunk in a GLB: headers, and the JSON in between. Both lengths are multiples of
// 4; that of the whole file fits into 32 bits.
std::vector<std::uint8_t> glbHead(const std::string& json, std::uint64_t bin_bytes);

// A whole GLB; `json` is padded, `bin` has a multiple of 4 bytes. Throws Error(badData) beyond 4 GiB.
std::vector<std::uint8_t> glbOf(std::string json, std::span<const std::uint8_t> bin, const std::string& path);

}  // namespace tg
