// SPDX-License-Identifier: Apache-2.0
// Third stage of the CPU backend: every tile's splats, front to back, into pixels.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "render/cpu/tiles.h"
#include "render/renderer.h"

namespace tg::cpu {

// What the backward pass takes from a forward pass, per pixel: [tiles, kTilePixels], a tile's rows one after another.
struct BlendRecord {
  std::vector<float> transmittance;  // what is left behind the last blended splat
  std::vector<std::int32_t> stop;  // position in the tile's list of the splat that ended the pixel, or the list's size
  // The vectors of pixels in which a splat of a tile's list shows: [as TileLists::splats, words_per_pair],
  // kernel-inl.h's BlockSet.
  std::vector<std::uint64_t> blocks;
  int words_per_pair = 0;

  bool shows(std::size_t position) const {
    std::uint64_t any = 0;
    for (int word = 0; word < words_per_pair; ++word) any |= blocks[position * words_per_pair + word];
    return any != 0;
  }
};

// A model's texels, and per Gaussian the mean of its texture (core/model/atlas.h); means only where View::footprint.
struct Texels {
  const glm::vec4* texels = nullptr;
  const glm::vec4* means = nullptr;
};

// What a pixel's blended splats add up to.
struct PixelSums {
  glm::vec3 color{0.0f};  // with background; of base and texture, or of the base alone where the frame has both
  glm::vec3 texture{0.0f};
  float alpha = 0;
  glm::vec3 normal{0.0f};
  float weighted_depth = 0, count = 0, depth_median = 0;
  float weighted_density = 0, textured_weight = 0;
};
inline void putPixel(Frame& frame, std::size_t pixel, const PixelSums& sums) {
  const auto put = [&](auto& pixels, auto value) {
    if (!pixels.empty()) pixels[pixel] = value;
  };
  put(frame.picture, sums.color + sums.texture);
  put(frame.base, sums.color);
  put(frame.texture, sums.texture);
  put(frame.alpha, sums.alpha);
  put(frame.normal, sums.normal);
  put(frame.depth, sums.count > 0.0f ? sums.weighted_depth / sums.alpha : 0.0f);
  put(frame.count, sums.count);
  put(frame.depth_median, sums.depth_median);
  put(frame.texel_density, sums.textured_weight > 0.0f ? sums.weighted_density / sums.textured_weight : 0.0f);
}

// What the frame has room for of the outputs that blending yields, in the view's order, and overdraw.
void blendFrame(const View& view, const ScreenSplats& screen, const TileLists& lists, Texels texels, Frame& frame);
// The picture alone, and what backward needs. The picture has the rows of pixels that the lists' tiles have.
void blendPicture(const View& view, const ScreenSplats& screen, const TileLists& lists, const glm::vec4* texels,
                  std::vector<glm::vec3>& picture, BlendRecord& record);

}  // namespace tg::cpu
