// SPDX-License-Identifier: Apache-2.0
// A texture rectangle per Gaussian: texels addressed by offset and size in one array, and packed into pages for files.
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/system/assert.h"

namespace tg {

// Texel (i, j), i along u, j along v, is texels[offset + j * width + i]. width = height = 0: no texture.
struct TextureRect {
  std::uint32_t offset = 0;  // [texels]
  std::uint16_t width = 0;   // [texels] along u
  std::uint16_t height = 0;  // [texels] along v
  std::uint32_t texelCount() const { return std::uint32_t{width} * height; }
  bool operator==(const TextureRect&) const = default;
};

constexpr std::uint64_t kMaxOffset = std::numeric_limits<std::uint32_t>::max();  // [texels]
constexpr std::uint64_t kMaxModelTexels = std::uint64_t{1} << 30;                // in what files hold and edits make

// rgb: added to the base colour (signed). a: factor on the Gaussian's alpha, in [0, 1]. Neutral texel: (0, 0, 0, 1).
struct TextureAtlas {
  std::vector<TextureRect> rects;  // [N], or empty: no Gaussian has a texture
  std::vector<glm::vec4> texels;   // rectangles do not overlap
  bool operator==(const TextureAtlas&) const = default;
};

// N rectangles of width x height neutral texels. Throws Error(badData) for a size that no rectangle has, and for more
// texels than offsets reach.
TextureAtlas makeUniformAtlas(std::size_t gaussian_count, int width, int height);

// The share of every texel of one axis in a texture's mean under its Gaussian: the integral of the texel's hat function
// times the normal density over +-3 sigma. Sums to 1. size >= 1.
std::vector<double> texelShares(int size);
// The mean of every Gaussian's texture under it: [N], neutral where there is none.
std::vector<glm::vec4> textureMeans(const TextureAtlas& atlas, std::size_t gaussian_count);

// Packed rectangles are an image of four channels. Its [texels], row-major, texel (x, y) at y * width + x, and an image
// of neutral ones:
inline std::span<glm::vec4> pageTexels(Image& page) {
  TG_ASSERT(page.channels == 4 && hasImageShape(page), "a page has 4 channels, and its data its size");
  return {reinterpret_cast<glm::vec4*>(page.data.data()), page.data.size() / 4};
}
inline std::span<const glm::vec4> pageTexels(const Image& page) {
  TG_ASSERT(page.channels == 4 && hasImageShape(page), "a page has 4 channels, and its data its size");
  return {reinterpret_cast<const glm::vec4*>(page.data.data()), page.data.size() / 4};
}
static_assert(sizeof(glm::vec4) == 4 * sizeof(float) && alignof(glm::vec4) == alignof(float));
Image neutralPage(int width, int height);

// Where a Gaussian's rectangle lies. w = h = 0: untextured (x = y = page = 0).
struct AtlasPlacement {
  std::uint16_t x = 0, y = 0, w = 0, h = 0;
  std::uint8_t page = 0;
};
constexpr int kMaxAtlasPages = 255;
struct PackedAtlas {
  std::vector<Image> pages;                // at most kMaxAtlasPages, all of one size
  std::vector<AtlasPlacement> placements;  // [N]
};

// Shelf packing by height class, Gaussian order inside a class; deterministic. No gutters: bilinear taps never leave a
// rectangle. Free texels are neutral. Throws Error(badData) when a rectangle exceeds max_page_size or kMaxAtlasPages
// do not suffice.
PackedAtlas packAtlas(const TextureAtlas& atlas, std::size_t gaussian_count, int max_page_size = 4096);

// The inverse; rectangles come back in Gaussian order with consecutive offsets. Throws Error(badData) naming the first
// Gaussian whose rectangle leaves its page. `path` starts the message.
TextureAtlas unpackAtlas(const PackedAtlas& packed, const std::string& path);

}  // namespace tg
