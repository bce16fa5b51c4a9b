// SPDX-License-Identifier: Apache-2.0
// ustar headers field by field.
#include "tar_file.h"

#include <zlib.h>

#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "core/file/file.h"

namespace tg {
namespace {

std::string field(const std::uint8_t* header, std::size_t offset, std::size_t size) {
  const char* text = reinterpret_cast<const char*>(header + offset);
  return {text, strnlen(text, size)};
}

}  // namespace

std::vector<TarEntry> readTar(const std::filesystem::path& tgz) {
  const std::vector<std::uint8_t> packed = readFile(tgz, 1 << 26);
  std::vector<std::uint8_t> tar;
  z_stream stream{};
  inflateInit2(&stream, 31);
  stream.next_in = const_cast<std::uint8_t*>(packed.data());
  stream.avail_in = static_cast<uInt>(packed.size());
  for (int status = Z_OK; status == Z_OK;) {
    std::uint8_t buffer[65536];
    stream.next_out = buffer;
    stream.avail_out = sizeof(buffer);
    status = inflate(&stream, Z_NO_FLUSH);
    tar.insert(tar.end(), buffer, buffer + sizeof(buffer) - stream.avail_out);
  }
  inflateEnd(&stream);

  std::vector<TarEntry> entries;
  for (std::size_t at = 0; at + 512 <= tar.size() && tar[at] != 0;) {
    const std::uint8_t* header = tar.data() + at;
    TarEntry entry;
    entry.name = field(header, 0, 100);
    entry.type = static_cast<char>(header[156]);
    entry.mode = static_cast<unsigned>(std::stoul(field(header, 100, 8), nullptr, 8));
    entry.uid = static_cast<unsigned>(std::stoul(field(header, 108, 8), nullptr, 8));
    entry.mtime = std::stoull(field(header, 136, 12), nullptr, 8);
    const std::size_t size = std::stoull(field(header, 124, 12), nullptr, 8);
    at += 512;
    if (at + size > tar.size()) throw std::runtime_error("cut tar");
    entry.bytes.assign(tar.begin() + static_cast<std::ptrdiff_t>(at),
                       tar.begin() + static_cast<std::ptrdiff_t>(at + size));
    at += (size + 511) / 512 * 512;
    entries.push_back(std::move(entry));
  }
  return entries;
}

std::vector<std::uint8_t> formatTar(const std::vector<TarEntry>& entries) {
  std::vector<std::uint8_t> tar;
  for (const TarEntry& entry : entries) {
    char header[512] = {};
    std::memcpy(header, entry.name.data(), std::min<std::size_t>(entry.name.size(), 100));
    std::snprintf(header + 100, 8, "%07o", entry.mode);
    std::snprintf(header + 108, 8, "%07o", entry.uid);
    std::snprintf(header + 116, 8, "%07o", 0u);
    std::snprintf(header + 124, 12, "%011zo", entry.bytes.size());
    if (!entry.raw_size.empty()) std::memcpy(header + 124, entry.raw_size.data(), 12);
    std::snprintf(header + 136, 12, "%011llo", static_cast<unsigned long long>(entry.mtime));
    header[156] = entry.type;
    std::memcpy(header + 157, entry.link.data(), std::min<std::size_t>(entry.link.size(), 100));
    std::memcpy(header + 257, entry.magic.data(), 8);
    std::memcpy(header + 386, entry.sparse_map.data(), std::min<std::size_t>(entry.sparse_map.size(), 96));
    std::memcpy(header + 483, entry.real_size.data(), std::min<std::size_t>(entry.real_size.size(), 12));
    std::memset(header + 148, ' ', 8);
    unsigned sum = entry.bad_checksum ? 1 : 0;
    for (char c : header) sum += static_cast<unsigned char>(c);
    std::snprintf(header + 148, 8, "%06o", sum);
    tar.insert(tar.end(), header, header + 512);
    tar.insert(tar.end(), entry.bytes.begin(), entry.bytes.end());
    tar.resize((tar.size() + 511) / 512 * 512);
  }
  tar.resize(tar.size() + 1024);
  return tar;
}

std::vector<std::uint8_t> gzip(const std::vector<std::uint8_t>& bytes, int level) {
  z_stream stream{};
  deflateInit2(&stream, level, Z_DEFLATED, 31, 8, Z_DEFAULT_STRATEGY);
  std::vector<std::uint8_t> packed(deflateBound(&stream, bytes.size()) + 64);
  stream.next_in = const_cast<std::uint8_t*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = packed.data();
  stream.avail_out = static_cast<uInt>(packed.size());
  deflate(&stream, Z_FINISH);
  packed.resize(packed.size() - stream.avail_out);
  deflateEnd(&stream);
  return packed;
}

}  // namespace tg
