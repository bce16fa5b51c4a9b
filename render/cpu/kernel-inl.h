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
constexpr int kBlocks = kColumns * kTileHeight;
constexpr int kWords = (kBlocks + 63) / 64;
static_assert(kTileWidth % kLanes == 0 && kTileHeight % kLanes == 0 && 64 % kTileHeight == 0);

// A block is a vector of pixels: column b / kTileHeight, row b % kTileHeight of a tile. A set of blocks is a bit mask:
// one loop over its bits serves a whole tile, and ends with one branch that the processor guesses wrong.
struct BlockSet {
  std::uint64_t words[kWords];
};
HWY_INLINE bool empty(const BlockSet& set) {
  std::uint64_t any = 0;
  for (const std::uint64_t word : set.words) any |= word;
  return any == 0;
}
// Number of blocks in columns before `column`.
HWY_INLINE int countBefore(const BlockSet& set, int column) {
  const int end = column * kTileHeight;
  int count = 0;
  for (int word = 0; word < kWords && word * 64 < end; ++word) {
    const int bits = end - word * 64;
    count += std::popcount(bits >= 64 ? set.words[word] : set.words[word] & ((std::uint64_t{1} << bits) - 1));
  }
  return count;
}

constexpr std::size_t kCacheLine = 64;
constexpr int kSplatsAhead = 5;  // small splats take some hundred nanoseconds each, memory as much

// Asks for a splat that the loop reaches soon, and for the texels of one it reaches before that: a tile's list jumps
// through memory.
HWY_INLINE void prefetchSplat(const Splat& s) {
  const char* bytes = reinterpret_cast<const char*>(&s);
  for (std::size_t line = 0; line < sizeof(Splat); line += kCacheLine) hwy::Prefetch(bytes + line);
}
template <class S>
HWY_INLINE void prefetchTexels(const S& s, const glm::vec4* texels) {
  const std::size_t bytes = std::size_t{16} * s.texture_width * s.texture_height;
  const char* first = reinterpret_cast<const char*>(texels + s.texel_offset);
  for (std::size_t line = 0; line < std::min<std::size_t>(bytes, 1024); line += kCacheLine) hwy::Prefetch(first + line);
}

HWY_INLINE V set(float value) { return hn::Set(df, value); }

HWY_INLINE std::uint32_t bitsOf(M mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(df, mask, bytes);
  return bytes[0] | static_cast<std::uint32_t>(bytes[1]) << 8;
}

// 2^x. A minimax polynomial on [-1/2, 1/2] (relative error 7.5e-8) whose exponent is moved by the rounded x; the sum
// with kRound holds that integer in its lowest bits. Below 2^-125, far under kAlphaMin, it stays there.
HWY_INLINE V exp2InRange(V x) {
  const V round = set(12582912.0f);  // 1.5 * 2^23
  const V rounded = hn::Add(x, round);
  const V f = hn::Sub(x, hn::Sub(rounded, round));
  // Estrin's order: half the latency of Horner's.
  const V f2 = hn::Mul(f, f);
  const V low = hn::MulAdd(set(6.9314697e-1f), f, set(1.0000001f));
  const V middle = hn::MulAdd(set(5.5507133e-2f), f, set(2.4022120e-1f));
  const V high = hn::MulAdd(set(1.3276472e-3f), f, set(9.6755413e-3f));
  const V p = hn::MulAdd(hn::MulAdd(high, f2, middle), f2, low);
  const VI exponent = hn::ShiftLeft<23>(hn::BitCast(di, rounded));
  return hn::BitCast(df, hn::Add(hn::BitCast(di, p), exponent));
}

HWY_INLINE V exp2Bounded(V x) { return exp2InRange(hn::Max(x, set(-125.0f))); }

// What the rows of a tile fix of a splat's formulas. (x, y) = pixel - centre of the splat.
struct Rows {
  alignas(64) float y[kTileHeight];
  alignas(64) float w[kTileHeight];   // w_xy y
  alignas(64) float w2[kTileHeight];  // (w_yy y)^2
  alignas(64) float d[kTileHeight];   // d_xy y + d_x1
  alignas(64) float d2[kTileHeight];  // (d_yy y + d_y1)^2 + d_11^2
};
// Rows of a tile that a splat's screen box meets. s: a Splat or a PictureSplat.
struct RowRange {
  int begin, end;
};
template <class S>
HWY_INLINE RowRange rowRange(const S& s, int tile_y) {
  return {std::max(s.y0 - tile_y, 0), std::min(s.y1 - tile_y, kTileHeight)};
}

// The same of kLanes rows at `y`. s: a Splat or a PictureSplat.
struct RowTerms {
  V w, w2, d, d2;
};
template <class S>
HWY_INLINE RowTerms rowTerms(const S& s, V y) {
  const V wy = hn::Mul(set(s.w_yy), y);
  const V dy = hn::MulAdd(set(s.d_yy), y, set(s.d_y1));
  return {hn::Mul(set(s.w_xy), y), hn::Mul(wy, wy), hn::MulAdd(set(s.d_xy), y, set(s.d_x1)),
          hn::MulAdd(dy, dy, set(s.d_11 * s.d_11))};
}

