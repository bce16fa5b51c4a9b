// SPDX-License-Identifier: Apache-2.0
// The forward pixel loop: per tile, splats front to back; per splat, the rows it meets; per row, vectors of pixels.
#include "render/cpu/blend.h"

#include <algorithm>
#include <bit>

#include "core/parallel.h"

// Structs hold vectors here, which the scalable targets forbid.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/blend.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "render/cpu/kernel-inl.h"
#include "render/cpu/texture-inl.h"

#ifndef TG_RENDER_CPU_BLEND_ARGS
#define TG_RENDER_CPU_BLEND_ARGS
namespace tg::cpu {
struct BlendArgs {
  const View& view;
  const Splat* splats;
  const TileLists& lists;
  const glm::vec4* texels;
  Frame* frame;                     // all outputs, or null:
  std::vector<glm::vec3>* picture;  // the picture
  BlendRecord* record;
};
}  // namespace tg::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

// Pixel state of a tile, [column][row][lane].
struct ColorState {
  alignas(64) float transmittance[kTilePixels];  // negative: the pixel is done, its magnitude is what is left
  alignas(64) float color[3][kTilePixels];       // of base and texture, or of the base alone with kAll
  alignas(64) std::int32_t stop[kTilePixels];
  std::uint32_t live[kColumns];  // bit r: some pixel of row r of this column is not done
};
struct OutputState {
  alignas(64) float texture[3][kTilePixels];
  alignas(64) float normal[3][kTilePixels];
  alignas(64) float depth[kTilePixels];
  alignas(64) float count[kTilePixels];
};

HWY_INLINE void addTo(float* at, V weight, V value) { hn::Store(hn::MulAdd(weight, value, hn::Load(df, at)), df, at); }

// A texture at the blocks of a splat.
struct TextureBlocks {
  alignas(64) float color[3][Blocks::kMax * kLanes];  // 0 where it does not apply
};

// Fills `texture_blocks`, multiplies the values of `blocks` by the alpha factor and drops what falls below the cut.
HWY_INLINE void applyTexture(const Splat& s, const glm::vec4* texels, const View& view, const Rows& rows, int tile_x,
                             Blocks& blocks, TextureBlocks& texture_blocks) {
  const Texture texture = makeTexture(s, texels);
  for (int column = 0; column < kColumns; ++column) {
    const V x = columnX(s, tile_x, column);
    for (int i = blocks.begin[column]; i < blocks.begin[column + 1]; ++i) {
      const V value = hn::Load(df, blocks.value + i * kLanes);
      const TexturePoint at = locate(texture, localRay(s, rows.y[blocks.row[i]], x),
                                     hn::Load(df, blocks.inverse_d2 + i * kLanes), hn::Gt(value, hn::Zero(df)));
      const Corners corners = cornerWeights(at);
      V color[3] = {hn::Zero(df), hn::Zero(df), hn::Zero(df)};
      V alpha = hn::Zero(df);
      forEachCell(at, [&](std::size_t cell, M lanes) HWY_ATTR {
        for (int k = 0; k < 4; ++k) {
          const float* texel = texture.texels + cell + cornerStep(texture, k);
          const V weight = hn::IfThenElseZero(lanes, corners.weight[k]);
          if (view.texture_rgb) {
            for (int ch = 0; ch < 3; ++ch) color[ch] = hn::MulAdd(weight, set(texel[ch]), color[ch]);
          }
          alpha = hn::MulAdd(weight, set(texel[3] - 1.0f), alpha);
        }
      });
      for (int ch = 0; ch < 3; ++ch) hn::Store(color[ch], df, texture_blocks.color[ch] + i * kLanes);
      if (view.texture_alpha) {
        hn::Store(cutAlpha(hn::Mul(value, alphaFactor(at.inside, alpha))), df, blocks.value + i * kLanes);
      }
    }
  }
}

