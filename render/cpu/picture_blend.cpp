// SPDX-License-Identifier: Apache-2.0
// Last stage of the picture alone. A tile takes its splats sixteen at a time: first the rows and vectors of pixels that
// each may show in, then one loop over all those vectors, so that no branch waits for the end of a splat's set-up.
#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>

#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "render/cpu/picture.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/picture_blend.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "render/cpu/picture-inl.h"

#ifndef TG_RENDER_CPU_PICTURE_BLEND_ARGS
#define TG_RENDER_CPU_PICTURE_BLEND_ARGS
namespace tg::cpu {

// A tile's pairs by depth, then by splat: sorted piece by piece, as far as they are asked for.
class DepthQueue {
 public:
  void start(const std::uint64_t* pairs, std::size_t count);
  std::size_t size() const { return sorted_.size(); }
  // Splats [0, min(end, size())) are in their places.
  void sortTo(std::size_t end);
  std::uint32_t operator[](std::size_t at) const { return static_cast<std::uint32_t>(sorted_[at]); }

 private:
  static constexpr std::size_t kAtOnce = 64, kFar = 32;
  std::vector<std::uint64_t> sorted_;
  std::vector<std::uint32_t> ends_;  // of the buckets, which are in order among themselves
  std::size_t done_ = 0;
};

struct PictureArgs {
  const View& view;
  const PictureScene& scene;
  Texels texels;
  Frame& frame;
};

}  // namespace tg::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace {

HWY_INLINE void clear(int width, int height, TileState& state) {
  for (int c = 0; c < kColumns; ++c) state.live[c] = 0;
  for (int block = 0; block < kBlocks; ++block) {
    const int row = block / kColumns, c = block % kColumns;
    const int left = row < height ? std::clamp(width - c * kLanes, 0, kLanes) : 0;  // columns inside the image
    PixelBlock& pixels = state.blocks[block];
    hn::Store(hn::IfThenElse(hn::FirstN(df, static_cast<std::size_t>(left)), set(1.0f), set(-1.0f)), df,
              pixels.transmittance);
    for (int ch = 0; ch < 3; ++ch) hn::Store(hn::Zero(df), df, pixels.color[ch]);
    if (left > 0) state.live[c] |= 1u << row;
  }
}

// Takes blocks that are done off the live ones. Whether any is left.
HWY_INLINE bool updateLive(TileState& state) {
  std::uint32_t any = 0;
  for (int c = 0; c < kColumns; ++c) {
    std::uint32_t live = 0;
    for (int row = 0; row < kTileHeight; ++row) {
      const V transmittance = hn::Load(df, state.blocks[row * kColumns + c].transmittance);
      live |= (hn::AllTrue(df, hn::Lt(transmittance, hn::Zero(df))) ? 0u : 1u) << row;
    }
    state.live[c] = live;
    any |= live;
  }
  return any != 0;
}

HWY_INLINE void putTile(const PictureArgs& args, int tile_x, int tile_y, int width, int height,
                        const TileState& state) {
  const glm::vec3 background = args.view.background;
  Frame& frame = args.frame;
  for (int row = 0; row < height; ++row) {
    for (int c = 0; c * kLanes < width; ++c) {
      const auto lanes = static_cast<std::size_t>(std::min(kLanes, width - c * kLanes));
      const std::size_t pixel = static_cast<std::size_t>(tile_y + row) * static_cast<std::size_t>(args.view.size.x) +
                                static_cast<std::size_t>(tile_x + c * kLanes);
      const PixelBlock& pixels = state.blocks[row * kColumns + c];
      const V left = hn::Abs(hn::Load(df, pixels.transmittance));
      alignas(64) float out[3 * kLanes];
      if (!frame.picture.empty()) {
        hn::StoreInterleaved3(hn::MulAdd(left, set(background.x), hn::Load(df, pixels.color[0])),
                              hn::MulAdd(left, set(background.y), hn::Load(df, pixels.color[1])),
                              hn::MulAdd(left, set(background.z), hn::Load(df, pixels.color[2])), df, out);
        std::memcpy(&frame.picture[pixel], out, lanes * sizeof(glm::vec3));
      }
      if (!frame.alpha.empty()) {
        hn::Store(hn::Sub(set(1.0f), left), df, out);
        std::memcpy(&frame.alpha[pixel], out, lanes * sizeof(float));
      }
    }
  }
}

}  // namespace

