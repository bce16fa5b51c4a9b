// SPDX-License-Identifier: Apache-2.0
// A counting sort of (tile, splat) pairs: chunks of splats count, then fill their own places.
#include "render/cpu/tiles.h"

#include <algorithm>
#include <limits>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg::cpu {
namespace {

struct TileRange {
  std::int32_t x0, y0, x1, y1;  // tiles, x1 and y1 exclusive
  std::size_t count() const { return static_cast<std::size_t>(x1 - x0) * static_cast<std::size_t>(y1 - y0); }
};

// Of the lists' tiles.
TileRange tileRange(const Splat& s, TileRows rows) {
  const TileRows met = tileRowsOf(s);
  const TileRows listed{std::max(met.first, rows.first), std::min(met.end, rows.end)};
  if (listed.empty()) return {0, 0, 0, 0};
  return {s.x0 / kTileWidth, listed.first - rows.first, (s.x1 - 1) / kTileWidth + 1, listed.end - rows.first};
}

template <typename Visit>
void forEachTile(const TileRange& range, int tiles_x, const Visit& visit) {
  for (int y = range.y0; y < range.y1; ++y) {
    for (int x = range.x0; x < range.x1; ++x) visit(static_cast<std::size_t>(y) * tiles_x + x);
  }
}

}  // namespace

TileRows tileRowsOf(const Splat& s) {
  if (s.x0 >= s.x1 || s.y0 >= s.y1) return {0, 0};
  return {s.y0 / kTileHeight, (s.y1 - 1) / kTileHeight + 1};
}

void buildTileLists(const View& view, const ScreenSplats& screen, const std::vector<std::uint32_t>& order,
                    bool with_pairs, TileLists& lists) {
  buildTileLists(view, {0, tileRowsOf(view)}, screen, order, with_pairs, lists);
}

void buildTileLists(const View& view, TileRows rows, const ScreenSplats& screen,
                    const std::vector<std::uint32_t>& order, bool with_pairs, TileLists& lists) {
  TG_ASSERT(order.size() <= screen.splats.size(), "an order of the splats");
  TG_ASSERT(std::all_of(order.begin(), order.end(), [&](std::uint32_t k) { return k < screen.splats.size(); }),
            "an order of the splats");
  TG_ASSERT(rows.first >= 0 && rows.first <= rows.end && rows.end <= tileRowsOf(view), "the image has these rows");
  lists.tiles_x = (view.size.x + kTileWidth - 1) / kTileWidth;
  lists.tiles_y = rows.end - rows.first;
  lists.first_y = rows.first;
  const std::size_t tiles = lists.tiles();
  const std::size_t count = screen.splats.size();

  // Apart from the records: small enough to be looked at in depth order.
  std::vector<TileRange> ranges(count);
  parallelFor(static_cast<std::int64_t>(count), 4096,
              [&](std::int64_t k) { ranges[k] = tileRange(screen.splats[k], rows); });
  std::size_t total = 0;
  lists.pair_begin.resize(count + 1);
  for (std::size_t k = 0; k < count; ++k) {
    lists.pair_begin[k] = static_cast<std::uint32_t>(total);
    total += ranges[k].count();
    if (total > std::numeric_limits<std::uint32_t>::max()) {
      throw Error(ErrorKind::badData, "model", "too many large Gaussians (expected below 2^32 splats over all tiles)");
    }
  }
  lists.pair_begin[count] = static_cast<std::uint32_t>(total);

  // Few enough chunks that their counters (chunks x tiles) stay small beside the pairs.
  const std::size_t chunk_size = std::max<std::size_t>(4096, count / 64 + 1);
  const std::size_t chunks = (count + chunk_size - 1) / chunk_size;
  std::vector<std::uint32_t> next(chunks * tiles, 0);
  const auto range = [&](std::int64_t chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * chunk_size;
    return std::pair(begin, std::min(count, begin + chunk_size));
  };
  parallelFor(static_cast<std::int64_t>(chunks), 1, [&](std::int64_t chunk) {
    const auto [begin, end] = range(chunk);
    for (std::size_t place = begin; place < end; ++place) {
      forEachTile(ranges[order[place]], lists.tiles_x, [&](std::size_t tile) { ++next[chunk * tiles + tile]; });
    }
  });
  lists.begin.resize(tiles + 1);
  std::uint32_t at = 0;
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    lists.begin[tile] = at;
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
      const std::uint32_t n = next[chunk * tiles + tile];
      next[chunk * tiles + tile] = at;
      at += n;
    }
  }
  lists.begin[tiles] = at;
  lists.splats.resize(total);
  lists.pairs.resize(with_pairs ? total : 0);
  parallelFor(static_cast<std::int64_t>(chunks), 1, [&](std::int64_t chunk) {
    const auto [begin, end] = range(chunk);
    for (std::size_t place = begin; place < end; ++place) {
      const std::uint32_t k = order[place];
      std::uint32_t pair = lists.pair_begin[k];
      forEachTile(ranges[k], lists.tiles_x, [&](std::size_t tile) {
        const std::uint32_t position = next[chunk * tiles + tile]++;
        lists.splats[position] = k;
        if (with_pairs) lists.pairs[position] = pair++;
      });
    }
  });
}

}  // namespace tg::cpu
