// SPDX-License-Identifier: Apache-2.0
// The pixel loop of the per-pixel order: a queue of hits per pixel, sorted as they come.
#include "render/cpu/order.h"

#include <algorithm>
#include <bit>
#include <vector>

#include "core/system/assert.h"
#include "core/system/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/order.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "render/cpu/kernel-inl.h"
#include "render/cpu/texture_samples-inl.h"

#ifndef TG_RENDER_CPU_ORDER_ARGS
#define TG_RENDER_CPU_ORDER_ARGS
namespace tg::cpu {
struct OrderArgs {
  const View& view;
  const Splat* splats;
  const TileLists& lists;
  Texels texels;
  Frame& frame;
};
}  // namespace tg::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace {

// A hit of every pixel of a block.
struct Entry {
  V t, alpha;
  V color[3];  // of base and texture, or of the texture alone where all outputs are wanted
  VI splat;    // position in ScreenSplats::splats; only where all outputs are wanted
};
struct StoredEntry {
  alignas(4 * kLanes) float t[kLanes];
  float alpha[kLanes];
  float color[3][kLanes];
  std::int32_t splat[kLanes];
};

// The hits of a block that wait, nearest first from `head` on. All lanes have the same number: a pixel that a splat
// misses gets a hit of alpha 0 at the end.
struct Queue {
  StoredEntry entries[kOrderDepth];
  int head, count;

  StoredEntry& at(int place) { return entries[(head + place) % kOrderDepth]; }
};

struct PixelState {
  alignas(64) float transmittance[kLanes];  // negative: done, its magnitude is what is left
  float color[3][kLanes];                   // as Entry's, or of the base alone
  PixelSums sums[kLanes];                   // all outputs but these
};

// A band of a tile's rows: what is sorted and blended at once. Its queues stay near the first-level cache.
constexpr int kBandRows = 8;
constexpr int kBandBlocks = kBlocks / kTileHeight * kBandRows;
static_assert(kTileHeight % kBandRows == 0);
struct BandState {
  alignas(64) Queue queues[kBandBlocks];
  alignas(64) PixelState pixels[kBandBlocks];
  BlockSet live;  // blocks of the tile
};
// Where a band keeps a block of its tile.
HWY_INLINE int slotOf(int block) { return block / kTileHeight * kBandRows + block % kBandRows; }

template <bool kAll>
HWY_INLINE Entry load(const StoredEntry& from) {
  Entry e;
  e.t = hn::Load(df, from.t);
  e.alpha = hn::Load(df, from.alpha);
  for (int ch = 0; ch < 3; ++ch) e.color[ch] = hn::Load(df, from.color[ch]);
  e.splat = kAll ? hn::Load(di, from.splat) : hn::Zero(di);
  return e;
}
template <bool kAll>
HWY_INLINE void store(const Entry& e, StoredEntry& to) {
  hn::Store(e.t, df, to.t);
  hn::Store(e.alpha, df, to.alpha);
  for (int ch = 0; ch < 3; ++ch) hn::Store(e.color[ch], df, to.color[ch]);
  if constexpr (kAll) hn::Store(e.splat, di, to.splat);
}
template <bool kAll>
HWY_INLINE Entry choose(M mask, const Entry& yes, const Entry& no) {
  Entry e;
  e.t = hn::IfThenElse(mask, yes.t, no.t);
  e.alpha = hn::IfThenElse(mask, yes.alpha, no.alpha);
  for (int ch = 0; ch < 3; ++ch) e.color[ch] = hn::IfThenElse(mask, yes.color[ch], no.color[ch]);
  e.splat = kAll ? hn::IfThenElse(hn::RebindMask(di, mask), yes.splat, no.splat) : no.splat;
  return e;
}

