// SPDX-License-Identifier: Apache-2.0
// Bilinear look-ups in a texture of up to 4 x 4 texels at all samples of a splat in a tile. Inside a cell a channel is
// c_1 + c_u f_u + c_v f_v + c_uv f_u f_v: the coefficients are made once for a splat, and most vectors of pixels (four
// of five in a training view of 16,000 Gaussians) fall into one cell and take its coefficients as they are.
#include <bit>

#include "render/cpu/texture-inl.h"

#if defined(TG_RENDER_CPU_TEXTURE_CELLS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TG_RENDER_CPU_TEXTURE_CELLS_INL_H
#undef TG_RENDER_CPU_TEXTURE_CELLS_INL_H
#else
#define TG_RENDER_CPU_TEXTURE_CELLS_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

constexpr hn::RebindToUnsigned<Floats> du;
constexpr int kCellStride = 4;  // of a cell's number from row to row
constexpr int kCells = 16;
constexpr int kNoCell = kCells - 1;  // where the texture does not apply

// Where a sample falls on the texture.
struct CellSample {
  alignas(4 * kLanes) float fraction_u[kLanes];  // 0 in lanes without a cell
  float fraction_v[kLanes];
  std::uint32_t cell[kLanes];  // in the lowest byte
  float u[kLanes];             // texels from the texture's centre; only where asked for
  float v[kLanes];
};
struct CellSamples {
  alignas(64) CellSample at[kBlocks];
  std::uint16_t lanes[kBlocks];  // a bit for each that shows
  // Samples whose lanes that show are in one cell, and the others.
  std::uint16_t uniform[kBlocks + 1], mixed[kBlocks + 1];
  std::uint8_t uniform_cell[kBlocks + 1];
  int uniform_count, mixed_count;
  std::uint32_t touched;  // a bit for each cell that some lane is in
};

template <bool kKeepPoint, bool kEdge = false>
HWY_INLINE void locateCells(const Texture& texture, const TileRays& rays, const Samples& samples, CellSamples& out) {
  const V extent = set(kTextureExtent);
  const V per_u = set(texture.texels_per_sigma_u), per_v = set(texture.texels_per_sigma_v);
  const V first_u = hn::Mul(extent, per_u), first_v = hn::Mul(extent, per_v);
  const V magic = set(8388608.0f);  // 2^23: the sum with it holds an integer in its lowest bits
  const V no_cell = set(8388608.0f + kNoCell);
  for (int i = 0; i < samples.count; ++i) {
    const Sample& sample = samples.at[i];
    CellSample& to = out.at[i];
    const auto block = static_cast<unsigned>(samples.block[i]);
    const LocalRay ray = rays.at(block % kTileHeight, block / kTileHeight * kLanes);
    const M shows = hn::Gt(hn::Load(df, sample.value), hn::Zero(df));
    // Lanes that do not show are at the centre: 1 / |D|^2 may be infinite there.
    const V inverse_d2 = hn::IfThenElseZero(shows, hn::Load(df, sample.inverse_d2));
    const LocalPoint point = localPoint(ray, inverse_d2);
    V texel_u = hn::MulAdd(point.u, per_u, first_u), texel_v = hn::MulAdd(point.v, per_v, first_v);
    if constexpr (kEdge) {
      texel_u = onBorder(texel_u, texture.last_u);
      texel_v = onBorder(texel_v, texture.last_v);
    }
    // At -3 sigma a texel coordinate of 2 or 3 texels is rounded to less than 0.
    const V zero = hn::Zero(df);
    const V cell_u = hn::Max(zero, hn::Min(hn::Floor(texel_u), set(texture.last_u)));
    const V cell_v = hn::Max(zero, hn::Min(hn::Floor(texel_v), set(texture.last_v)));
    const V number = hn::MulAdd(cell_v, set(kCellStride), hn::Add(cell_u, magic));
    const VI cell = hn::BitCast(di, kEdge ? number : hn::IfThenElse(insideTexture(point), number, no_cell));
    hn::Store(hn::Sub(texel_u, cell_u), df, to.fraction_u);
    hn::Store(hn::Sub(texel_v, cell_v), df, to.fraction_v);
    hn::Store(hn::BitCast(du, cell), du, to.cell);
    if constexpr (kKeepPoint) {
      hn::Store(hn::Mul(point.u, per_u), df, to.u);
      hn::Store(hn::Mul(point.v, per_v), df, to.v);
    }
    out.lanes[i] = static_cast<std::uint16_t>(bitsOf(shows));
  }
  // A loop of its own: as a part of the one above it would end a chain of operations too long to overlap.
  std::uint32_t touched = 0;
  int uniform_count = 0, mixed_count = 0;
  for (int i = 0; i < samples.count; ++i) {
    const CellSample& at = out.at[i];
    const std::uint32_t lanes = out.lanes[i];
    const std::uint32_t first = at.cell[hwy::Num0BitsBelowLS1Bit_Nonzero32(lanes)];
    const VI cell = hn::BitCast(di, hn::Load(du, at.cell));
    const std::uint32_t same = bitsOf(hn::RebindMask(df, hn::Eq(cell, hn::Set(di, static_cast<std::int32_t>(first)))));
    const int one = (lanes & ~same) == 0 ? 1 : 0;
    out.uniform[uniform_count] = static_cast<std::uint16_t>(i);
    out.uniform_cell[uniform_count] = static_cast<std::uint8_t>(first);
    out.mixed[mixed_count] = static_cast<std::uint16_t>(i);
    touched |= 1u << (first % kCells);
    uniform_count += one;
    mixed_count += 1 - one;
  }
  out.uniform_count = uniform_count;
  out.mixed_count = mixed_count;
  for (int k = 0; k < mixed_count; ++k) {
    for (const std::uint32_t cell : out.at[out.mixed[k]].cell) touched |= 1u << (cell % kCells);
  }
  out.touched = touched;
}