// Returns the number of pixel-splats that were evaluated.
std::uint64_t blendPictureTile(const PictureArgs& args, int tile, DepthQueue& queue) {
  const View& view = args.view;
  const PictureScene& scene = args.scene;
  const int tile_x = tile % scene.tiles_x * kTileWidth;
  const int tile_y = tile / scene.tiles_x * kTileHeight;
  const int width = std::min(kTileWidth, view.size.x - tile_x);
  const int height = std::min(kTileHeight, view.size.y - tile_y);
  const PictureSplat* splats = scene.splats.data();
  queue.start(scene.pairs.data() + scene.begin[tile], scene.begin[tile + 1] - scene.begin[tile]);

  TileState state;
  clear(width, height, state);
  HitBatch batch;
  const PictureHit* hits = view.textured() ? scene.hits.data() : nullptr;
  const auto prefetch = [&](std::uint32_t at) {
    hwy::Prefetch(splats + at);
    if (hits == nullptr) return;
    hwy::Prefetch(hits + at);
    hwy::Prefetch(&hits[at].near);
  };
  bool any_live = true;
  std::uint64_t items = 0;
  for (std::size_t first = 0; first < queue.size() && any_live; first += kBatch) {
    queue.sortTo(first + 2 * kBatch);
    const std::size_t end = std::min(queue.size(), first + kBatch);
    batch.count = 0;
    for (std::size_t k = first; k < end; ++k) {
      const std::uint32_t at = queue[k];
      const auto slot = static_cast<int>(k - first);
      const PictureSplat& s = splats[at];
      // One at a time: the processor looks up the pages of few addresses at once.
      if (k + kBatch < queue.size()) prefetch(queue[k + kBatch]);
      addSplat(s, slot, tile_x, tile_y, state, batch);
      batch.splats[slot] = &s;
      const PictureHit* hit = std::signbit(s.d_11) ? scene.hits.data() + at : nullptr;
      const bool needed = hit != nullptr && (hit->texture_width > 0 || meetsNear(s, *hit, tile_x, tile_y));
      batch.hits[slot] = needed ? hit : nullptr;
      if (needed) prefetchTexels(*hit, args.texels.texels);
      batch.ends[slot] = batch.count;
    }
    blendBatch(batch, static_cast<int>(end - first), {view, args.texels, tile_x, tile_y}, state.blocks);
    items += static_cast<std::uint64_t>(batch.count);
    any_live = updateLive(state);
  }
  putTile(args, tile_x, tile_y, width, height, state);
  return items * kLanes;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(blendPictureTile);

void DepthQueue::start(const std::uint64_t* pairs, std::size_t count) {
  sorted_.resize(count);
  done_ = 0;
  ends_.clear();
  if (count == 0) return;
  const auto [least, most] = std::minmax_element(pairs, pairs + count);
  const std::uint64_t first = *least >> 32;
  const std::uint64_t span = (*most >> 32) - first;
  // About two buckets a pair were depths spread evenly: most hold one or none, and need no sorting.
  const int shift = std::max(0, static_cast<int>(std::bit_width(span)) - static_cast<int>(std::bit_width(count)) - 1);
  ends_.assign((span >> shift) + 2, 0);
  const auto bucket = [&](std::uint64_t pair) { return ((pair >> 32) - first) >> shift; };
  for (std::size_t i = 0; i < count; ++i) ++ends_[bucket(pairs[i]) + 1];
  for (std::size_t b = 1; b < ends_.size(); ++b) ends_[b] += ends_[b - 1];
  for (std::size_t i = 0; i < count; ++i) sorted_[ends_[bucket(pairs[i])]++] = pairs[i];
}

void DepthQueue::sortTo(std::size_t end) {
  if (end <= done_ || done_ == sorted_.size()) return;
  // Whole buckets, a few at once: what lies in front of them is in order already.
  end = std::min(sorted_.size(), std::max(end, done_ + kAtOnce));
  const std::size_t to = *std::lower_bound(ends_.begin(), ends_.end(), end);
  std::uint64_t* pairs = sorted_.data();
  for (std::size_t i = done_ + 1; i < to; ++i) {
    const std::uint64_t pair = pairs[i];
    std::size_t at = i;
    for (; at > done_ && pairs[at - 1] > pair; --at) pairs[at] = pairs[at - 1];
    pairs[at] = pair;
    if (HWY_UNLIKELY(i - at > kFar)) {  // a bucket of many
      std::sort(pairs + done_, pairs + to);
      break;
    }
  }
  done_ = to;
}

void blendPicture(const View& view, PictureScene& scene, Texels texels, Frame& frame) {
  TG_ASSERT(frame.width == view.size.x && frame.height == view.size.y, "the frame has the view's size");
  TG_ASSERT(scene.begin.size() == static_cast<std::size_t>(scene.tiles_x) * static_cast<std::size_t>(scene.tiles_y) + 1,
            "listPicture() comes first");
  const PictureArgs args{view, scene, texels, frame};
  std::vector<DepthQueue> queues(static_cast<std::size_t>(threadCount()));
  std::atomic<std::uint64_t> pixel_splats{0};
  parallelForWorkers(std::int64_t{scene.tiles_x} * scene.tiles_y, 1, std::ssize(queues),
                     [&](std::int64_t tile, int worker) {
                       DepthQueue& queue = queues[static_cast<std::size_t>(worker)];
                       pixel_splats += HWY_DYNAMIC_DISPATCH(blendPictureTile)(args, static_cast<int>(tile), queue);
                     });
  scene.pixel_splats = pixel_splats;
}

}  // namespace tg::cpu
#endif