// Fills rows [r, r + kLanes).
HWY_INLINE RowTerms fillRows(const Splat& s, int tile_y, int r, Rows& rows) {
  const V pixel_y = hn::Add(hn::Iota(df, static_cast<float>(r) + 0.5f), set(static_cast<float>(tile_y)));
  const V y = hn::Sub(pixel_y, set(s.center_y));
  const RowTerms terms = rowTerms(s, y);
  hn::Store(y, df, rows.y + r);
  hn::Store(terms.w, df, rows.w + r);
  hn::Store(terms.w2, df, rows.w2 + r);
  hn::Store(terms.d, df, rows.d + r);
  hn::Store(terms.d2, df, rows.d2 + r);
  return terms;
}
HWY_INLINE void fillRows(const Splat& s, int tile_y, Rows& rows) {
  const RowRange range = rowRange(s, tile_y);
  for (int r = range.begin / kLanes * kLanes; r < range.end; r += kLanes) fillRows(s, tile_y, r, rows);
}

// The outline of a splat: where exponent >= log2(kAlphaMin), a quadratic in x for every row.
struct Outline {
  float w_xx, d_xx;
  float radius2;  // Splat::radius2
  float leading, inverse;
  bool bounded;  // or else the conic is no ellipse, or too near to one that isn't
};
template <class S>
HWY_INLINE Outline makeOutline(const S& s, float radius2) {
  const float leading = s.w_xx * s.w_xx - radius2 * s.d_xx * s.d_xx;
  const bool bounded = leading > std::max(1e-3f * s.w_xx * s.w_xx, 1e-36f);  // float has an inverse of it
  return {s.w_xx, s.d_xx, radius2, leading, bounded ? 1.0f / leading : 0.0f, bounded};
}

// What of rows lies in a bounded outline whose centre is at `origin` [px]: may be wider than the truth by `margin`,
// never narrower; turned inside out where a row does not meet it.
struct Span {
  V low, high;  // [px]
};
HWY_INLINE Span rowSpan(const Outline& outline, const RowTerms& row, float origin, float margin) {
  const V radius2 = set(outline.radius2);
  // radius2 (w_xx d - d_xx w)^2 - leading (w2 - radius2 d2): the discriminant without its cancelling terms.
  const V cross = hn::Sub(hn::Mul(set(outline.w_xx), row.d), hn::Mul(set(outline.d_xx), row.w));
  const V rest = hn::NegMulAdd(radius2, row.d2, row.w2);
  const V discriminant = hn::NegMulAdd(set(outline.leading), rest, hn::Mul(radius2, hn::Mul(cross, cross)));
  const V half_b = hn::NegMulAdd(set(outline.radius2 * outline.d_xx), row.d, hn::Mul(set(outline.w_xx), row.w));
  const V middle = hn::NegMulAdd(half_b, set(outline.inverse), set(origin));
  const V half = hn::MulAdd(hn::Sqrt(hn::Max(discriminant, hn::Zero(df))), set(outline.inverse), set(margin));
  const V low = hn::IfThenElse(hn::Ge(discriminant, hn::Zero(df)), hn::Sub(middle, half), set(2.0f * kTileWidth));
  return {low, hn::Add(middle, half)};
}

// Rows whose span meets a vector of a tile.
HWY_INLINE M meetsColumn(const Span& span, int column) {
  const float left = static_cast<float>(column * kLanes) + 0.5f;
  return hn::And(hn::Ge(span.high, set(left)), hn::Le(span.low, set(left + static_cast<float>(kLanes - 1))));
}

// Fills `rows` and returns the blocks of a range of rows that may show the splat.
HWY_INLINE BlockSet findBlocks(const Splat& s, int tile_x, int tile_y, RowRange range, Rows& rows) {
  BlockSet blocks{};
  const Outline outline = makeOutline(s, s.radius2);
  for (int r = range.begin / kLanes * kLanes; r < range.end; r += kLanes) {
    const RowTerms terms = fillRows(s, tile_y, r, rows);
    const Span span = rowSpan(outline, terms, s.center_x - static_cast<float>(tile_x), s.margin);
    const int first = std::max(range.begin - r, 0);
    const int end = std::min(range.end - r, kLanes);
    const std::uint32_t row_bits = ((1u << end) - 1u) & ~((1u << first) - 1u);
    for (int c = 0; c < kColumns; ++c) {
      const std::uint64_t bits = (outline.bounded ? bitsOf(meetsColumn(span, c)) : ~0u) & row_bits;
      const int block = c * kTileHeight + r;
      blocks.words[block / 64] |= bits << (block % 64);
    }
  }
  // An unbounded span still ends at the screen box.
  if (HWY_UNLIKELY(!outline.bounded)) {
    for (int c = 0; c < kColumns; ++c) {
      const int left = tile_x + c * kLanes;
      if (left < s.x1 && left + kLanes > s.x0) continue;
      const int block = c * kTileHeight;
      const std::uint64_t column = kTileHeight == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << (kTileHeight % 64)) - 1;
      blocks.words[block / 64] &= ~(column << (block % 64));
    }
  }
  return blocks;
}

