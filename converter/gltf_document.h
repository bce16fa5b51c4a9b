// SPDX-License-Identifier: Apache-2.0
// A glTF or GLB file whose every index, offset and count has been checked.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

// Forward declarations would not do: tinygltf::Model is used by value.
#include <tiny_gltf.h>

#include "core/error.h"

namespace tg {

inline constexpr std::string_view kSplatExtension = "KHR_gaussian_splatting";
inline constexpr std::string_view kTextureExtension = "TG_gaussian_splatting_texture";

struct GltfDocument {
  std::string path;       // starts every error message
  tinygltf::Model model;  // image.image holds the encoded file's bytes; nothing is decoded
  std::vector<std::string> warnings;
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
  // The error for something wrong at a JSON pointer.
  Error bad(const std::string& pointer, const std::string& what) const {
    return Error(ErrorKind::badData, path, pointer + ": " + what);
  }
  void warn(const std::string& pointer, const std::string& what) {
    warnings.push_back(printable(pointer + ": " + what));
  }
};

// Container, JSON syntax, sizes and references are checked before tinygltf sees a byte: afterwards every accessor that
// has a bufferView lies inside it, every view inside its buffer, every index names something that is there. Buffers and
// images beside the file are read from `folder`, without which they are refused. Views packed with meshopt are
// unpacked. Throws Error(badData) with a JSON pointer, what was expected and found.
GltfDocument loadGltf(std::span<const std::uint8_t> bytes, const std::string& path,
                      const std::optional<std::filesystem::path>& folder = std::nullopt);

}  // namespace tg
