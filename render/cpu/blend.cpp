// SPDX-License-Identifier: Apache-2.0
// The forward pixel loop: per tile, splats front to back; per splat, the rows it meets; per row, vectors of pixels.
#include "render/cpu/blend.h"

#include <algorithm>

#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "render/cpu/order.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/blend.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "render/cpu/kernel-inl.h"
#include "render/cpu/texture_samples-inl.h"

#ifndef TG_RENDER_CPU_BLEND_ARGS
#define TG_RENDER_CPU_BLEND_ARGS
namespace tg::cpu {
struct BlendArgs {
  const View& view;
  const Splat* splats;
  const TileLists& lists;
  Texels texels;
  Frame* frame;                     // Mode::picture and Mode::all
  std::vector<glm::vec3>* picture;  // Mode::training
  BlendRecord* record;
};
// The picture, and what backward needs; the picture alone, with alpha if there is room; everything.
enum class Mode { training, picture, all };
}  // namespace tg::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace {

// Pixel state of a block. Interleaved: one stream of stores, and nothing that aliases at the same page offset.
struct PixelBlock {
  alignas(4 * kLanes) float transmittance[kLanes];  // negative: the pixel is done, its magnitude is what is left
  float color[3][kLanes];                           // of base and texture, or of the base alone in Mode::all
};
struct ColorState {
  alignas(64) PixelBlock blocks[kBlocks];
  alignas(64) std::int32_t stop[kTilePixels];
  BlockSet live;  // blocks with a pixel that is not done
};
// [block, lane]
struct OutputState {
  alignas(64) float texture[3][kTilePixels];
  alignas(64) float normal[3][kTilePixels];
  alignas(64) float depth[kTilePixels];
  alignas(64) float count[kTilePixels];
  alignas(64) float depth_median[kTilePixels];
  alignas(64) float density[kTilePixels];          // weighted sum
  alignas(64) float textured_weight[kTilePixels];  // sum of its weights
  bool wants_median;
  bool wants_density;
};

HWY_INLINE void addTo(float* at, V weight, V value) { hn::Store(hn::MulAdd(weight, value, hn::Load(df, at)), df, at); }

// Blends one splat into a tile.
template <Mode kMode, bool kTexture>
HWY_INLINE void blendSplat(const Splat& s, std::uint32_t position, int tile_x, const Rows& rows, const Samples& samples,
                           const TextureSamples& texture, ColorState& state, OutputState& outputs) {
  constexpr bool kAll = kMode == Mode::all;
  const V base[3] = {set(s.base.x), set(s.base.y), set(s.base.z)};
  for (int i = 0; i < samples.count; ++i) {
    const int block = samples.block[i];
    const Sample& sample = samples.at[i];
    PixelBlock& pixels = state.blocks[block];
    const V transmittance = hn::Load(df, pixels.transmittance);
    const V blended = hn::Mul(transmittance, hn::Min(hn::Load(df, sample.value), set(kAlphaMax)));
    const V next = hn::Sub(transmittance, blended);
    const M goes_on = hn::Ge(next, set(kTransmittanceStop));
    V left = hn::IfThenElse(goes_on, next, transmittance);
    const M ends = hn::AndNot(goes_on, hn::Gt(transmittance, hn::Zero(df)));
    if (HWY_UNLIKELY(!hn::AllFalse(df, ends))) {
      left = hn::IfThenElse(ends, hn::Neg(transmittance), left);
      if constexpr (kMode == Mode::training) {
        hn::BlendedStore(hn::Set(di, static_cast<std::int32_t>(position)), hn::RebindMask(di, ends), di,
                         state.stop + block * kLanes);
      }
      if (hn::AllTrue(df, hn::Le(left, hn::Zero(df)))) {
        state.live.words[block / 64] &= ~(std::uint64_t{1} << (block % 64));
      }
    }
    hn::Store(left, df, pixels.transmittance);
    const V weight = hn::IfThenElseZero(goes_on, blended);
    for (int ch = 0; ch < 3; ++ch) {
      V color = base[ch];
      if constexpr (kTexture && !kAll) color = hn::Add(color, hn::Load(df, texture.color[i][ch]));
      addTo(pixels.color[ch], weight, color);
      if constexpr (kAll) {
        addTo(outputs.normal[ch] + block * kLanes, weight, set(s.normal[ch]));
        if constexpr (kTexture) {
          addTo(outputs.texture[ch] + block * kLanes, weight, hn::Load(df, texture.color[i][ch]));
        }
      }
    }
    if constexpr (kAll) {
      const V x = columnX(s, tile_x, block / kTileHeight);
      const V depth = hitDepth(s, rows.y[block % kTileHeight], x, hn::Load(df, sample.inverse_d2));
      addTo(outputs.depth + block * kLanes, weight, depth);
      const V shows = hn::IfThenElseZero(hn::Gt(weight, hn::Zero(df)), set(1.0f));
      addTo(outputs.count + block * kLanes, shows, set(1.0f));
      if (outputs.wants_median) {
        const M halves = hn::And(goes_on, hn::And(hn::Ge(transmittance, set(0.5f)), hn::Lt(next, set(0.5f))));
        hn::BlendedStore(depth, halves, df, outputs.depth_median + block * kLanes);
      }
      if (kTexture && outputs.wants_density) {
        addTo(outputs.density + block * kLanes, weight, set(s.texel_density));
        addTo(outputs.textured_weight + block * kLanes, weight, set(1.0f));
      }
    }
  }
}

