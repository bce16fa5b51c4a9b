// SPDX-License-Identifier: Apache-2.0
// ZIP archives in memory.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace tg {

struct ZipEntry {
  std::string name;
  std::vector<std::uint8_t> bytes;
  bool deflate = false;  // when written, for what is not packed already
};

// An archive's entries by their names. `bytes` must outlive it; `path` starts the messages.
class ZipReader {
 public:
  ZipReader(std::span<const std::uint8_t> bytes, std::string path) : bytes_(bytes), path_(std::move(path)) {}

  // Throws Error(badData): no such entry, a broken archive, an encrypted entry, more than `most` bytes, or more than
  // 1000 times what it takes in the archive after the first MiB.
  std::vector<std::uint8_t> read(const std::string& name, std::uint64_t most) const;

 private:
  std::span<const std::uint8_t> bytes_;
  std::string path_;
};

// Same entries in, same bytes out, as long as zlib stays the same.
void writeZip(const std::filesystem::path& file, std::span<const ZipEntry> entries,
              const std::filesystem::path& reported);

}  // namespace tg
