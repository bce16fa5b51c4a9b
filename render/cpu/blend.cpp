// SPDX-License-Identifier: Apache-2.0
// The forward pixel loop: per tile, splats front to back; per splat, the rows it meets; per row, vectors of pixels.
#include "render/cpu/blend.h"

#include <algorithm>

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

// Pixel state of a block. Interleaved: one stream of stores, and nothing that aliases at the same page offset.
struct PixelBlock {
  alignas(4 * kLanes) float transmittance[kLanes];  // negative: the pixel is done, its magnitude is what is left
  float color[3][kLanes];                           // of base and texture, or of the base alone with kAll
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
};

HWY_INLINE void addTo(float* at, V weight, V value) { hn::Store(hn::MulAdd(weight, value, hn::Load(df, at)), df, at); }

// A texture at the samples of a splat.
struct TextureSamples {
  alignas(64) float color[kBlocks][3][kLanes];  // 0 where it does not apply
};

// Fills `colors`, multiplies the values of `samples` by the alpha factor and drops what falls below the cut.
HWY_INLINE void applyTexture(const Splat& s, const glm::vec4* texels, const View& view, const Rows& rows, int tile_x,
                             Samples& samples, TextureSamples& colors) {
  const Texture texture = makeTexture(s, texels);
  for (int i = 0; i < samples.count; ++i) {
    Sample& sample = samples.at[i];
    const V x = columnX(s, tile_x, samples.block[i] / kTileHeight);
    const V value = hn::Load(df, sample.value);
    const TexturePoint at = locate(texture, localRay(s, rows.y[samples.row(i)], x), hn::Load(df, sample.inverse_d2),
                                   hn::Gt(value, hn::Zero(df)));
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
    for (int ch = 0; ch < 3; ++ch) hn::Store(color[ch], df, colors.color[i][ch]);
    if (view.texture_alpha) hn::Store(cutAlpha(hn::Mul(value, alphaFactor(at.inside, alpha))), df, sample.value);
  }
}

// Blends one splat into a tile.
template <bool kAll, bool kTexture>
HWY_INLINE void blendSplat(const Splat& s, std::uint32_t position, int tile_x, const Rows& rows, const Samples& samples,
                           const TextureSamples& texture, ColorState& state, OutputState& outputs) {
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
      hn::BlendedStore(hn::Set(di, static_cast<std::int32_t>(position)), hn::RebindMask(di, ends), di,
                       state.stop + block * kLanes);
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

template <bool kAll>
void blendTile(const BlendArgs& args, int tile) {
  const View& view = args.view;
  const int tile_x = tile % args.lists.tiles_x * kTileWidth;
  const int tile_y = tile / args.lists.tiles_x * kTileHeight;
  const int width = std::min(kTileWidth, view.width - tile_x);
  const int height = std::min(kTileHeight, view.height - tile_y);
  const std::span<const std::uint32_t> list = args.lists.list(tile);
  std::uint64_t* record = nullptr;
  if constexpr (!kAll) record = args.record->blocks.data() + std::size_t{args.lists.begin[tile]} * kWords;

  ColorState state;
  clear(state, width, height, static_cast<std::int32_t>(list.size()));
  OutputState outputs;
  if constexpr (kAll) outputs = {};
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
      prefetchTexels(args.splats[list[position + 1]], args.texels);
    }
    BlockSet candidates = findBlocks(s, tile_x, tile_y, rows);
    for (int word = 0; word < kWords; ++word) candidates.words[word] &= state.live.words[word];
    if (s.texture_width > 0) {
      evaluate<Keep::hit>(s, rows, tile_x, candidates, any_lane, samples);
      applyTexture(s, args.texels, view, rows, tile_x, samples, texture);
      blendSplat<kAll, true>(s, position, tile_x, rows, samples, texture, state, outputs);
    } else {
      evaluate<kKeepUntextured>(s, rows, tile_x, candidates, any_lane, samples);
      blendSplat<kAll, false>(s, position, tile_x, rows, samples, texture, state, outputs);
    }
    if constexpr (!kAll) std::copy_n(samples.set.words, kWords, record + std::size_t{position} * kWords);
  }
  if constexpr (!kAll) {
    std::fill_n(record + std::size_t{position} * kWords, (list.size() - position) * kWords, std::uint64_t{0});
  }

  for (int row = 0; row < height; ++row) {
    for (int x = 0; x < width; ++x) {
      const int block = x / kLanes * kTileHeight + row;
      const int at = block * kLanes + x % kLanes;
      const PixelBlock& pixels = state.blocks[block];
      const std::size_t pixel = static_cast<std::size_t>(tile_y + row) * view.width + tile_x + x;
      const float transmittance = std::abs(pixels.transmittance[x % kLanes]);
      const glm::vec3 color =
          glm::vec3(pixels.color[0][x % kLanes], pixels.color[1][x % kLanes], pixels.color[2][x % kLanes]) +
          transmittance * view.background;
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
int blockWords() { return kWords; }

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(blendFrameTile);
HWY_EXPORT(blendPictureTile);
HWY_EXPORT(blockWords);

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
  record.words_per_pair = HWY_DYNAMIC_DISPATCH(blockWords)();
  record.blocks.resize(lists.splats.size() * static_cast<std::size_t>(record.words_per_pair));
  const BlendArgs args{view, screen.splats.data(), lists, texels, nullptr, &picture, &record};
  parallelFor(lists.tiles(), 1,
              [&](std::int64_t tile) { HWY_DYNAMIC_DISPATCH(blendPictureTile)(args, static_cast<int>(tile)); });
}

}  // namespace tg::cpu
#endif
