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

// All outputs.
void blendFrame(const View& view, const ScreenSplats& screen, const TileLists& lists, const glm::vec4* texels,
                Frame& frame);
// The picture alone, and what backward needs.
void blendPicture(const View& view, const ScreenSplats& screen, const TileLists& lists, const glm::vec4* texels,
                  std::vector<glm::vec3>& picture, BlendRecord& record);

}  // namespace tg::cpu
