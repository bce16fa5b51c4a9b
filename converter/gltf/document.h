// SPDX-License-Identifier: Apache-2.0
// A glTF or GLB file whose every index, offset and count has been checked.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

// Forward declarations would not do: tinygltf::Model is used by value.
#include <tiny_gltf.h>

#include "core/file/file.h"
#include "core/system/error.h"
#include "core/system/shortened.h"

namespace tg {

inline constexpr std::string_view kSplatExtension = "KHR_gaussian_splatting";
inline constexpr std::string_view kTextureExtension = "TG_gaussian_splatting_texture";

// Members of the Khronos extension that are strings.
inline constexpr std::array<const char*, 4> kKhronosNames = {"kernel", "colorSpace", "projection", "sortingMethod"};

inline constexpr std::string_view kWebpExtension = "EXT_texture_webp";

struct GltfJson;

struct GltfDocument {
  std::string path;       // starts every error message
  tinygltf::Model model;  // image.image holds the encoded file's bytes; nothing is decoded
  // The file, where the model's one buffer is its BIN chunk and has been left there; null: the model's buffers are
  // full.
  std::shared_ptr<const FileReader> file;
  std::uint64_t bin_offset = 0;  // of that chunk's content in the file
  std::vector<std::string> warnings;
  std::vector<std::string> mended;  // with the path: errors that do not end reading
  // JSON pointers of texture layers that the library drops without a word: null, {}, and what is no object.
  std::vector<std::string> hollow_layers;
  // JSON pointers of kSplatExtension that is no object and of kKhronosNames that are no strings, of which it drops some
  // as well, and what they are.
  std::map<std::string, std::string> wrong_types;
  // JSON pointers of primitives whose splats are an SPZ, which it drops without a buffer view, and what names that.
  std::map<std::string, std::string> spz_views;
  std::vector<std::string> unread;  // warnings of what changes how splats look and is not read
  // tgconvert check: errors go here and reading goes on where it can. Null: the first one ends it.
  std::vector<std::string>* errors = nullptr;

  // Runs a step of reading; false when it failed and the error was noted.
  template <typename Step>
  bool attempt(Step step) const {
    if (errors == nullptr) {
      step();
      return true;
    }
    try {
      step();
      return true;
    } catch (const Error& error) {
      if (error.kind != ErrorKind::badData) throw;
      errors->push_back(error.what());
      return false;
    }
  }
  // Bytes of a buffer view, from `offset` in it. Throws Error(cannotRead) when the file has changed.
  void read(int view, std::uint64_t offset, std::span<std::uint8_t> out) const;
  // The error for something wrong at a JSON pointer.
  Error bad(const std::string& pointer, const std::string& what) const {
    return Error(ErrorKind::badData, path, shortened(pointer) + ": " + shortened(what));
  }
  void warn(const std::string& pointer, const std::string& what) {
    warnings.push_back(printable(shortened(pointer) + ": " + shortened(what)));
  }
  // What breaks a rule and is put right: a warning, which says how, and an error of tgconvert check.
  void mend(const std::string& pointer, const std::string& what, const std::string& how) {
    if (errors == nullptr) return warn(pointer, what + ": " + how);
    mended.emplace_back(bad(pointer, what).what());
  }
};

// Container, JSON syntax, sizes and references are checked before tinygltf sees a byte: afterwards every accessor that
// has a bufferView lies inside it, every view inside its buffer, every index names something that is there. Buffers and
// images beside the file are read from `folder`, without which they are refused. Views packed with meshopt are
// unpacked. Throws Error(badData) with a JSON pointer, what was expected and found.
GltfDocument loadGltf(std::span<const std::uint8_t> bytes, const std::string& path,
                      const std::optional<std::filesystem::path>& folder = std::nullopt);

// The same for a file. The buffer of a GLB stays there, where nothing has to be unpacked, and is read when it is
// needed. Throws Error(cannotRead), too.
GltfDocument openGltf(const std::filesystem::path& path);
// Names of the files beside a .gltf that its buffers and images are in, each once. Throws Error(cannotRead / badData).
std::vector<std::string> gltfFilesBeside(const std::filesystem::path& path);
// Hands over the JSON, too, and has the numbers of meshes beside the splats where they are packed.
GltfDocument openGltf(const std::filesystem::path& path, GltfJson& parsed);

}  // namespace tg
