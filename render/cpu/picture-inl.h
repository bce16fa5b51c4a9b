// SPDX-License-Identifier: Apache-2.0
// The pixel loop of the picture alone, once per SIMD target: a batch of a tile's splats, and what it does to the tile's
// pixels.
#include <bit>

#include "render/cpu/bit_places.h"
#include "render/cpu/kernel-inl.h"
#include "render/cpu/picture.h"
#include "render/cpu/small_texture-inl.h"
#include "render/cpu/texture_samples-inl.h"

// Compiled once per target: not `#pragma once`.
#if defined(TG_RENDER_CPU_PICTURE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TG_RENDER_CPU_PICTURE_INL_H
#undef TG_RENDER_CPU_PICTURE_INL_H
#else
#define TG_RENDER_CPU_PICTURE_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

constexpr int kBatch = 16;
constexpr int kItemsAtOnce = 32, kHitsAtOnce = 16;
constexpr int kColumnBits = std::bit_width(static_cast<unsigned>(kColumns)) - 1;
static_assert(kColumns == 1 << kColumnBits);
constexpr float kLog2AlphaMin = -7.99435344f;

// Splats of a tile, ready for its pixels. Blocks are row by row here: row * kColumns + column.
struct HitBatch {
  // Rows of kernel-inl.h, with room for a vector that hangs over.
  alignas(64) float row_w[kBatch * kTileHeight + kLanes];
  alignas(64) float row_w2[kBatch * kTileHeight + kLanes];
  alignas(64) float row_d[kBatch * kTileHeight + kLanes];
  alignas(64) float row_d2[kBatch * kTileHeight + kLanes];
  alignas(64) float column_w[kBatch * kTileWidth];  // w_xx x
  alignas(64) float column_d[kBatch * kTileWidth];
  float log2_opacity[kBatch];
  float base[3][kBatch];
  const PictureSplat* splats[kBatch];
  const PictureHit* hits[kBatch];                      // null where blending need not look
  int ends[kBatch];                                    // of the slots' items
  std::uint16_t items[kBatch * kBlocks + 2 * kLanes];  // slot * kBlocks + block, in the order of splats
  int count;
};

struct PixelBlock {
  alignas(4 * kLanes) float transmittance[kLanes];  // negative: the pixel is done, its magnitude is what is left
  float color[3][kLanes];
};
// Where a tile lies [px], and what its textured splats need.
struct TileView {
  const View& view;
  Texels texels;
  int x, y;
};
struct TileState {
  alignas(64) PixelBlock blocks[kBlocks];
  std::uint32_t live[kColumns];  // a bit per row: blocks with a pixel that is not done
};
static_assert(kTileHeight == 32);

constexpr int kRowsAtOnce = std::min(kLanes, 8);  // a byte of bits at most
using Items = HWY_CAPPED(std::uint16_t, kRowsAtOnce);
using ItemBytes = hn::Rebind<std::uint8_t, Items>;
static_assert(hn::MaxLanes(Items()) == kRowsAtOnce);
// Appends first + (place << kShift) of the bits that are set. Returns the end; what lies behind it is spoilt.
template <int kShift>
HWY_INLINE std::uint16_t* appendPlaces(std::size_t bits, hn::Vec<Items> first, std::uint16_t* out) {
  constexpr Items d16;
  constexpr ItemBytes d8;
  const auto places = hn::PromoteTo(d16, hn::LoadU(d8, kBitPlaces[bits].data()));
  hn::StoreU(hn::Add(hn::ShiftLeft<kShift>(places), first), d16, out);
  return out + std::popcount(bits);
}