// Calls visit(cell, lanes) for every distinct cell of the lanes whose bits are set.
template <typename Visit>
HWY_INLINE void forEachCell(const CellSample& at, std::uint32_t bits, const Visit& visit) {
  const VI cells = hn::BitCast(di, hn::Load(du, at.cell));
  while (bits != 0) {
    const std::uint32_t cell = at.cell[hwy::Num0BitsBelowLS1Bit_Nonzero32(bits)];
    const M lanes = hn::RebindMask(df, hn::Eq(cells, hn::Set(di, static_cast<std::int32_t>(cell))));
    visit(static_cast<int>(cell % kCells), lanes);
    bits &= ~bitsOf(lanes);
  }
}

// [cell, coefficient, channel]: c_1, c_u, c_v, c_uv of colour and of alpha's deviation from 1.
struct CellCoefficients {
  alignas(64) float at[kCells][4][4];
};
HWY_INLINE void clear(CellCoefficients& coefficients) {
  for (auto& row : coefficients.at[kNoCell]) std::fill_n(row, 4, 0.0f);
}
// Texel of a cell's first corner.
HWY_INLINE std::size_t cellTexel(const Texture& texture, int cell) {
  return static_cast<std::size_t>(cell / kCellStride) * texture.width + static_cast<std::size_t>(cell % kCellStride);
}
// Fills the cells that are touched. Channels that do not apply are 0.
HWY_INLINE void fillCells(const Texture& texture, std::uint32_t touched, bool with_rgb, bool with_alpha,
                          CellCoefficients& coefficients) {
  using F4 = HWY_CAPPED(float, 4);
  constexpr F4 d4;
  alignas(16) const float neutral[4] = {0, 0, 0, 1};
  const float rgb = with_rgb ? 1.0f : 0.0f;
  alignas(16) const float applies[4] = {rgb, rgb, rgb, with_alpha ? 1.0f : 0.0f};
  touched &= ~(1u << kNoCell);
  for (; touched != 0; touched &= touched - 1) {
    const int cell = std::countr_zero(touched);
    const float* t00 = texture.texels + 4 * cellTexel(texture, cell);
    const float* t10 = t00 + texture.step_u;
    const float* t01 = t00 + texture.step_v;
    const float* t11 = t01 + texture.step_u;
    float* to = coefficients.at[cell][0];
    for (std::size_t ch = 0; ch < 4; ch += hn::MaxLanes(F4())) {
      const auto factor = hn::Load(d4, applies + ch);
      const auto first = hn::LoadU(d4, t00 + ch);
      const auto along_u = hn::Sub(hn::LoadU(d4, t10 + ch), first);
      const auto both = hn::Sub(hn::Sub(hn::LoadU(d4, t11 + ch), hn::LoadU(d4, t01 + ch)), along_u);
      hn::Store(hn::Mul(factor, hn::Sub(first, hn::Load(d4, neutral + ch))), d4, to + ch);
      hn::Store(hn::Mul(factor, along_u), d4, to + 4 + ch);
      hn::Store(hn::Mul(factor, hn::Sub(hn::LoadU(d4, t01 + ch), first)), d4, to + 8 + ch);
      hn::Store(hn::Mul(factor, both), d4, to + 12 + ch);
    }
  }
}

HWY_INLINE V cellValue(const CellCoefficients& coefficients, int cell, int ch, V fraction_u, V fraction_v) {
  const auto& c = coefficients.at[cell];
  const V along_v = hn::MulAdd(fraction_u, set(c[3][ch]), set(c[2][ch]));
  return hn::MulAdd(fraction_v, along_v, hn::MulAdd(fraction_u, set(c[1][ch]), set(c[0][ch])));
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