// Blends the nearest hits of a block.
template <bool kAll>
HWY_INLINE void pop(const OrderArgs& args, int block, BandState& state) {
  Queue& queue = state.queues[slotOf(block)];
  PixelState& pixels = state.pixels[slotOf(block)];
  const StoredEntry& nearest = queue.at(0);
  const V alpha = hn::Load(df, nearest.alpha);
  const V transmittance = hn::Load(df, pixels.transmittance);
  const V blended = hn::Mul(transmittance, alpha);
  const V next = hn::Sub(transmittance, blended);
  const M goes_on = hn::Ge(next, set(kTransmittanceStop));
  const M ends = hn::AndNot(goes_on, hn::Gt(transmittance, hn::Zero(df)));
  V left = hn::IfThenElse(goes_on, next, transmittance);
  left = hn::IfThenElse(ends, hn::Neg(transmittance), left);
  hn::Store(left, df, pixels.transmittance);
  if (hn::AllTrue(df, hn::Le(left, hn::Zero(df)))) {
    state.live.words[block / 64] &= ~(std::uint64_t{1} << (block % 64));
  }
  const V weight = hn::IfThenElseZero(goes_on, blended);
  if constexpr (!kAll) {
    for (int ch = 0; ch < 3; ++ch) {
      hn::Store(hn::MulAdd(weight, hn::Load(df, nearest.color[ch]), hn::Load(df, pixels.color[ch])), df,
                pixels.color[ch]);
    }
  } else {
    alignas(64) float weights[kLanes];
    hn::Store(weight, df, weights);
    alignas(64) float before[kLanes];
    hn::Store(transmittance, df, before);
    for (int lane = 0; lane < kLanes; ++lane) {
      const float w = weights[lane];
      if (!(w > 0.0f)) continue;
      const Splat& s = args.splats[nearest.splat[lane]];
      PixelSums& sums = pixels.sums[lane];
      for (int ch = 0; ch < 3; ++ch) {
        pixels.color[ch][lane] += w * s.base[ch];
        sums.texture[ch] += w * nearest.color[ch][lane];
        sums.normal[ch] += w * s.normal[ch];
      }
      sums.weighted_depth += w * nearest.t[lane];
      sums.count += 1.0f;
      if (before[lane] >= 0.5f && before[lane] - w < 0.5f) sums.depth_median = nearest.t[lane];
      if (s.texture_width == 0) continue;
      sums.weighted_density += w * s.texel_density;
      sums.textured_weight += w;
    }
  }
  queue.head = (queue.head + 1) % kOrderDepth;
  --queue.count;
}

// Puts hits into their places: behind those that are not farther, so that ties keep the order of the means.
template <bool kAll>
HWY_INLINE void push(Entry entry, M hits, Queue& queue) {
  int place = queue.count++;
  if (place > 0) {
    const V last = hn::Load(df, queue.at(place - 1).t);
    entry.t = hn::IfThenElse(hits, entry.t, last);
  }
  while (place > 0) {
    const Entry before = load<kAll>(queue.at(place - 1));
    const M earlier = hn::Lt(entry.t, before.t);
    if (hn::AllFalse(df, earlier)) break;
    store<kAll>(choose<kAll>(earlier, before, entry), queue.at(place));
    entry = choose<kAll>(earlier, entry, before);
    --place;
  }
  store<kAll>(entry, queue.at(place));
}

// A splat of a band's list.
struct Candidate {
  std::uint32_t key;  // bits of the camera z of its hit in the middle of the band's part of its screen box
  std::uint32_t splat;
};

// The splats whose screen boxes meet rows [begin, end) of a tile, by their hits there.
HWY_INLINE void sortBand(const OrderArgs& args, int tile, int begin, int end, std::vector<Candidate>& out) {
  const int tile_x = tile % args.lists.tiles_x * kTileWidth;
  const int tile_y = tile / args.lists.tiles_x * kTileHeight;
  out.clear();
  for (const std::uint32_t k : args.lists.list(tile)) {
    const Splat& s = args.splats[k];
    const int y0 = std::max(s.y0, tile_y + begin), y1 = std::min(s.y1, tile_y + end);
    if (y0 >= y1) continue;
    const int x0 = std::max(s.x0, tile_x), x1 = std::min(s.x1, tile_x + kTileWidth);
    const float x = 0.5f * static_cast<float>(x0 + x1) - s.center_x;
    const float y = 0.5f * static_cast<float>(y0 + y1) - s.center_y;
    const float d = s.d_xx * x + s.d_xy * y + s.d_x1;
    const float d_y = s.d_yy * y + s.d_y1;
    const float d2 = d * d + d_y * d_y + s.d_11 * s.d_11;
    const float t = (s.t_x * x + s.t_y * y + s.t_1) / d2;
    // A ray along a plane, or one that the splat lies behind: by the mean.
    const float key = t > 0.0f && t < 1e30f ? t : s.depth;
    out.push_back({std::bit_cast<std::uint32_t>(key), k});
  }
  std::stable_sort(out.begin(), out.end(), [](const Candidate& a, const Candidate& b) { return a.key < b.key; });
}

