// SPDX-License-Identifier: Apache-2.0
// A glTF or GLB file whose every index, offset and count has been checked.
#pragma once
#include <cstdint>
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

  // The error for something wrong at a JSON pointer.
  Error bad(const std::string& pointer, const std::string& what) const {
    return Error(ErrorKind::badData, path, pointer + ": " + what);
  }
  void warn(const std::string& pointer, const std::string& what) {
    warnings.push_back(printable(pointer + ": " + what));
  }
};

// Container, JSON syntax, sizes and references are checked before tinygltf sees a byte: afterwards every accessor that
// has a bufferView lies inside it, every view inside its buffer, every index names something that is there, and nothing
// was loaded from outside the file. Throws Error(badData) with a JSON pointer, what was expected and
// found.
GltfDocument loadGltf(std::span<const std::uint8_t> bytes, const std::string& path);

}  // namespace tg
