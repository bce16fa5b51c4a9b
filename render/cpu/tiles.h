// SPDX-License-Identifier: Apache-2.0
// Second stage of the CPU backend: which splats each tile of the image may show, in depth order.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "render/cpu/project.h"

namespace tg::cpu {

// [px] A tile's pixel state stays in the first-level cache, and a row holds whole vectors up to 16 lanes. Larger than
// the GPU's: exact row spans keep wasted pixels low at any size, and fewer (tile, splat) pairs cost less set-up. Tall,
// because what is fixed down a column of vectors (x) is set up less often.
constexpr int kTileWidth = 16;
constexpr int kTileHeight = 32;
constexpr int kTilePixels = kTileWidth * kTileHeight;

// Rows of tiles, `end` exclusive.
struct TileRows {
  int first = 0;
  int end = 0;
  bool empty() const { return first >= end; }
};
inline int tileRowsOf(const View& view) { return (view.size.y + kTileHeight - 1) / kTileHeight; }

// Of all rows of tiles, or of some: tile 0 is then the first tile of row first_y of the image.
struct TileLists {
  int tiles_x = 0;
  int tiles_y = 0;
  int first_y = 0;
  std::vector<std::uint32_t> begin;   // [tiles + 1] into `splats`
  std::vector<std::uint32_t> splats;  // [pairs] positions in ScreenSplats::splats, front to back within a tile
  // The pairs of one splat, in tile order, have the consecutive numbers pair_begin[k] .. pair_begin[k + 1].
  std::vector<std::uint32_t> pair_begin;  // [splats + 1]
  std::vector<std::uint32_t> pairs;  // [pairs] number of the pair at a position in `splats`; empty unless asked for

  int tiles() const { return tiles_x * tiles_y; }
  // [px] Where a tile begins in the image, and the first row of the lists' pixels.
  int pixelX(int tile) const { return tile % tiles_x * kTileWidth; }
  int pixelY(int tile) const { return (tile / tiles_x + first_y) * kTileHeight; }
  int firstPixelY() const { return first_y * kTileHeight; }
  std::span<const std::uint32_t> list(int tile) const {
    return std::span(splats).subspan(begin[tile], begin[tile + 1] - begin[tile]);
  }
};

// with_pairs: fill `pairs` too (the backward pass leaves its sums there).
void buildTileLists(const View& view, const ScreenSplats& screen, const std::vector<std::uint32_t>& order,
                    bool with_pairs, TileLists& lists);
// Of some rows of tiles alone; what lies outside them has no pairs.
void buildTileLists(const View& view, TileRows rows, const ScreenSplats& screen,
                    const std::vector<std::uint32_t>& order, bool with_pairs, TileLists& lists);
// The rows of tiles that a splat's box meets.
TileRows tileRowsOf(const Splat& s);

}  // namespace tg::cpu