// Rows [band, band + kBandRows) of a tile.
template <bool kAll>
void orderBand(const OrderArgs& args, int tile, int band, std::vector<Candidate>& list) {
  const View& view = args.view;
  const int tile_x = tile % args.lists.tiles_x * kTileWidth;
  const int tile_y = tile / args.lists.tiles_x * kTileHeight;
  const int width = std::min(kTileWidth, view.size.x - tile_x);
  const int end = std::min(band + kBandRows, view.size.y - tile_y);
  sortBand(args, tile, band, end, list);
  BandState state;
  state.live = {};
  for (int block = 0; block < kBlocks; ++block) {
    const int row = block % kTileHeight;
    if (row < band || row >= end) continue;
    const int columns_left = std::clamp(width - block / kTileHeight * kLanes, 0, kLanes);
    PixelState& pixels = state.pixels[slotOf(block)];
    pixels = {};
    hn::Store(hn::IfThenElse(hn::FirstN(df, static_cast<std::size_t>(columns_left)), set(1.0f), set(-1.0f)), df,
              pixels.transmittance);
    state.queues[slotOf(block)].head = state.queues[slotOf(block)].count = 0;
    if (columns_left > 0) state.live.words[block / 64] |= std::uint64_t{1} << (block % 64);
  }
  const BlockSet all_blocks = state.live;

  Rows rows;
  Samples samples;
  TextureSamples texture;
  const auto any_lane = [](M visible, int) HWY_ATTR { return visible; };
  for (std::size_t position = 0; position < list.size() && !empty(state.live); ++position) {
    const Splat& s = args.splats[list[position].splat];
    if (position + kSplatsAhead < list.size()) prefetchSplat(args.splats[list[position + kSplatsAhead].splat]);
    RowRange range = rowRange(s, tile_y);
    range = {std::max(range.begin, band), std::min(range.end, end)};
    BlockSet candidates = findBlocks(s, tile_x, tile_y, range, rows);
    for (int word = 0; word < kWords; ++word) candidates.words[word] &= state.live.words[word];
    evaluate<Keep::hit>(s, rows, tile_x, candidates, any_lane, samples);
    const bool textured = s.texture_width > 0;
    if (textured) applyTexture(s, args.texels, view, rows, tile_x, tile_y, samples, texture);
    for (int i = 0; i < samples.count; ++i) {
      const int block = samples.block[i];
      const Sample& sample = samples.at[i];
      Entry entry;
      const V value = hn::Load(df, sample.value);
      entry.alpha = hn::Min(value, set(kAlphaMax));
      const V x = columnX(s, tile_x, block / kTileHeight);
      entry.t = hitDepth(s, rows.y[block % kTileHeight], x, hn::Load(df, sample.inverse_d2));
      for (int ch = 0; ch < 3; ++ch) {
        const V base = kAll ? hn::Zero(df) : set(s.base[ch]);
        entry.color[ch] = textured ? hn::Add(base, hn::Load(df, texture.color[i][ch])) : base;
      }
      entry.splat = hn::Set(di, static_cast<std::int32_t>(list[position].splat));
      Queue& queue = state.queues[slotOf(block)];
      if (queue.count == kOrderDepth) pop<kAll>(args, block, state);
      push<kAll>(entry, hn::Gt(value, hn::Zero(df)), queue);
    }
  }

  for (int word = 0; word < kWords; ++word) {
    for (std::uint64_t bits = all_blocks.words[word]; bits != 0; bits &= bits - 1) {
      const int block = word * 64 + std::countr_zero(bits);
      while (state.queues[slotOf(block)].count > 0) pop<kAll>(args, block, state);
    }
  }
  for (int row = band; row < end; ++row) {
    for (int x = 0; x < width; ++x) {
      const PixelState& pixels = state.pixels[slotOf(x / kLanes * kTileHeight + row)];
      const int lane = x % kLanes;
      const float transmittance = std::abs(pixels.transmittance[lane]);
      PixelSums sums = pixels.sums[lane];
      sums.color = glm::vec3(pixels.color[0][lane], pixels.color[1][lane], pixels.color[2][lane]) +
                   transmittance * view.background;
      sums.alpha = 1.0f - transmittance;
      putPixel(args.frame, static_cast<std::size_t>(tile_y + row) * view.size.x + tile_x + x, sums);
    }
  }
}

template <bool kAll>
void orderTile(const OrderArgs& args, int tile) {
  std::vector<Candidate> list;
  const int height = std::min(kTileHeight, args.view.size.y - tile / args.lists.tiles_x * kTileHeight);
  for (int band = 0; band < height; band += kBandRows) orderBand<kAll>(args, tile, band, list);
}

void orderAllTile(const OrderArgs& args, int tile) { orderTile<true>(args, tile); }
void orderPictureTile(const OrderArgs& args, int tile) { orderTile<false>(args, tile); }

}  // namespace
}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(orderAllTile);
HWY_EXPORT(orderPictureTile);

void blendInOrder(const View& view, const ScreenSplats& screen, const TileLists& lists, Texels texels, bool all,
                  Frame& frame) {
  TG_ASSERT(frame.width == view.size.x && frame.height == view.size.y, "the frame has the view's size");
  TG_ASSERT(lists.begin.size() == static_cast<std::size_t>(lists.tiles()) + 1, "a list a tile");
  TG_ASSERT(!view.footprint || texels.means != nullptr, "the footprint filter needs the textures' means");
  const OrderArgs args{view, screen.splats.data(), lists, texels, frame};
  parallelFor(lists.tiles(), 1, [&](std::int64_t tile) {
    if (all) {
      HWY_DYNAMIC_DISPATCH(orderAllTile)(args, static_cast<int>(tile));
    } else {
      HWY_DYNAMIC_DISPATCH(orderPictureTile)(args, static_cast<int>(tile));
    }
  });
}

}  // namespace tg::cpu
#endif
