// SPDX-License-Identifier: Apache-2.0
// The container of a GLB.
#include "converter/gltf/container.h"

#include "converter/formats/little_endian.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::uint32_t kMagic = 0x46546C67, kChunkJson = 0x4E4F534A, kChunkBin = 0x004E4942;

}  // namespace

GltfParts splitGlb(std::span<const std::uint8_t> bytes, std::uint64_t file_bytes, const std::string& path) {
  const auto fail = [&](const std::string& what) { throw Error(ErrorKind::badData, path, "GLB: " + what); };
  if (bytes.size() < kGlbHeaderBytes + kChunkHeaderBytes) {
    fail("the file ends inside the header" +
         expectedFound("at least " + std::to_string(kGlbHeaderBytes + kChunkHeaderBytes) + " bytes",
                       std::to_string(bytes.size())));
  }
  if (readU32(bytes, 0) != kMagic) fail("the header does not start with glTF");
  if (const std::uint32_t version = readU32(bytes, 4); version != 2) {
    fail("another container version" + expectedFound("2", std::to_string(version)));
  }
  if (const std::uint32_t length = readU32(bytes, 8); length != file_bytes) {
    fail((length > file_bytes ? "the file is cut off" : "the length in the header is not the file's") +
         expectedFound(std::to_string(length) + " bytes", std::to_string(file_bytes)));
  }
  GltfParts parts;
  parts.binary = true;
  std::size_t at = kGlbHeaderBytes;
  for (int chunk = 0; at < file_bytes; ++chunk) {
    const std::string which = "chunk " + std::to_string(chunk);
    if (file_bytes - at < kChunkHeaderBytes) fail(which + " ends inside its header");
    const std::uint32_t length = readU32(bytes, at);
    const std::uint32_t type = readU32(bytes, at + 4);
    at += kChunkHeaderBytes;
    if (length % 4 != 0) fail(which + " has a bad length" + expectedFound("a multiple of 4", std::to_string(length)));
    if (length > file_bytes - at) {
      fail(which + " leaves the file" +
           expectedFound("at most " + std::to_string(file_bytes - at) + " bytes", std::to_string(length)));
    }
    if (chunk == 0 && type != kChunkJson) fail("the first chunk is not JSON");
    if (chunk == 0) parts.json = bytes.subspan(at, length);
    if (chunk == 1 && type == kChunkBin) {
      parts.bin_bytes = length;
      parts.bin_offset = at;
    }
    at += length;
  }
  return parts;
}

std::vector<std::uint8_t> glbHead(const std::string& json, std::uint64_t bin_bytes) {
  std::vector<std::uint8_t> head;
  const std::uint64_t head_bytes = kGlbHeaderBytes + 2 * kChunkHeaderBytes + json.size();
  for (const std::uint64_t word : {std::uint64_t{kMagic}, std::uint64_t{2}, head_bytes + bin_bytes,
                                   std::uint64_t{json.size()}, std::uint64_t{kChunkJson}}) {
    appendU32(head, word);
  }
  head.insert(head.end(), json.begin(), json.end());
  appendU32(head, bin_bytes);
  appendU32(head, kChunkBin);
  return head;
}

std::vector<std::uint8_t> glbOf(std::string json, std::span<const std::uint8_t> bin, const std::string& path) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  if (kGlbHeaderBytes + 2 * kChunkHeaderBytes + json.size() + bin.size() > kMaxGltfBytes) {
    throw Error(ErrorKind::badData, path, "the parts are too large (expected at most 4 GiB)");
  }
  std::vector<std::uint8_t> glb = glbHead(json, bin.size());
  glb.insert(glb.end(), bin.begin(), bin.end());
  return glb;
}

}  // namespace tg
