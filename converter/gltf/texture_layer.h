// SPDX-License-Identifier: Apache-2.0
// Reads the nested extension TG_gaussian_splatting_texture of one primitive.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "converter/gltf/accessor.h"
#include "converter/gltf/document.h"
#include "core/model/atlas.h"
#include "core/model/model.h"

namespace tg {

constexpr std::uint64_t kMaxAtlasTexels = std::uint64_t{1} << 28;    // of all pages of a primitive
constexpr std::uint64_t kFreeSharedTexels = std::uint64_t{1} << 26;  // rectangles may overlap up to this sum of areas

struct TextureLayer {
  TextureMode mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::plane;
  TextureAtlas atlas;                         // rects: [count]; terms that the mode lacks hold neutral values
  std::optional<std::vector<float>> scale;    // [count * 3] to use with the texture, absent: the base's
  std::optional<std::vector<float>> opacity;  // [count] likewise
  std::optional<std::vector<float>> dc;       // [count * 3] likewise
};

// Decoded atlases, for the next primitive that names the same ones.
struct DecodedAtlases {
  TextureMode mode = TextureMode::none;
  const tinygltf::Value* named = nullptr;  // of the document; nullptr: none
  std::vector<Image> pages;
  std::uint64_t texels = 0;  // decoded so far, in the document
};

// The extension object of a primitive; nullptr when it has none.
const tinygltf::Value* findTextureExtension(const tinygltf::Primitive& primitive);

// Throws Error(badData) with a JSON pointer, what was expected and what was found. Where the document collects errors,
// all that can be told apart; the layer is then of no use.
TextureLayer readTextureLayer(const GltfDocument& document, const SplatPrimitive& splats,
                              const tinygltf::Value& extension, DecodedAtlases& decoded);

}  // namespace tg