// Puts a splat into a slot and appends the live blocks that it may show in: findBlocks() of kernel-inl.h, from the
// splat's first row on.
HWY_INLINE void addSplat(const PictureSplat& s, int slot, int tile_x, int tile_y, const TileState& state,
                         HitBatch& batch) {
  const Outline outline = makeOutline(s, 1.0004f * (s.log2_opacity + 7.99435344f));   // log2(255): as Splat::radius2
  const float margin = 0.05f + 2e-3f * std::sqrt(outline.radius2 * outline.inverse);  // [px] of half the longest row
  const float x = s.center_x - static_cast<float>(tile_x), y = s.center_y - static_cast<float>(tile_y);
  for (int c = 0; c < kColumns; ++c) {
    const V column_x = hn::Sub(hn::Iota(df, static_cast<float>(c * kLanes) + 0.5f), set(x));
    hn::Store(hn::Mul(set(s.w_xx), column_x), df, batch.column_w + slot * kTileWidth + c * kLanes);
    hn::Store(hn::Mul(set(s.d_xx), column_x), df, batch.column_d + slot * kTileWidth + c * kLanes);
  }
  batch.log2_opacity[slot] = s.log2_opacity;
  for (int ch = 0; ch < 3; ++ch) batch.base[ch][slot] = s.base[ch];
  const auto [row_begin, row_end] = rowRange(s, tile_y);
  const std::uint32_t rows = (~0u >> (kTileHeight - row_end)) & (~0u << row_begin);
  std::uint32_t meets[kColumns] = {};  // a bit per row
  for (int r = row_begin; r < row_end; r += kLanes) {
    const RowTerms row = rowTerms(s, hn::Sub(hn::Iota(df, static_cast<float>(r) + 0.5f), set(y)));
    hn::StoreU(row.w, df, batch.row_w + slot * kTileHeight + r);
    hn::StoreU(row.w2, df, batch.row_w2 + slot * kTileHeight + r);
    hn::StoreU(row.d, df, batch.row_d + slot * kTileHeight + r);
    hn::StoreU(row.d2, df, batch.row_d2 + slot * kTileHeight + r);
    const Span span = rowSpan(outline, row, x, margin);
    for (int c = 0; c < kColumns; ++c) meets[c] |= bitsOf(meetsColumn(span, c)) << r;
  }
  constexpr Items d16;
  std::uint16_t* out = batch.items + batch.count;
  // How often this loop goes round does not depend on the bits, which are known late.
  for (int c = 0; c < kColumns; ++c) meets[c] = (outline.bounded ? meets[c] : ~0u) & rows & state.live[c];
  auto first = hn::Set(d16, static_cast<std::uint16_t>(slot * kBlocks + row_begin * kColumns));
  for (int r = row_begin; r < row_end; r += kRowsAtOnce) {
    for (int c = 0; c < kColumns; ++c) {
      out = appendPlaces<kColumnBits>(meets[c] >> r & ((1u << kRowsAtOnce) - 1),
                                      hn::Add(first, hn::Set(d16, static_cast<std::uint16_t>(c))), out);
    }
    first = hn::Add(first, hn::Set(d16, kRowsAtOnce * kColumns));
  }
  batch.count = static_cast<int>(out - batch.items);
}

// Whether a splat's hits in a tile may lie before its near plane. t |D|^2 - near |D|^2 > 0 is a linear function less a
// convex one: where it holds at the corners of a rectangle, it holds within.
HWY_INLINE bool meetsNear(const PictureSplat& s, const PictureHit& hit, int tile_x, int tile_y) {
  for (int corner = 0; corner < 4; ++corner) {
    const float x = static_cast<float>(tile_x + (corner & 1) * kTileWidth) - s.center_x;
    const float y = static_cast<float>(tile_y + (corner >> 1) * kTileHeight) - s.center_y;
    const float d = s.d_xx * x + s.d_xy * y + s.d_x1, d_y = s.d_yy * y + s.d_y1;
    const float d2 = d * d + d_y * d_y + s.d_11 * s.d_11;
    if (!(hit.t_x * x + hit.t_y * y + hit.t_1 > 1.001f * hit.near * d2)) return true;
  }
  return false;
}

// What of an item evaluation leaves to the texture.
struct ItemHit {
  V inverse_d2;  // 1 / |D|^2
  M visible;     // by the exponent alone
  V exponent;
};
HWY_INLINE ItemHit hitItem(const HitBatch& batch, unsigned item) {
  const unsigned slot = item / kBlocks, row = item / kColumns;
  const unsigned column = (slot * kColumns + item % kColumns) * kLanes;
  const V w = hn::Add(hn::Load(df, batch.column_w + column), set(batch.row_w[row]));
  const V d = hn::Add(hn::Load(df, batch.column_d + column), set(batch.row_d[row]));
  const V w2 = hn::MulAdd(w, w, set(batch.row_w2[row]));
  const V inverse_d2 = hn::Div(set(1.0f), hn::MulAdd(d, d, set(batch.row_d2[row])));
  const V exponent = hn::NegMulAdd(w2, inverse_d2, set(batch.log2_opacity[slot]));
  return {inverse_d2, hn::Ge(exponent, set(kLog2AlphaMin)), exponent};
}