HWY_INLINE BlockSet findBlocks(const Splat& s, int tile_x, int tile_y, Rows& rows) {
  return findBlocks(s, tile_x, tile_y, rowRange(s, tile_y), rows);
}

// Offset of the pixels of a column of blocks from the splat's centre.
HWY_INLINE V columnX(const Splat& s, int tile_x, int column) {
  const float first = static_cast<float>(tile_x + column * kLanes) + 0.5f;
  return hn::Sub(hn::Iota(df, first), set(s.center_x));
}

// A splat at the blocks of a tile where it shows, in the order of blocks. The stages of the pixel loops pass these on
// in the first-level cache: each stage's chain of dependent operations is short enough for the processor to overlap
// several blocks, which one long loop body does not allow.
struct Sample {
  alignas(4 * kLanes) float value[kLanes];  // opacity * G; 0 where the splat does not show
  float w[kLanes];                          // first triangular component of W
  float inverse_d2[kLanes];                 // 1 / |D|^2; 0 likewise
  float q[kLanes];                          // |W|^2 / |D|^2; 0 likewise
};
struct Samples {
  alignas(64) Sample at[kBlocks];
  std::int32_t block[kBlocks];
  BlockSet set;  // the same blocks
  int count;

  int row(int i) const { return block[i] % kTileHeight; }
};
enum class Keep { value, hit, all };  // what to store of a sample: value, + inverse_d2, everything

// Camera z of the hit.
HWY_INLINE V hitDepth(const Splat& s, float y, V x, V inverse_d2) {
  return hn::Mul(hn::MulAdd(set(s.t_x), x, set(s.t_y * y + s.t_1)), inverse_d2);
}

// Evaluates a splat at `candidates`; restrict(visible, block) takes lanes away.
template <Keep kKeep, typename Restrict>
HWY_INLINE void evaluate(const Splat& s, const Rows& rows, int tile_x, const BlockSet& candidates,
                         const Restrict& restrict_lanes, Samples& samples) {
  alignas(64) float column_w[kTileWidth];
  alignas(64) float column_d[kTileWidth];
  for (int column = 0; column < kColumns; ++column) {
    const V x = columnX(s, tile_x, column);
    hn::Store(hn::Mul(set(s.w_xx), x), df, column_w + column * kLanes);
    hn::Store(hn::Mul(set(s.d_xx), x), df, column_d + column * kLanes);
  }
  const V log2_opacity = set(s.log2_opacity);
  const bool crosses_near = s.near > 0.0f;
  int n = 0;
  for (int word = 0; word < kWords; ++word) {
    std::uint64_t shown = 0;
    for (std::uint64_t bits = candidates.words[word]; bits != 0; bits &= bits - 1) {
      const int block = word * 64 + std::countr_zero(bits);
      const int row = block % kTileHeight;
      const int lane = block / kTileHeight * kLanes;
      const V w = hn::Add(hn::Load(df, column_w + lane), set(rows.w[row]));
      const V d = hn::Add(hn::Load(df, column_d + lane), set(rows.d[row]));
      const V w2 = hn::MulAdd(w, w, set(rows.w2[row]));
      const V inverse_d2 = hn::Div(set(1.0f), hn::MulAdd(d, d, set(rows.d2[row])));
      const V q = hn::Mul(w2, inverse_d2);
      const V value = exp2Bounded(hn::Sub(log2_opacity, q));
      M visible = restrict_lanes(hn::Ge(value, set(kAlphaMin)), block);
      if (HWY_UNLIKELY(crosses_near)) {
        const V x = columnX(s, tile_x, block / kTileHeight);
        visible = hn::And(visible, hn::Gt(hitDepth(s, rows.y[row], x, inverse_d2), set(s.near)));
      }
      Sample& sample = samples.at[n];
      hn::Store(hn::IfThenElseZero(visible, value), df, sample.value);
      // A ray in the plane of the plane model's splat has D = 0: what it stores is multiplied by 0 and must be finite.
      if constexpr (kKeep != Keep::value) hn::Store(hn::IfThenElseZero(visible, inverse_d2), df, sample.inverse_d2);
      if constexpr (kKeep == Keep::all) {
        hn::Store(w, df, sample.w);
        hn::Store(hn::IfThenElseZero(visible, q), df, sample.q);
      }
      samples.block[n] = block;
      // Without a branch, which the processor would guess wrong at every edge of the splat.
      const std::uint64_t any = hn::AllFalse(df, visible) ? 0 : 1;
      shown |= any << std::countr_zero(bits);
      n += static_cast<int>(any);
    }
    samples.set.words[word] = shown;
  }
  samples.count = n;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