// Blends one splat into a tile.
template <bool kAll, bool kTexture>
HWY_INLINE void blendSplat(const Splat& s, std::uint32_t position, int tile_x, const Rows& rows, const Blocks& blocks,
                           const TextureBlocks& texture, ColorState& state, OutputState& outputs) {
  for (int column = 0; column < kColumns; ++column) {
    const V x = columnX(s, tile_x, column);
    for (int i = blocks.begin[column]; i < blocks.begin[column + 1]; ++i) {
      const int at = blocks.at[i];
      const V alpha = hn::Min(hn::Load(df, blocks.value + i * kLanes), set(kAlphaMax));
      const V transmittance = hn::Load(df, state.transmittance + at);
      const V next = hn::Mul(transmittance, hn::Sub(set(1.0f), alpha));
      const M goes_on = hn::Ge(next, set(kTransmittanceStop));
      V left = hn::IfThenElse(goes_on, next, transmittance);
      const M ends = hn::AndNot(goes_on, hn::Gt(transmittance, hn::Zero(df)));
      if (HWY_UNLIKELY(!hn::AllFalse(df, ends))) {
        left = hn::IfThenElse(ends, hn::Neg(transmittance), left);
        hn::BlendedStore(hn::Set(di, static_cast<std::int32_t>(position)), hn::RebindMask(di, ends), di,
                         state.stop + at);
        if (hn::AllTrue(df, hn::Le(left, hn::Zero(df)))) state.live[column] &= ~(1u << blocks.row[i]);
      }
      hn::Store(left, df, state.transmittance + at);
      const V weight = hn::IfThenElseZero(goes_on, hn::Mul(alpha, transmittance));
      for (int ch = 0; ch < 3; ++ch) {
        V color = set(s.base[ch]);
        if constexpr (kTexture && !kAll) color = hn::Add(color, hn::Load(df, texture.color[ch] + i * kLanes));
        addTo(state.color[ch] + at, weight, color);
        if constexpr (kAll) {
          addTo(outputs.normal[ch] + at, weight, set(s.normal[ch]));
          if constexpr (kTexture) {
            addTo(outputs.texture[ch] + at, weight, hn::Load(df, texture.color[ch] + i * kLanes));
          }
        }
      }
      if constexpr (kAll) {
        const V inverse_d2 = hn::Load(df, blocks.inverse_d2 + i * kLanes);
        addTo(outputs.depth + at, weight, hitDepth(s, rows.y[blocks.row[i]], x, inverse_d2));
        const V blended = hn::IfThenElseZero(hn::Gt(weight, hn::Zero(df)), set(1.0f));
        addTo(outputs.count + at, blended, set(1.0f));
      }
    }
  }
}

// Marks pixels outside the image as done.
HWY_INLINE void clear(ColorState& state, int width, int height, std::int32_t list_size) {
  std::fill_n(&state.color[0][0], 3 * kTilePixels, 0.0f);
  std::fill_n(state.stop, kTilePixels, list_size);
  for (int column = 0; column < kColumns; ++column) {
    state.live[column] = 0;
    for (int row = 0; row < kTileHeight; ++row) {
      if (row < height && column * kLanes < width) state.live[column] |= 1u << row;
      for (int lane = 0; lane < kLanes; ++lane) {
        const bool in_image = row < height && column * kLanes + lane < width;
        state.transmittance[offsetOf(column, row) + lane] = in_image ? 1.0f : -1.0f;
      }
    }
  }
}