// Blends a splat's share into a block. color(ch): of base and texture.
template <class Color>
HWY_INLINE void blendItem(V alpha, const Color& color, PixelBlock& pixels) {
  const V transmittance = hn::Load(df, pixels.transmittance);
  const V blended = hn::Mul(transmittance, alpha);
  const V next = hn::Sub(transmittance, blended);
  const M goes_on = hn::Ge(next, set(kTransmittanceStop));
  hn::Store(hn::IfThenElse(goes_on, next, hn::Or(transmittance, set(-0.0f))), df, pixels.transmittance);
  const V weight = hn::IfThenElseZero(goes_on, blended);
  for (int ch = 0; ch < 3; ++ch) {
    hn::Store(hn::MulAdd(weight, color(ch), hn::Load(df, pixels.color[ch])), df, pixels.color[ch]);
  }
}

// Items [begin, end), of splats without a PictureHit.
HWY_INLINE void blendItems(const HitBatch& batch, int begin, int end, PixelBlock* blocks) {
  alignas(64) float alphas[kItemsAtOnce * kLanes];
  while (begin < end) {
    const int count = std::min(end - begin, kItemsAtOnce);
    for (int i = 0; i < count; ++i) {
      const ItemHit hit = hitItem(batch, batch.items[begin + i]);
      const V value = hn::Min(exp2InRange(hit.exponent), set(kAlphaMax));
      hn::Store(hn::IfThenElseZero(hit.visible, value), df, alphas + i * kLanes);
    }
    for (int i = 0; i < count; ++i) {
      const unsigned item = batch.items[begin + i];
      const unsigned slot = item / kBlocks;
      const auto base = [&](int ch) HWY_ATTR { return set(batch.base[ch][slot]); };
      blendItem(hn::Load(df, alphas + i * kLanes), base, blocks[item % kBlocks]);
    }
    begin += count;
  }
}

// Items of one splat on their way through its texture, and the runs of lanes that fall into one texel cell.
struct TextureItems {
  alignas(64) float value[kHitsAtOnce][kLanes];  // opacity * G, 0 where the splat does not show
  alignas(64) float fraction_u[kHitsAtOnce][kLanes];
  alignas(64) float fraction_v[kHitsAtOnce][kLanes];
  alignas(64) std::int32_t cell[kHitsAtOnce][kLanes];  // -1 where the texture does not apply
  alignas(64) float texture[kHitsAtOnce][4][kLanes];   // colour and alpha's deviation from 1; 0 where it doesn't apply
  std::uint16_t runs[kHitsAtOnce * kLanes + 2 * kLanes];  // item * kLanes + first lane
};

// Appends the runs of item i: lanes that are inside and whose cell is not the one before. inside: a bit per lane. A
// cell may have two runs in an item.
HWY_INLINE std::uint16_t* appendRuns(std::uint32_t inside, VI cell, int i, std::uint16_t* out) {
  const auto before = hn::IndicesFromVec(di, hn::Max(hn::Sub(hn::Iota(di, 0), hn::Set(di, 1)), hn::Zero(di)));
  const M changes = hn::RebindMask(df, hn::Ne(cell, hn::TableLookupLanes(cell, before)));
  const std::uint32_t starts = (bitsOf(changes) | 1u) & inside;
  for (int part = 0; part < kLanes; part += kRowsAtOnce) {
    const auto first = hn::Set(Items(), static_cast<std::uint16_t>(i * kLanes + part));
    out = appendPlaces<0>(starts >> part & ((1u << kRowsAtOnce) - 1), first, out);
  }
  return out;
}

