// SPDX-License-Identifier: Apache-2.0
// The pixel loop of the picture alone, once per SIMD target: a batch of a tile's splats, and what it does to the tile's
// pixels.
#include <bit>

#include "render/cpu/bit_places.h"
#include "render/cpu/kernel-inl.h"
#include "render/cpu/picture.h"

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
constexpr int kItemsAtOnce = 32;
constexpr float kLog2AlphaMin = -7.99435344f;

// Splats of a tile, ready for its pixels. Blocks are row by row here: row * kColumns + column.
struct Batch {
  alignas(64) float row_w[kBatch * kTileHeight];  // Rows of kernel-inl.h
  alignas(64) float row_w2[kBatch * kTileHeight];
  alignas(64) float row_d[kBatch * kTileHeight];
  alignas(64) float row_d2[kBatch * kTileHeight];
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
struct TileState {
  alignas(64) PixelBlock blocks[kBlocks];
  std::uint32_t live[kColumns];  // a bit per row: blocks with a pixel that is not done
};
static_assert(kTileHeight == 32);

constexpr int kRowsAtOnce = std::min(kLanes, 8);  // a byte of bits at most
using Items = HWY_CAPPED(std::uint16_t, kRowsAtOnce);
using ItemBytes = hn::Rebind<std::uint8_t, Items>;
static_assert(hn::MaxLanes(Items()) == kRowsAtOnce);
// Appends first + kColumns * row for the rows whose bits are set. Returns their number; what lies behind is spoilt.
HWY_INLINE int appendItems(std::uint32_t bits, int first, std::uint16_t* out) {
  constexpr Items d16;
  constexpr ItemBytes d8;
  const auto places = hn::PromoteTo(d16, hn::LoadU(d8, kBitPlaces[bits].data()));
  const auto items = hn::Add(hn::Mul(places, hn::Set(d16, kColumns)), hn::Set(d16, static_cast<std::uint16_t>(first)));
  hn::StoreU(items, d16, out);
  return std::popcount(bits);
}

// Puts a splat into a slot and appends the live blocks that it may show in: findBlocks() of kernel-inl.h.
HWY_INLINE void addSplat(const PictureSplat& s, int slot, int tile_x, int tile_y, const TileState& state,
                         Batch& batch) {
  const float radius2 = 1.0004f * (s.log2_opacity + 7.99435344f);  // log2(255): as Splat::radius2
  const float leading = s.w_xx * s.w_xx - radius2 * s.d_xx * s.d_xx;
  const bool bounded = leading > 1e-3f * s.w_xx * s.w_xx;
  const float inverse = bounded ? 1.0f / leading : 0.0f;
  const float margin = 0.05f + 2e-3f * std::sqrt(radius2 * inverse);  // [px] of half the longest row
  const float x = s.center_x - static_cast<float>(tile_x), y = s.center_y - static_cast<float>(tile_y);
  for (int c = 0; c < kColumns; ++c) {
    const V column_x = hn::Sub(hn::Iota(df, static_cast<float>(c * kLanes) + 0.5f), set(x));
    hn::Store(hn::Mul(set(s.w_xx), column_x), df, batch.column_w + slot * kTileWidth + c * kLanes);
    hn::Store(hn::Mul(set(s.d_xx), column_x), df, batch.column_d + slot * kTileWidth + c * kLanes);
  }
  batch.log2_opacity[slot] = s.log2_opacity;
  for (int ch = 0; ch < 3; ++ch) batch.base[ch][slot] = s.base[ch];
  const int row_begin = std::max(static_cast<int>(s.y0) - tile_y, 0);
  const int row_end = std::min(static_cast<int>(s.y1) - tile_y, kTileHeight);
  const std::uint32_t rows = (~0u >> (kTileHeight - row_end)) & (~0u << row_begin);
  int n = batch.count;
  for (int r = row_begin / kLanes * kLanes; r < row_end; r += kLanes) {
    const V row_y = hn::Sub(hn::Iota(df, static_cast<float>(r) + 0.5f), set(y));
    const V w = hn::Mul(set(s.w_xy), row_y);
    const V wy = hn::Mul(set(s.w_yy), row_y);
    const V w2 = hn::Mul(wy, wy);
    const V d = hn::MulAdd(set(s.d_xy), row_y, set(s.d_x1));
    const V dy = hn::MulAdd(set(s.d_yy), row_y, set(s.d_y1));
    const V d2 = hn::MulAdd(dy, dy, set(s.d_11 * s.d_11));
    hn::Store(w, df, batch.row_w + slot * kTileHeight + r);
    hn::Store(w2, df, batch.row_w2 + slot * kTileHeight + r);
    hn::Store(d, df, batch.row_d + slot * kTileHeight + r);
    hn::Store(d2, df, batch.row_d2 + slot * kTileHeight + r);
    const V cross = hn::Sub(hn::Mul(set(s.w_xx), d), hn::Mul(set(s.d_xx), w));
    const V rest = hn::NegMulAdd(set(radius2), d2, w2);
    const V discriminant = hn::NegMulAdd(set(leading), rest, hn::Mul(set(radius2), hn::Mul(cross, cross)));
    const V half_b = hn::NegMulAdd(set(radius2 * s.d_xx), d, hn::Mul(set(s.w_xx), w));
    const V middle = hn::NegMulAdd(half_b, set(inverse), set(x));
    const V half = hn::MulAdd(hn::Sqrt(hn::Max(discriminant, hn::Zero(df))), set(inverse), set(margin));
    // No row meets: the span is turned inside out.
    const V low = hn::IfThenElse(hn::Ge(discriminant, hn::Zero(df)), hn::Sub(middle, half), set(2.0f * kTileWidth));
    const V high = hn::Add(middle, half);
    for (int c = 0; c < kColumns; ++c) {
      const float left = static_cast<float>(c * kLanes) + 0.5f;
      const M inside = hn::And(hn::Ge(high, set(left)), hn::Le(low, set(left + static_cast<float>(kLanes - 1))));
      const std::uint32_t bits = (bounded ? bitsOf(inside) : ~0u) & (rows & state.live[c]) >> r;
      for (int part = 0; part < kLanes; part += kRowsAtOnce) {
        n += appendItems(bits >> part & ((1u << kRowsAtOnce) - 1), slot * kBlocks + (r + part) * kColumns + c,
                         batch.items + n);
      }
    }
  }
  batch.count = n;
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

// Lanes whose hit lies behind the splat's near plane.
HWY_INLINE M behindNear(const PictureSplat& s, const PictureHit& hit, unsigned block, int tile_x, int tile_y, V d2) {
  const float y = static_cast<float>(tile_y + static_cast<int>(block / kColumns)) + 0.5f - s.center_y;
  const float left = static_cast<float>(tile_x + static_cast<int>(block % kColumns) * kLanes) + 0.5f;
  const V x = hn::Sub(hn::Iota(df, left), set(s.center_x));
  return hn::Gt(hn::MulAdd(set(hit.t_x), x, set(hit.t_y * y + hit.t_1)), hn::Mul(set(hit.near), d2));
}

// Items [begin, end): evaluate() of kernel-inl.h and blending in one. kHit: all are the first one's splat, which has a
// PictureHit.
template <bool kHit>
HWY_INLINE void blendItems(const Batch& batch, int begin, int end, int tile_x, int tile_y, PixelBlock* blocks) {
  const V sign = set(-0.0f);
  alignas(64) float alphas[kItemsAtOnce * kLanes];
  while (begin < end) {
    const int count = std::min(end - begin, kItemsAtOnce);
    for (int i = 0; i < count; ++i) {
      const unsigned item = batch.items[begin + i];
      const unsigned slot = item / kBlocks, row = item / kColumns;
      const unsigned column = (slot * kColumns + item % kColumns) * kLanes;
      const V w = hn::Add(hn::Load(df, batch.column_w + column), set(batch.row_w[row]));
      const V d = hn::Add(hn::Load(df, batch.column_d + column), set(batch.row_d[row]));
      const V w2 = hn::MulAdd(w, w, set(batch.row_w2[row]));
      const V d2 = hn::MulAdd(d, d, set(batch.row_d2[row]));
      const V exponent = hn::Sub(set(batch.log2_opacity[slot]), hn::Div(w2, d2));
      M visible = hn::Ge(exponent, set(kLog2AlphaMin));
      if constexpr (kHit) {
        visible =
            hn::And(visible, behindNear(*batch.splats[slot], *batch.hits[slot], item % kBlocks, tile_x, tile_y, d2));
      }
      const V alpha = hn::IfThenElseZero(visible, hn::Min(exp2InRange(exponent), set(kAlphaMax)));
      hn::Store(alpha, df, alphas + i * kLanes);
    }
    for (int i = 0; i < count; ++i) {
      const unsigned item = batch.items[begin + i];
      const unsigned slot = item / kBlocks;
      PixelBlock& pixels = blocks[item % kBlocks];
      const V transmittance = hn::Load(df, pixels.transmittance);
      const V blended = hn::Mul(transmittance, hn::Load(df, alphas + i * kLanes));
      const V next = hn::Sub(transmittance, blended);
      const M goes_on = hn::Ge(next, set(kTransmittanceStop));
      hn::Store(hn::IfThenElse(goes_on, next, hn::Or(transmittance, sign)), df, pixels.transmittance);
      const V weight = hn::IfThenElseZero(goes_on, blended);
      for (int ch = 0; ch < 3; ++ch) {
        hn::Store(hn::MulAdd(weight, set(batch.base[ch][slot]), hn::Load(df, pixels.color[ch])), df, pixels.color[ch]);
      }
    }
    begin += count;
  }
}

// All items in their order, in runs of splats that the same code serves.
HWY_INLINE void blendBatch(const Batch& batch, int slots, int tile_x, int tile_y, PixelBlock* blocks) {
  int done = 0;
  for (int slot = 0; slot < slots; ++slot) {
    if (HWY_LIKELY(batch.hits[slot] == nullptr)) continue;
    const int begin = slot > 0 ? batch.ends[slot - 1] : 0;
    blendItems<false>(batch, done, begin, tile_x, tile_y, blocks);
    done = batch.ends[slot];
    blendItems<true>(batch, begin, done, tile_x, tile_y, blocks);
  }
  blendItems<false>(batch, done, batch.count, tile_x, tile_y, blocks);
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