// Marks pixels outside the image as done.
HWY_INLINE void clear(ColorState& state, int width, int height, std::int32_t list_size) {
  std::fill_n(state.stop, kTilePixels, list_size);
  state.live = {};
  for (int block = 0; block < kBlocks; ++block) {
    const int row = block % kTileHeight;
    const int column = block / kTileHeight;
    const int columns_left = row < height ? std::clamp(width - column * kLanes, 0, kLanes) : 0;
    PixelBlock& pixels = state.blocks[block];
    hn::Store(hn::IfThenElse(hn::FirstN(df, static_cast<std::size_t>(columns_left)), set(1.0f), set(-1.0f)), df,
              pixels.transmittance);
    for (int ch = 0; ch < 3; ++ch) hn::Store(hn::Zero(df), df, pixels.color[ch]);
    if (columns_left > 0) state.live.words[block / 64] |= std::uint64_t{1} << (block % 64);
  }
}

// Calls put(pixel of the image, block, lane) for every pixel of a tile inside the image.
template <typename Put>
HWY_INLINE void forEachPixel(const View& view, int tile_x, int tile_y, const Put& put) {
  const int width = std::min(kTileWidth, view.size.x - tile_x);
  const int height = std::min(kTileHeight, view.size.y - tile_y);
  for (int row = 0; row < height; ++row) {
    for (int x = 0; x < width; ++x) {
      put(static_cast<std::size_t>(tile_y + row) * view.size.x + tile_x + x, x / kLanes * kTileHeight + row,
          x % kLanes);
    }
  }
}