// Looks up the four texels of a run's cell, for all lanes of its item that fall into it: without a branch on how many
// cells an item meets, which would wait for the hit.
HWY_INLINE void lookUpRun(const Texture& texture, unsigned run, TextureItems& items) {
  const unsigned i = run / kLanes;
  const std::int32_t cell = items.cell[i][run % kLanes];
  const float* t00 = texture.texels + std::ptrdiff_t{4} * cell;
  const float* t10 = t00 + texture.step_u;
  const float* t01 = t00 + texture.step_v;
  const float* t11 = t01 + texture.step_u;
  using Texels4 = HWY_CAPPED(float, 4);
  constexpr Texels4 d4;
  alignas(16) constexpr float kNeutral[4] = {0, 0, 0, 1};
  alignas(16) float first[4], along_u[4], along_v[4], both[4];
  for (std::size_t ch = 0; ch < 4; ch += hn::MaxLanes(Texels4())) {
    const auto at = hn::LoadU(d4, t00 + ch);
    const auto to_u = hn::Sub(hn::LoadU(d4, t10 + ch), at);
    hn::Store(hn::Sub(at, hn::Load(d4, kNeutral + ch)), d4, first + ch);
    hn::Store(to_u, d4, along_u + ch);
    hn::Store(hn::Sub(hn::LoadU(d4, t01 + ch), at), d4, along_v + ch);
    hn::Store(hn::Sub(hn::Sub(hn::LoadU(d4, t11 + ch), hn::LoadU(d4, t01 + ch)), to_u), d4, both + ch);
  }
  const M lanes = hn::RebindMask(df, hn::Eq(hn::Load(di, items.cell[i]), hn::Set(di, cell)));
  const V u = hn::Load(df, items.fraction_u[i]), v = hn::Load(df, items.fraction_v[i]);
  for (int ch = 0; ch < 4; ++ch) {
    const V low = hn::MulAdd(u, set(along_u[ch]), set(first[ch]));
    const V value = hn::MulAdd(v, hn::MulAdd(u, set(both[ch]), set(along_v[ch])), low);
    float* out = items.texture[i][ch];
    hn::Store(hn::IfThenElse(lanes, value, hn::Load(df, out)), df, out);
  }
}

// The footprint filter, where the texture applies.
HWY_INLINE void fadeToMean(const TextureMean& mean, int count, TextureItems& items) {
  for (int i = 0; i < count; ++i) {
    const M inside = hn::RebindMask(df, hn::Gt(hn::Load(di, items.cell[i]), hn::Set(di, -1)));
    for (int ch = 0; ch < 4; ++ch) {
      float* at = items.texture[i][ch];
      const V sharp = hn::Mul(hn::Load(df, at), set(1.0f - mean.share));
      hn::Store(hn::Add(sharp, hn::IfThenElseZero(inside, set(mean.value[ch]))), df, at);
    }
  }
}

// Items of one splat on their way through a small texture.
struct SmallItems {
  alignas(64) float value[kHitsAtOnce][kLanes];  // opacity * G, 0 where the splat does not show
  alignas(64) float u[kHitsAtOnce][kLanes];      // SmallPoint
  alignas(64) float v[kHitsAtOnce][kLanes];
};

