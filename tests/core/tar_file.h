// SPDX-License-Identifier: Apache-2.0
// tar and gzip by hand, so that tests can write what no decent program would.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tg {

struct TarEntry {
  std::string name;
  std::vector<std::uint8_t> bytes;
  char type = '0';
  std::string link;  // target, for types 1 and 2
  unsigned mode = 0644;
  unsigned uid = 0;
  std::uint64_t mtime = 0;
  std::string raw_size;  // of the header's 12 bytes, instead of bytes.size()
  std::string magic = std::string("ustar\00000", 8);
  std::string sparse_map;  // of the header from byte 386, for type S
  std::string real_size;   // from byte 483, for type S
  bool bad_checksum = false;
};

std::vector<TarEntry> readTar(const std::filesystem::path& tgz);
std::vector<std::uint8_t> formatTar(const std::vector<TarEntry>& entries);
std::vector<std::uint8_t> gzip(const std::vector<std::uint8_t>& bytes, int level = 6);

}  // namespace tg