template <bool kAll>
void blendTile(const BlendArgs& args, int tile) {
  const View& view = args.view;
  const int tile_x = tile % args.lists.tiles_x * kTileWidth;
  const int tile_y = tile / args.lists.tiles_x * kTileHeight;
  const int width = std::min(kTileWidth, view.width - tile_x);
  const int height = std::min(kTileHeight, view.height - tile_y);
  const std::span<const std::uint32_t> list = args.lists.list(tile);

  ColorState state;
  clear(state, width, height, static_cast<std::int32_t>(list.size()));
  OutputState outputs;
  if constexpr (kAll) outputs = {};
  Rows rows;
  Blocks blocks;
  TextureBlocks texture;
  const auto any_lane = [](int) HWY_ATTR { return hn::FirstN(df, kLanes); };
  for (std::uint32_t position = 0; position < list.size(); ++position) {
    const Splat& s = args.splats[list[position]];
    if (position + 2 < list.size()) {
      prefetchSplat(args.splats[list[position + 2]]);
      prefetchTexels(args.splats[list[position + 1]], args.texels);
    }
    if (!prepareRows(s, tile_x, tile_y, rows)) continue;
    for (int column = 0; column < kColumns; ++column) rows.active[column] &= state.live[column];
    evaluateBlocks(s, rows, tile_x, any_lane, blocks);
    if (s.texture_width > 0) {
      applyTexture(s, args.texels, view, rows, tile_x, blocks, texture);
      blendSplat<kAll, true>(s, position, tile_x, rows, blocks, texture, state, outputs);
    } else {
      blendSplat<kAll, false>(s, position, tile_x, rows, blocks, texture, state, outputs);
    }
    std::uint32_t live = 0;
    for (int column = 0; column < kColumns; ++column) live |= state.live[column];
    if (live == 0) break;
  }

  for (int row = 0; row < height; ++row) {
    for (int x = 0; x < width; ++x) {
      const int at = offsetOf(x / kLanes, row) + x % kLanes;
      const std::size_t pixel = static_cast<std::size_t>(tile_y + row) * view.width + tile_x + x;
      const float transmittance = std::abs(state.transmittance[at]);
      const glm::vec3 color =
          glm::vec3(state.color[0][at], state.color[1][at], state.color[2][at]) + transmittance * view.background;
      if constexpr (kAll) {
        Frame& frame = *args.frame;
        const float sum = 1.0f - transmittance;
        frame.base[pixel] = color;
        frame.texture[pixel] = {outputs.texture[0][at], outputs.texture[1][at], outputs.texture[2][at]};
        frame.alpha[pixel] = sum;
        frame.depth[pixel] = outputs.count[at] > 0.0f ? outputs.depth[at] / sum : 0.0f;
        frame.normal[pixel] = {outputs.normal[0][at], outputs.normal[1][at], outputs.normal[2][at]};
        frame.count[pixel] = outputs.count[at];
      } else {
        const std::size_t recorded = static_cast<std::size_t>(tile) * kTilePixels + row * kTileWidth + x;
        (*args.picture)[pixel] = color;
        args.record->transmittance[recorded] = transmittance;
        args.record->stop[recorded] = state.stop[at];
      }
    }
  }
}

void blendFrameTile(const BlendArgs& args, int tile) { blendTile<true>(args, tile); }
void blendPictureTile(const BlendArgs& args, int tile) { blendTile<false>(args, tile); }

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(blendFrameTile);
HWY_EXPORT(blendPictureTile);

void blendFrame(const View& view, const ScreenSplats& screen, const TileLists& lists, const glm::vec4* texels,
                Frame& frame) {
  const BlendArgs args{view, screen.splats.data(), lists, texels, &frame, nullptr, nullptr};
  parallelFor(lists.tiles(), 1,
              [&](std::int64_t tile) { HWY_DYNAMIC_DISPATCH(blendFrameTile)(args, static_cast<int>(tile)); });
}

void blendPicture(const View& view, const ScreenSplats& screen, const TileLists& lists, const glm::vec4* texels,
                  std::vector<glm::vec3>& picture, BlendRecord& record) {
  picture.resize(static_cast<std::size_t>(view.width) * view.height);
  record.transmittance.resize(static_cast<std::size_t>(lists.tiles()) * kTilePixels);
  record.stop.resize(record.transmittance.size());
  const BlendArgs args{view, screen.splats.data(), lists, texels, nullptr, &picture, &record};
  parallelFor(lists.tiles(), 1,
              [&](std::int64_t tile) { HWY_DYNAMIC_DISPATCH(blendPictureTile)(args, static_cast<int>(tile)); });
}

}  // namespace tg::cpu
#endif