// Items [begin, end), all of the splat in `slot`, which has a small texture.
template <int kSide, bool kCrossesNear, TextureOutside kOutside>
HWY_INLINE void blendSmallHits(const HitBatch& batch, int slot, int begin, int end, const TileView& tile,
                               PixelBlock* blocks) {
  const PictureSplat& s = *batch.splats[slot];
  const PictureHit& hit = *batch.hits[slot];
  const V base[3] = {set(s.base.x), set(s.base.y), set(s.base.z)};
  const Texture texture = makeTexture(hit, tile.texels.texels);
  SmallTexture<kSide> small;
  fillSmall(texture, hit.texture_width, hit.texture_height, tile.view.texture_rgb, tile.view.texture_alpha, small);
  TileRays rays;
  fillRays(s, hit, tile.x, tile.y, rowRange(s, tile.y), rays);
  SmallItems items;
  while (begin < end) {
    const int count = std::min(end - begin, kHitsAtOnce);
    for (int i = 0; i < count; ++i) {
      const unsigned item = batch.items[begin + i];
      const unsigned row = item % kBlocks / kColumns, column = item % kColumns * kLanes;
      const ItemHit at = hitItem(batch, item);
      M visible = at.visible;
      if constexpr (kCrossesNear) {
        const float y = static_cast<float>(tile.y) + static_cast<float>(row) + 0.5f - s.center_y;
        const float left = static_cast<float>(tile.x) + static_cast<float>(column) + 0.5f;
        const V x = hn::Sub(hn::Iota(df, left), set(s.center_x));
        const V t = hn::Mul(hn::MulAdd(set(hit.t_x), x, set(hit.t_y * y + hit.t_1)), at.inverse_d2);
        visible = hn::And(visible, hn::Gt(t, set(hit.near)));
      }
      const V value = hn::IfThenElseZero(visible, exp2InRange(at.exponent));
      hn::Store(value, df, items.value[i]);
      constexpr bool kEdge = kOutside == TextureOutside::edge;
      // On the border lanes that do not show would have weights, which may be no numbers.
      const V inverse_d2 = kEdge ? hn::IfThenElseZero(visible, at.inverse_d2) : at.inverse_d2;
      const SmallPoint point =
          locateSmall<kEdge>(texture, rays.at(static_cast<int>(row), static_cast<int>(column)), inverse_d2);
      if constexpr (kOutside == TextureOutside::clip) {
        hn::Store(hn::IfThenElseZero(isInside(point), value), df, items.value[i]);
      }
      hn::Store(point.u, df, items.u[i]);
      hn::Store(point.v, df, items.v[i]);
    }
    for (int i = 0; i < count; ++i) {
      const SmallTaps taps = smallTaps(small, {hn::Load(df, items.u[i]), hn::Load(df, items.v[i])});
      const V factor = addSmall(small, 3, taps, set(1.0f));
      const V value = cutAlpha(hn::Mul(hn::Load(df, items.value[i]), factor));
      const auto color = [&](int ch) HWY_ATTR { return addSmall(small, ch, taps, base[ch]); };
      blendItem(hn::Min(value, set(kAlphaMax)), color, blocks[batch.items[begin + i] % kBlocks]);
    }
    begin += count;
  }
}

// The same of a texture that is small, but not the smallest; out of line, as is what follows blendHits().
template <bool kCrossesNear, TextureOutside kOutside>
HWY_NOINLINE void blendWideHits(const HitBatch& batch, int slot, int begin, int end, const TileView& tile,
                                PixelBlock* blocks) {
  blendSmallHits<kWideSide, kCrossesNear, kOutside>(batch, slot, begin, end, tile, blocks);
}

