// SPDX-License-Identifier: Apache-2.0
// What the forward and the backward pixel loops share, once per SIMD target: the part of a splat's formulas that a tile
// row fixes, where the splat can be seen in a tile, and the splat's value at a vector of pixels. Backward takes the
// same decisions as forward because both run this code.
#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>

#include "render/cpu/tiles.h"
#include "shared/limits.h"

// Compiled once per target: not `#pragma once`.
#if defined(TG_RENDER_CPU_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TG_RENDER_CPU_KERNEL_INL_H
#undef TG_RENDER_CPU_KERNEL_INL_H
#else
#define TG_RENDER_CPU_KERNEL_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = HWY_CAPPED(float, 16);
using Ints = hn::RebindToSigned<Floats>;
using V = hn::Vec<Floats>;
using VI = hn::Vec<Ints>;
using M = hn::Mask<Floats>;
constexpr Floats df;
constexpr Ints di;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(Floats()));
constexpr int kColumns = kTileWidth / kLanes;  // vectors side by side in a tile
static_assert(kTileWidth % kLanes == 0 && kTileHeight % kLanes == 0 && kTileHeight <= 32);

constexpr std::size_t kCacheLine = 64;

// Asks for a splat that the loop reaches soon, and for the texels of one it reaches before that: a tile's list jumps
// through memory.
HWY_INLINE void prefetchSplat(const Splat& s) {
  const char* bytes = reinterpret_cast<const char*>(&s);
  for (std::size_t line = 0; line < sizeof(Splat); line += kCacheLine) hwy::Prefetch(bytes + line);
}
HWY_INLINE void prefetchTexels(const Splat& s, const glm::vec4* texels) {
  const std::size_t bytes = std::size_t{16} * s.texture_width * s.texture_height;
  const char* first = reinterpret_cast<const char*>(texels + s.texel_offset);
  for (std::size_t line = 0; line < std::min<std::size_t>(bytes, 1024); line += kCacheLine) hwy::Prefetch(first + line);
}

// Pixel state is stored [column][row][lane].
HWY_INLINE int offsetOf(int column, int row) { return (column * kTileHeight + row) * kLanes; }

HWY_INLINE V set(float value) { return hn::Set(df, value); }

HWY_INLINE std::uint32_t bitsOf(M mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(df, mask, bytes);
  return bytes[0] | static_cast<std::uint32_t>(bytes[1]) << 8;
}

// 2^x. A minimax polynomial on [-1/2, 1/2] (relative error 7.5e-8) whose exponent is moved by the rounded x; the sum
// with kRound holds that integer in its lowest bits. Below 2^-125, far under kAlphaMin, it stays there.
HWY_INLINE V exp2Bounded(V x) {
  const V round = set(12582912.0f);  // 1.5 * 2^23
  x = hn::Max(x, set(-125.0f));
  const V rounded = hn::Add(x, round);
  const V f = hn::Sub(x, hn::Sub(rounded, round));
  V p = set(1.3276472e-3f);
  p = hn::MulAdd(p, f, set(9.6755413e-3f));
  p = hn::MulAdd(p, f, set(5.5507133e-2f));
  p = hn::MulAdd(p, f, set(2.4022120e-1f));
  p = hn::MulAdd(p, f, set(6.9314697e-1f));
  p = hn::MulAdd(p, f, set(1.0000001f));
  const VI exponent = hn::ShiftLeft<23>(hn::BitCast(di, rounded));
  return hn::BitCast(df, hn::Add(hn::BitCast(di, p), exponent));
}

// What the rows of a tile fix of a splat's formulas. (x, y) = pixel - centre of the splat.
struct Rows {
  alignas(64) float y[kTileHeight];
  alignas(64) float w[kTileHeight];   // w_xy y
  alignas(64) float w2[kTileHeight];  // (w_yy y)^2
  alignas(64) float d[kTileHeight];   // d_xy y + d_x1
  alignas(64) float d2[kTileHeight];  // (d_yy y + d_y1)^2 + d_11^2
  std::uint32_t active[kColumns];     // bit r: row r may show the splat in this column of vectors
};