template <Mode kMode>
void blendTile(const BlendArgs& args, int tile) {
  constexpr bool kAll = kMode == Mode::all;
  const View& view = args.view;
  const int tile_x = args.lists.pixelX(tile);
  const int tile_y = args.lists.pixelY(tile);
  const int width = std::min(kTileWidth, view.size.x - tile_x);
  const int height = std::min(kTileHeight, view.size.y - tile_y);
  const std::span<const std::uint32_t> list = args.lists.list(tile);
  std::uint64_t* record = nullptr;
  if constexpr (kMode == Mode::training) {
    record = args.record->blocks.data() + std::size_t{args.lists.begin[tile]} * kWords;
  }

  ColorState state;
  clear(state, width, height, static_cast<std::int32_t>(list.size()));
  OutputState outputs;
  if constexpr (kAll) {
    outputs = {};
    outputs.wants_median = !args.frame->depth_median.empty();
    outputs.wants_density = !args.frame->texel_density.empty();
  }
  Rows rows;
  Samples samples;
  TextureSamples texture;
  const auto any_lane = [](M visible, int) HWY_ATTR { return visible; };
  constexpr Keep kKeepUntextured = kAll ? Keep::hit : Keep::value;
  std::uint32_t position = 0;
  for (; position < list.size() && !empty(state.live); ++position) {
    const Splat& s = args.splats[list[position]];
    if (position + kSplatsAhead < list.size()) {
      prefetchSplat(args.splats[list[position + kSplatsAhead]]);
      prefetchTexels(args.splats[list[position + 1]], args.texels.texels);
    }
    BlockSet candidates = findBlocks(s, tile_x, tile_y, rows);
    for (int word = 0; word < kWords; ++word) candidates.words[word] &= state.live.words[word];
    if (s.texture_width > 0) {
      evaluate<Keep::hit>(s, rows, tile_x, candidates, any_lane, samples);
      applyTexture(s, args.texels, view, rows, tile_x, tile_y, samples, texture);
      blendSplat<kMode, true>(s, position, tile_x, rows, samples, texture, state, outputs);
    } else {
      evaluate<kKeepUntextured>(s, rows, tile_x, candidates, any_lane, samples);
      blendSplat<kMode, false>(s, position, tile_x, rows, samples, texture, state, outputs);
    }
    if constexpr (kMode == Mode::training) {
      std::copy_n(samples.set.words, kWords, record + std::size_t{position} * kWords);
    }
  }
  if constexpr (kMode == Mode::training) {
    std::fill_n(record + std::size_t{position} * kWords, (list.size() - position) * kWords, std::uint64_t{0});
  }

  forEachPixel(view, tile_x, tile_y, [&](std::size_t pixel, int block, int lane) {
    const int at = block * kLanes + lane;
    const PixelBlock& pixels = state.blocks[block];
    const float transmittance = std::abs(pixels.transmittance[lane]);
    const glm::vec3 color = glm::vec3(pixels.color[0][lane], pixels.color[1][lane], pixels.color[2][lane]) +
                            transmittance * view.background;
    if constexpr (kMode == Mode::training) {
      const int row = block % kTileHeight;
      const int x = block / kTileHeight * kLanes + lane;
      const std::size_t recorded = static_cast<std::size_t>(tile) * kTilePixels + row * kTileWidth + x;
      (*args.picture)[pixel - static_cast<std::size_t>(args.lists.firstPixelY()) * view.size.x] = color;
      args.record->transmittance[recorded] = transmittance;
      args.record->stop[recorded] = state.stop[at];
      return;
    }
    PixelSums sums;
    sums.color = color;
    sums.alpha = 1.0f - transmittance;
    if constexpr (kAll) {
      sums.texture = {outputs.texture[0][at], outputs.texture[1][at], outputs.texture[2][at]};
      sums.normal = {outputs.normal[0][at], outputs.normal[1][at], outputs.normal[2][at]};
      sums.weighted_depth = outputs.depth[at];
      sums.count = outputs.count[at];
      sums.depth_median = outputs.depth_median[at];
      sums.weighted_density = outputs.density[at];
      sums.textured_weight = outputs.textured_weight[at];
    }
    putPixel(*args.frame, pixel, sums);
  });
}

// How many splats have an alpha above the cut at each pixel, opaque or not.
void countTile(const BlendArgs& args, int tile) {
  const int tile_x = tile % args.lists.tiles_x * kTileWidth;
  const int tile_y = tile / args.lists.tiles_x * kTileHeight;
  alignas(64) float count[kBlocks][kLanes] = {};
  Rows rows;
  Samples samples;
  TextureSamples texture;
  const auto any_lane = [](M visible, int) HWY_ATTR { return visible; };
  for (const std::uint32_t k : args.lists.list(tile)) {
    const Splat& s = args.splats[k];
    const BlockSet candidates = findBlocks(s, tile_x, tile_y, rows);
    evaluate<Keep::hit>(s, rows, tile_x, candidates, any_lane, samples);
    if (s.texture_width > 0) applyTexture(s, args.texels, args.view, rows, tile_x, tile_y, samples, texture);
    for (int i = 0; i < samples.count; ++i) {
      const V value = hn::Load(df, samples.at[i].value);
      addTo(count[samples.block[i]], hn::IfThenElseZero(hn::Gt(value, hn::Zero(df)), set(1.0f)), set(1.0f));
    }
  }
  forEachPixel(args.view, tile_x, tile_y,
               [&](std::size_t pixel, int block, int lane) { args.frame->overdraw[pixel] = count[block][lane]; });
}

