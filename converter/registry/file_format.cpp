// SPDX-License-Identifier: Apache-2.0
// Tells splat files apart by their first bytes.
#include "converter/registry/file_format.h"

#include <zlib.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string_view>

#include "converter/html/html_page.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::size_t kSniffBytes = 4096;  // holds the header of every compressed PLY
constexpr std::string_view kSupported = "tgz, ply, compressed ply, splat, spz, glb, gltf and our html are";

std::string readStart(const std::filesystem::path& path) {
  std::error_code status;
  if (!std::filesystem::exists(path, status)) throw Error(ErrorKind::cannotRead, path.string(), "no such file");
  if (std::filesystem::is_directory(path, status)) {
    throw Error(ErrorKind::cannotRead, path.string(), "is a folder (expected a file)");
  }
  if (!std::filesystem::is_regular_file(path, status)) {
    throw Error(ErrorKind::cannotRead, path.string(), "is no regular file");  // a pipe would block
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(ErrorKind::cannotRead, path.string(), "cannot be opened");
  std::string start(kSniffBytes, '\0');
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  if (file.bad()) throw Error(ErrorKind::cannotRead, path.string(), "cannot be read");
  start.resize(static_cast<std::size_t>(file.gcount()));
  return start;
}

// The first four bytes inside a gzip stream, or fewer when it is broken.
std::string peekInsideGzip(std::string start) {
  z_stream stream{};
  if (inflateInit2(&stream, 15 + 16) != Z_OK) return {};
  std::array<char, 4> out{};
  stream.next_in = reinterpret_cast<Bytef*>(start.data());
  stream.avail_in = static_cast<uInt>(start.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  inflate(&stream, Z_SYNC_FLUSH);
  const std::size_t got = out.size() - stream.avail_out;
  inflateEnd(&stream);
  return std::string(out.data(), got);
}

[[noreturn]] void refuse(const std::filesystem::path& path, std::string_view what) {
  throw Error(ErrorKind::badData, path.string(),
              std::string(what) + " is not supported yet (" + std::string(kSupported) + ")");
}

}  // namespace

std::string_view name(FileFormat format) {
  switch (format) {
    case FileFormat::bundle:
      return "tgz";
    case FileFormat::ply:
      return "ply";
    case FileFormat::compressedPly:
      return "compressed.ply";
    case FileFormat::splat:
      return "splat";
    case FileFormat::spz:
      return "spz";
    case FileFormat::glb:
      return "glb";
    case FileFormat::gltf:
      return "gltf";
    case FileFormat::html:
      return "html";
  }
  return "";
}

FileFormat detectFormat(const std::filesystem::path& path) {
  const std::string start = readStart(path);
  const auto begins = [&](std::string_view magic) { return start.compare(0, magic.size(), magic) == 0; };
  if (start.empty()) throw Error(ErrorKind::badData, path.string(), "the file is empty");
  if (begins("\x1f\x8b")) {
    return peekInsideGzip(start) == "NGSP" ? FileFormat::spz : FileFormat::bundle;
  }
  if (begins("ply\n") || begins("ply\r")) {
    return start.find("packed_position") != std::string::npos ? FileFormat::compressedPly : FileFormat::ply;
  }
  if (begins("glTF")) return FileFormat::glb;
  if (begins("NGSP")) return FileFormat::spz;
  if (begins(kHtmlStart)) return FileFormat::html;
  const std::size_t first = start.find_first_not_of(" \t\r\n", begins("\xef\xbb\xbf") ? 3 : 0);
  if (first != std::string::npos && start[first] == '{') return FileFormat::gltf;
  if (path.extension() == ".splat") return FileFormat::splat;
  // These have no magic number, or share a container's.
  if (path.extension() == ".ksplat") refuse(path, "the .ksplat format");
  if (path.extension() == ".sog") refuse(path, "the SOG format");
  throw Error(ErrorKind::badData, path.string(),
              "is no splat model (expected a tgz, ply, splat, spz, glb, gltf or our html file)");
}

}  // namespace tg