// Items [begin, end), all of the splat in `slot`, which has a PictureHit.
template <TextureOutside kOutside>
HWY_INLINE void blendHits(const HitBatch& batch, int slot, int begin, int end, const TileView& tile,
                          PixelBlock* blocks) {
  const PictureSplat& s = *batch.splats[slot];
  const PictureHit& hit = *batch.hits[slot];
  const bool textured = hit.texture_width > 0;
  const bool crosses_near = hit.near > 0.0f && meetsNear(s, hit, tile.x, tile.y);
  const TextureMean mean = textured ? textureMean(hit, tile.texels, tile.view) : TextureMean{};
  if constexpr (kSmallTextures) {
    if (textured && isSmall(hit) && !(mean.share > 0.0f)) {
      if (crosses_near) {
        blendSmallHits<kSmallSide, true, kOutside>(batch, slot, begin, end, tile, blocks);
      } else {
        blendSmallHits<kSmallSide, false, kOutside>(batch, slot, begin, end, tile, blocks);
      }
      return;
    }
  }
  if constexpr (kWideTextures) {
    if (textured && isWide(hit) && !(mean.share > 0.0f)) {
      if (crosses_near) {
        blendWideHits<true, kOutside>(batch, slot, begin, end, tile, blocks);
      } else {
        blendWideHits<false, kOutside>(batch, slot, begin, end, tile, blocks);
      }
      return;
    }
  }
  const V base[3] = {set(s.base.x), set(s.base.y), set(s.base.z)};
  const Texture texture = textured ? makeTexture(hit, tile.texels.texels) : Texture{};
  TextureItems items;
  while (begin < end) {
    const int count = std::min(end - begin, kHitsAtOnce);
    std::uint16_t* runs_end = items.runs;
    for (int i = 0; i < count; ++i) {
      const unsigned item = batch.items[begin + i];
      const int block = static_cast<int>(item % kBlocks);
      const ItemHit at = hitItem(batch, item);
      M visible = at.visible;
      const float y = static_cast<float>(tile.y + block / kColumns) + 0.5f - s.center_y;
      const float left = static_cast<float>(tile.x + block % kColumns * kLanes) + 0.5f;
      const V x = hn::Sub(hn::Iota(df, left), set(s.center_x));
      if (crosses_near) {
        const V t = hn::Mul(hn::MulAdd(set(hit.t_x), x, set(hit.t_y * y + hit.t_1)), at.inverse_d2);
        visible = hn::And(visible, hn::Gt(t, set(hit.near)));
      }
      hn::Store(hn::IfThenElseZero(visible, exp2InRange(at.exponent)), df, items.value[i]);
      if (!textured) continue;
      constexpr bool kEdge = kOutside == TextureOutside::edge;
      const TexturePoint point = locate<kEdge>(texture, localRay(hit, set(y), x), at.inverse_d2, visible);
      if constexpr (kOutside == TextureOutside::clip) {
        hn::Store(hn::IfThenElseZero(point.inside, hn::Load(df, items.value[i])), df, items.value[i]);
      }
      const VI cell = hn::IfThenElse(hn::RebindMask(di, point.inside), point.cell, hn::Set(di, -1));
      hn::Store(cell, di, items.cell[i]);
      hn::Store(point.fraction_u, df, items.fraction_u[i]);
      hn::Store(point.fraction_v, df, items.fraction_v[i]);
      for (float* to : items.texture[i]) hn::Store(hn::Zero(df), df, to);
      runs_end = appendRuns(bitsOf(point.inside), cell, i, runs_end);
    }
    for (const std::uint16_t* run = items.runs; run != runs_end; ++run) lookUpRun(texture, *run, items);
    if (mean.share > 0.0f) fadeToMean(mean, count, items);
    for (int i = 0; i < count; ++i) {
      PixelBlock& pixels = blocks[batch.items[begin + i] % kBlocks];
      V value = hn::Load(df, items.value[i]);
      if (!textured) {
        blendItem(hn::Min(value, set(kAlphaMax)), [&](int ch) HWY_ATTR { return base[ch]; }, pixels);
        continue;
      }
      const auto look = [&](int ch) HWY_ATTR { return hn::Load(df, items.texture[i][ch]); };
      if (tile.view.texture_alpha) value = cutAlpha(hn::Mul(value, hn::Add(set(1.0f), look(3))));
      const V alpha = hn::Min(value, set(kAlphaMax));
      if (tile.view.texture_rgb) {
        blendItem(alpha, [&](int ch) HWY_ATTR { return hn::Add(base[ch], look(ch)); }, pixels);
      } else {
        blendItem(alpha, [&](int ch) HWY_ATTR { return base[ch]; }, pixels);
      }
    }
    begin += count;
  }
}

// blendHits() of what is not the usual treatment. Out of line: blendBatch() stays as short as without it.
template <TextureOutside kOutside>
HWY_NOINLINE void blendHitsAs(const HitBatch& batch, int slot, int begin, int end, const TileView& tile,
                              PixelBlock* blocks) {
  blendHits<kOutside>(batch, slot, begin, end, tile, blocks);
}

// All items in their order: runs of splats without a PictureHit, and those with one.
HWY_INLINE void blendBatch(const HitBatch& batch, int slots, const TileView& tile, PixelBlock* blocks) {
  int done = 0;
  for (int slot = 0; slot < slots; ++slot) {
    if (HWY_LIKELY(batch.hits[slot] == nullptr)) continue;
    const int begin = slot > 0 ? batch.ends[slot - 1] : 0;
    blendItems(batch, done, begin, blocks);
    done = batch.ends[slot];
    switch (tile.view.outside) {
      case TextureOutside::base:
        blendHits<TextureOutside::base>(batch, slot, begin, done, tile, blocks);
        break;
      case TextureOutside::clip:
        blendHitsAs<TextureOutside::clip>(batch, slot, begin, done, tile, blocks);
        break;
      case TextureOutside::edge:
        blendHitsAs<TextureOutside::edge>(batch, slot, begin, done, tile, blocks);
        break;
    }
  }
  blendItems(batch, done, batch.count, blocks);
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