// Fills `rows` and returns whether the splat may show at all in the tile whose first pixel is (tile_x, tile_y). A row's
// span solves power <= radius2, a quadratic in x; it may be wider than the truth, never narrower.
HWY_INLINE bool prepareRows(const Splat& s, int tile_x, int tile_y, Rows& rows) {
  const int first_row = std::max(s.y0 - tile_y, 0);
  const int end_row = std::min(s.y1 - tile_y, kTileHeight);
  const int first_column = std::max(s.x0 - tile_x, 0) / kLanes;
  const int last_column = std::min(s.x1 - 1 - tile_x, kTileWidth - 1) / kLanes;
  for (int c = 0; c < kColumns; ++c) rows.active[c] = 0;
  if (first_row >= end_row || first_column > last_column) return false;
  const std::uint32_t row_bits = (end_row == 32 ? ~0u : (1u << end_row) - 1u) & ~((1u << first_row) - 1u);

  const float leading = s.w_xx * s.w_xx - s.radius2 * s.d_xx * s.d_xx;
  const bool bounded =
      leading > 1e-3f * s.w_xx * s.w_xx;  // else the conic is no ellipse, or too near to one that isn't
  const V inverse = set(bounded ? 1.0f / leading : 0.0f);
  const float origin = s.center_x - static_cast<float>(tile_x);
  std::uint32_t any = 0;
  for (int r = first_row / kLanes * kLanes; r < end_row; r += kLanes) {
    const V pixel_y = hn::Add(hn::Iota(df, static_cast<float>(r) + 0.5f), set(static_cast<float>(tile_y)));
    const V y = hn::Sub(pixel_y, set(s.center_y));
    const V w = hn::Mul(set(s.w_xy), y);
    const V wy = hn::Mul(set(s.w_yy), y);
    const V w2 = hn::Mul(wy, wy);
    const V d = hn::MulAdd(set(s.d_xy), y, set(s.d_x1));
    const V dy = hn::MulAdd(set(s.d_yy), y, set(s.d_y1));
    const V d2 = hn::MulAdd(dy, dy, set(s.d_11 * s.d_11));
    hn::Store(y, df, rows.y + r);
    hn::Store(w, df, rows.w + r);
    hn::Store(w2, df, rows.w2 + r);
    hn::Store(d, df, rows.d + r);
    hn::Store(d2, df, rows.d2 + r);

    // radius2 (w_xx d - d_xx w)^2 - leading (w2 - radius2 d2): the discriminant without its cancelling terms.
    const V radius2 = set(s.radius2);
    const V cross = hn::Sub(hn::Mul(set(s.w_xx), d), hn::Mul(set(s.d_xx), w));
    const V rest = hn::NegMulAdd(radius2, d2, w2);
    const V discriminant = hn::NegMulAdd(set(leading), rest, hn::Mul(radius2, hn::Mul(cross, cross)));
    const V half_b = hn::NegMulAdd(hn::Mul(radius2, set(s.d_xx)), d, hn::Mul(set(s.w_xx), w));
    const V middle = hn::NegMulAdd(half_b, inverse, set(origin));
    const V half = hn::MulAdd(hn::Sqrt(hn::Max(discriminant, hn::Zero(df))), inverse, set(s.margin));
    const V low = hn::Sub(middle, half);
    const V high = hn::Add(middle, half);
    const M meets = hn::Ge(discriminant, hn::Zero(df));
    for (int c = first_column; c <= last_column; ++c) {
      const float left = static_cast<float>(c * kLanes) + 0.5f;
      const M inside = hn::And(hn::Ge(high, set(left)), hn::Le(low, set(left + static_cast<float>(kLanes - 1))));
      const std::uint32_t bits = bounded ? bitsOf(hn::And(meets, inside)) : (1u << kLanes) - 1u;
      rows.active[c] |= (bits << r) & row_bits;
      any |= rows.active[c];
    }
  }
  return any != 0;
}

// Offset of the pixels of a column of vectors from the splat's centre.
HWY_INLINE V columnX(const Splat& s, int tile_x, int column) {
  const float first = static_cast<float>(tile_x + column * kLanes) + 0.5f;
  return hn::Sub(hn::Iota(df, first), set(s.center_x));
}

// A splat at the vectors of pixels of a tile where it shows, in column order. The stages of the pixel loops pass these
// on in the first-level cache: each stage's chain of dependent operations is short enough for the processor to overlap
// several vectors, which one long loop body does not allow.
struct Blocks {
  static constexpr int kMax = kColumns * kTileHeight;
  int begin[kColumns + 1];  // column c holds blocks [begin[c], begin[c + 1])
  std::int32_t at[kMax];    // offset of the pixel state
  std::int32_t row[kMax];
  alignas(64) float w[kMax * kLanes];           // first triangular component of W
  alignas(64) float inverse_d2[kMax * kLanes];  // 1 / |D|^2
  alignas(64) float power[kMax * kLanes];
  alignas(64) float value[kMax * kLanes];  // opacity * G; 0 where the splat does not show
  int count() const { return begin[kColumns]; }
};

// Camera z of the hit.
HWY_INLINE V hitDepth(const Splat& s, float y, V x, V inverse_d2) {
  return hn::Mul(hn::MulAdd(set(s.t_x), x, set(s.t_y * y + s.t_1)), inverse_d2);
}

// Evaluates a splat at the active rows, restricted to the lanes open(at).
template <typename Open>
HWY_INLINE void evaluateBlocks(const Splat& s, const Rows& rows, int tile_x, const Open& open, Blocks& blocks) {
  int n = 0;
  for (int column = 0; column < kColumns; ++column) {
    blocks.begin[column] = n;
    const V x = columnX(s, tile_x, column);
    const V wx = hn::Mul(set(s.w_xx), x);
    const V dx = hn::Mul(set(s.d_xx), x);
    for (std::uint32_t bits = rows.active[column]; bits != 0; bits &= bits - 1) {
      const int row = std::countr_zero(bits);
      const int at = offsetOf(column, row);
      const V w = hn::Add(wx, set(rows.w[row]));
      const V d = hn::Add(dx, set(rows.d[row]));
      const V w2 = hn::MulAdd(w, w, set(rows.w2[row]));
      const V inverse_d2 = hn::Div(set(1.0f), hn::MulAdd(d, d, set(rows.d2[row])));
      const V power = hn::Mul(w2, inverse_d2);
      const V value = exp2Bounded(hn::MulAdd(power, set(-0.72134752f), set(s.log2_opacity)));
      M visible = hn::And(hn::Ge(value, set(kAlphaMin)), open(at));
      if (HWY_UNLIKELY(s.near_plane)) {
        visible = hn::And(visible, hn::Gt(hitDepth(s, rows.y[row], x, inverse_d2), set(kNear)));
      }
      hn::Store(w, df, blocks.w + n * kLanes);
      hn::Store(inverse_d2, df, blocks.inverse_d2 + n * kLanes);
      hn::Store(power, df, blocks.power + n * kLanes);
      hn::Store(hn::IfThenElseZero(visible, value), df, blocks.value + n * kLanes);
      blocks.at[n] = at;
      blocks.row[n] = row;
      n += hn::AllFalse(df, visible) ? 0 : 1;
    }
  }
  blocks.begin[kColumns] = n;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
