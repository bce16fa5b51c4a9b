// SPDX-License-Identifier: Apache-2.0
// The starts of files.
#include "converter/registry/file_start.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <fstream>
#include <system_error>
#include <vector>

#include "converter/formats/inflate.h"
#include "core/bundle/ply_vertices.h"
#include "core/file/file.h"
#include "core/file/web_address.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::size_t kStartBytes = 1 << 16;
constexpr std::size_t kMostJsonBytes = std::size_t{256} << 20;  // as many as a glTF may have
constexpr std::size_t kLongestKey = 32;                         // the others decide nothing
// Each of them is a glTF's alone, as "scene", "scenes" and "nodes" are not.
constexpr std::array<std::string_view, 4> kGltfKeys = {"accessors", "bufferViews", "buffers", "meshes"};
// Any two of them are a SOG's, whatever it lacks, if no other format has a key of its own there.
constexpr std::array<std::string_view, 4> kSogKeys = {"means", "scales", "quats", "sh0"};

// The first four bytes inside a gzip stream, or none when it is broken.
std::string peekInsideGzip(const std::string& start) {
  try {
    const std::vector<std::uint8_t> first =
        GzipBytes({reinterpret_cast<const std::uint8_t*>(start.data()), start.size()}, {}).take(4, {});
    return {first.begin(), first.end()};
  } catch (const Error&) {
    return {};
  }
}

bool isJson(const FileStart& start) {
  const std::size_t first = start.bytes.find_first_not_of(" \t\r\n", start.begins("\xef\xbb\xbf") ? 3 : 0);
  if (first == std::string::npos || start.bytes[first] != '{') return false;
  // Numbers may begin with these bytes, too, but a text has no control characters (RFC 8259, section 7).
  const auto is_control = [](char c) { return c >= 0 && c < ' ' && c != '\t' && c != '\r' && c != '\n'; };
  if (std::ranges::any_of(start.bytes, is_control)) return false;
  const std::size_t second = start.bytes.find_first_not_of(" \t\r\n", first + 1);
  return second != std::string::npos && (start.bytes[second] == '"' || start.bytes[second] == '}');
}

// At most `most` bytes more behind `bytes`; whether there were any.
bool readOn(std::ifstream& file, const std::filesystem::path& path, std::string& bytes, std::size_t most) {
  const std::size_t before = bytes.size();
  bytes.resize(before + most);
  file.read(bytes.data() + before, static_cast<std::streamsize>(most));
  if (file.bad()) throw Error(ErrorKind::cannotRead, path.string(), "cannot be read");
  bytes.resize(before + static_cast<std::size_t>(file.gcount()));
  return bytes.size() > before;
}

JsonKind jsonKindOf(std::ifstream& file, const std::filesystem::path& path, std::string piece) {
  JsonKindReader reader;
  for (std::size_t read = piece.size(); !reader.add(piece) && read < kMostJsonBytes; read += piece.size()) {
    piece.clear();
    if (!readOn(file, path, piece, kStartBytes)) break;
  }
  return reader.kind();
}

}  // namespace

bool JsonKindReader::add(std::string_view text) {
  for (std::size_t i = 0; i < text.size() && !kind_ && !ended_; ++i) {
    if (inside_ && !escaped_ && !expects_key_) {  // the bulk of a text
      while (i + 1 < text.size() && text[i] != '"' && text[i] != '\\') ++i;
    }
    const char c = text[i];
    if (inside_) {
      if (escaped_) {
        escaped_ = false;
      } else if (c == '\\') {
        escaped_ = true;
      } else if (c == '"') {
        inside_ = false;
        if (expects_key_) endKey();
        expects_key_ = false;
      }
      if (expects_key_ && key_.size() < kLongestKey) key_ += c;
      continue;
    }
    if (c == '"') {
      inside_ = true;
      key_.clear();
    } else if (c == '{' || c == '[') {
      expects_key_ = ++depth_ == 1;
    } else if (c == '}' || c == ']') {
      ended_ = depth_ <= 1;
      --depth_;
    } else if (c == ',') {
      expects_key_ = depth_ == 1;
    }
  }
  return kind_ || ended_;
}

void JsonKindReader::endKey() {
  const auto of_sog = std::ranges::find(kSogKeys, key_);
  if (of_sog != kSogKeys.end()) sog_keys_ |= 1u << (of_sog - kSogKeys.begin());
  filenames_ = filenames_ || key_ == "filenames";
  if (std::ranges::find(kGltfKeys, key_) != kGltfKeys.end()) kind_ = JsonKind::gltf;
  if (key_ == "lodLevels") kind_ = JsonKind::levels;
  if (key_ == "geometricError") kind_ = JsonKind::tileset;
}

JsonKind JsonKindReader::kind() const {
  if (kind_) return *kind_;
  if (std::popcount(sog_keys_) >= 2) return JsonKind::sog;
  return filenames_ ? JsonKind::levels : JsonKind::gltf;
}

// Deflated, and without flags that are none: a .splat may begin with two such bytes.
bool isGzip(const FileStart& start) {
  return start.begins("\x1f\x8b\x08") && start.bytes.size() > 3 && (start.bytes[3] & 0xE0) == 0;
}

bool isPly(const FileStart& start) { return start.begins("ply\n") || start.begins("ply\r"); }

bool isCompressedPly(const FileStart& start) {
  if (!isPly(start)) return false;
  constexpr std::string_view kSpace = " \t\r";
  for (std::string_view rest = start.bytes; !rest.empty();) {
    std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(line.size() + 1, rest.size()));
    const auto nextWord = [&] {
      line.remove_prefix(std::min(line.find_first_not_of(kSpace), line.size()));
      const std::string_view word = line.substr(0, line.find_first_of(kSpace));
      line.remove_prefix(word.size());
      return word;
    };
    const std::string_view keyword = nextWord();
    if (keyword == "end_header") return false;
    if (keyword != "property") continue;
    (void)nextWord();  // its type
    if (nextWord() == "packed_position") return true;
  }
  return false;
}

FileStart readFileStart(const std::filesystem::path& path) {
  std::error_code status;
  const std::filesystem::file_type type = std::filesystem::status(path, status).type();
  if (type == std::filesystem::file_type::not_found) {
    throw Error(ErrorKind::cannotRead, path.string(),
                isWebAddress(path.string())
                    ? "is an address (expected a file, so download it first; tgview opens a lod-meta.json at one)"
                    : "no such file");
  }
  if (status) throw Error(ErrorKind::cannotRead, path.string(), "cannot open: " + status.message());
  if (std::filesystem::is_directory(path, status)) {
    throw Error(ErrorKind::cannotRead, path.string(), "is a folder (expected a file)");
  }
  if (!isFile(path)) throw Error(ErrorKind::cannotRead, path.string(), "is no regular file");  // a pipe would block
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(ErrorKind::cannotRead, path.string(), "cannot open: " + systemReason());
  FileStart start;
  (void)readOn(file, path, start.bytes, kStartBytes);
  if (isGzip(start)) start.inside_gzip = peekInsideGzip(start.bytes);
  if (isPly(start)) (void)readOn(file, path, start.bytes, kMaxPlyHeaderBytes - kStartBytes);
  if (isJson(start)) start.json = jsonKindOf(file, path, start.bytes);
  return start;
}

}  // namespace tg
