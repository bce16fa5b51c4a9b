// SPDX-License-Identifier: Apache-2.0
// By what files are told apart: their first bytes and, of JSON, the keys of the outermost object.
#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace tg {

enum class JsonKind { gltf, levels, tileset, sog };

// Reads a JSON text in pieces, no further than it must to know what it is. Keys are compared as they are written: one
// with an escape in it ("m\u0065ans") is none that is known.
class JsonKindReader {
 public:
  // The next bytes. Whether enough is known: all that follows says nothing more.
  bool add(std::string_view text);
  // glTF for what no key claims.
  JsonKind kind() const;

 private:
  void endKey();

  std::string key_;  // the one that is being read
  std::size_t depth_ = 0;
  bool inside_ = false;       // a string
  bool escaped_ = false;      // by the byte before
  bool expects_key_ = false;  // of the outermost object
  bool ended_ = false;
  bool filenames_ = false;
  unsigned sog_keys_ = 0;  // a bit for each that was there
  std::optional<JsonKind> kind_;
};

struct FileStart {
  std::string bytes;        // 64 KiB; of a PLY as many as its header may have
  std::string inside_gzip;  // the first four bytes inside a gzip stream; "" for other files and broken streams
  std::optional<JsonKind> json;

  bool begins(std::string_view magic) const { return bytes.starts_with(magic); }
};

bool isGzip(const FileStart& start);
bool isPly(const FileStart& start);
bool isCompressedPly(const FileStart& start);

// Throws Error(cannotRead) for what is no readable file.
FileStart readFileStart(const std::filesystem::path& path);

}  // namespace tg