void blendAllTile(const BlendArgs& args, int tile) { blendTile<Mode::all>(args, tile); }
void blendPictureTile(const BlendArgs& args, int tile) { blendTile<Mode::picture>(args, tile); }
void blendTrainingTile(const BlendArgs& args, int tile) { blendTile<Mode::training>(args, tile); }
int blockWords() { return kWords; }

}  // namespace
}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(blendAllTile);
HWY_EXPORT(blendPictureTile);
HWY_EXPORT(blendTrainingTile);
HWY_EXPORT(countTile);
HWY_EXPORT(blockWords);

namespace {

template <typename Body>
void forEachTile(const TileLists& lists, const Body& body) {
  parallelFor(lists.tiles(), 1, [&](std::int64_t tile) { body(static_cast<int>(tile)); });
}

bool holdsAny(const Frame& frame, OutputSet outputs) {
  bool any = false;
  forEachPlane([&](Output output, const auto& pixels) { any |= outputs.has(output) && !pixels.empty(); }, frame);
  return any;
}

}  // namespace

void blendFrame(const View& view, const ScreenSplats& screen, const TileLists& lists, Texels texels, Frame& frame) {
  TG_ASSERT(lists.tiles_y == tileRowsOf(view), "a frame is of all rows of tiles");
  TG_ASSERT(frame.width == view.size.x && frame.height == view.size.y, "the frame has the view's size");
  TG_ASSERT(lists.begin.size() == static_cast<std::size_t>(lists.tiles()) + 1, "a list a tile");
  TG_ASSERT(!view.footprint || texels.means != nullptr, "the footprint filter needs the textures' means");
  const BlendArgs args{view, screen.splats.data(), lists, texels, &frame, nullptr, nullptr};
  if (!frame.overdraw.empty()) forEachTile(lists, [&](int tile) { HWY_DYNAMIC_DISPATCH(countTile)(args, tile); });
  if (!holdsAny(frame, kOrderedOutputs)) return;
  const bool all = holdsAny(frame, kOrderedOutputs.without(kPictureOutputs));
  if (view.order == SplatOrder::perPixel) {
    blendInOrder(view, screen, lists, texels, all, frame);
  } else if (all) {
    forEachTile(lists, [&](int tile) { HWY_DYNAMIC_DISPATCH(blendAllTile)(args, tile); });
  } else {
    forEachTile(lists, [&](int tile) { HWY_DYNAMIC_DISPATCH(blendPictureTile)(args, tile); });
  }
}

void blendPicture(const View& view, const ScreenSplats& screen, const TileLists& lists, const glm::vec4* texels,
                  std::vector<glm::vec3>& picture, BlendRecord& record) {
  TG_ASSERT(lists.begin.size() == static_cast<std::size_t>(lists.tiles()) + 1, "a list a tile");
  TG_ASSERT(view.order == SplatOrder::global, "training blends in the global order");
  const int rows = std::min(view.size.y, lists.firstPixelY() + lists.tiles_y * kTileHeight) - lists.firstPixelY();
  picture.resize(static_cast<std::size_t>(view.size.x) * std::max(rows, 0));
  record.transmittance.resize(static_cast<std::size_t>(lists.tiles()) * kTilePixels);
  record.stop.resize(record.transmittance.size());
  record.words_per_pair = HWY_DYNAMIC_DISPATCH(blockWords)();
  record.blocks.resize(lists.splats.size() * static_cast<std::size_t>(record.words_per_pair));
  const BlendArgs args{view, screen.splats.data(), lists, {texels, nullptr}, nullptr, &picture, &record};
  forEachTile(lists, [&](int tile) { HWY_DYNAMIC_DISPATCH(blendTrainingTile)(args, tile); });
}

}  // namespace tg::cpu
#endif
