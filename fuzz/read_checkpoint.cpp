// SPDX-License-Identifier: Apache-2.0
// Any bytes are a checkpoint or an Error; what was read survives being written. Checksums are made right first, so that
// what lies behind them is reached.
#include <zlib.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "core/file/file.h"
#include "core/file/scratch_folder.h"
#include "core/system/error.h"
#include "training/run/checkpoint.h"

namespace {

std::vector<std::uint8_t> withChecksums(const std::uint8_t* data, std::size_t size) {
  std::vector<std::uint8_t> bytes(data, data + size);
  for (std::size_t at = 12; at + 2 < size;) {
    std::uint16_t name_size = 0;
    std::memcpy(&name_size, &bytes[at], sizeof name_size);
    const std::size_t length_at = at + 2 + name_size;
    if (length_at + 8 > size) break;
    std::uint64_t length = 0;
    std::memcpy(&length, &bytes[length_at], sizeof length);
    const std::size_t content_at = length_at + 8;
    if (length > size - content_at || size - content_at - length < 4) break;
    const std::size_t end = content_at + length;
    const auto crc = static_cast<std::uint32_t>(crc32_z(0, &bytes[at], end - at));
    std::memcpy(&bytes[end], &crc, sizeof crc);
    at = end + 4;
  }
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const std::vector<std::uint8_t> bytes = withChecksums(data, size);
    const tg::Checkpoint checkpoint = tg::parseCheckpoint(bytes, "fuzz");
    static const tg::ScratchFolder folder;
    const std::filesystem::path file = folder.path() / "checkpoint";
    tg::writeCheckpoint(file, checkpoint.header, checkpoint.state);
    if (tg::readFile(file, size) != bytes) std::abort();
  } catch (const tg::Error&) {
  }
  return 0;
}
