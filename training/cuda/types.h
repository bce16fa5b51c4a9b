// SPDX-License-Identifier: Apache-2.0
// What crosses between the CUDA kernels and the code that launches them. Pointers are the device's.
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>

#include "core/model/atlas.h"
#include "core/model/fields.h"
#include "core/model/pinhole.h"
#include "shared/limits.h"

namespace tg::cuda {

// One frame's view.
struct View : Pinhole {
  glm::dvec3 eye;  // world space
  glm::vec3 background;
  int tiles_x, tiles_y;
  std::uint32_t intersection;  // kIntersect*
  bool texture_rgb, texture_alpha;
  std::uint32_t outside;  // kOutside*; kOutsideEdge has no gradient
};

template <typename>
using FloatPointer = float*;
// A model's parameters, or gradients in their shapes: the floats of GaussianModel's arrays.
struct Parameters : ModelFields<FloatPointer> {
  std::size_t count;   // Gaussians
  int sh_count;        // coefficients of each
  TextureRect* rects;  // [N]; null: no textures
  std::size_t texel_count;
  std::size_t largest_rect;  // [texels]
};

// Gaussians [first, first + count) as a model of their own; the texels stay those of all.
inline Parameters slice(Parameters of, std::size_t first, std::size_t count) {
  of.count = count;
  forEachField([&](const Field& field, float*& values) { values += field.row(of.sh_count) * first; }, of);
  if (of.rects != nullptr) of.rects += first;
  return of;
}

// Where the numbers of each field lie, for kernels that treat them all alike: Gaussian i's are floats[i * row] and on.
struct FieldRows {
  struct Row {
    float* floats;
    unsigned row;
  } of[kFieldCount];
};
// pointer(set's member) is where a field's floats lie.
template <typename Set, typename Pointer>
FieldRows rowsOf(const Set& set, int sh_count, const Pointer& pointer) {
  FieldRows rows;
  std::size_t next = 0;
  forEachField(
      [&](const Field& field, const auto& values) {
        rows.of[next++] = {pointer(values), static_cast<unsigned>(field.row(sh_count))};
      },
      set);
  return rows;
}

// What blending evaluates of a splat; names and units as in render/cpu/project.h. (x, y) = pixel - centre [px].
struct alignas(16) BlendSplat {
  float center_x, center_y;
  float log2_opacity;
  float w_xx, w_xy, w_yy;
  float d_xx, d_xy, d_x1, d_yy, d_y1, d_11;
  float t_x, t_y, t_1, near;
  float base[3];
  float kappa_first, kappa_second;
  std::uint32_t gaussian;
  std::uint32_t texel_offset;
  std::uint32_t texture_size;  // width | height << 16; 0: none
};
static_assert(sizeof(BlendSplat) == 96);

// What a texture look-up needs beside it. Aligned for loads of 16 bytes.
struct alignas(16) LocalFrame {
  float wx[3], wy[3], dx[3], dy[3], d0[3], kappa[3];
};

using PairCount = unsigned long long;  // as CUDA's atomics want it

// Lists of a frame. A pair is a (tile, splat); pairs are numbered in depth order of their splats, those of one splat in
// a row.
struct Lists {
  const std::uint32_t* sorted_pairs;  // by tile, front to back in each
  const std::uint32_t* tile_begin;    // [tiles + 1]
  const std::uint32_t* gaussian;      // [pairs]; of those that have room
};

// Order of a pair's sums: PairSums of training/cpu/backward.h; of textured models then PairTextureSums; with statistics
// then the sum of |e|.
constexpr unsigned kSums = 16;
constexpr unsigned kTextureSums = 12;
constexpr unsigned pairSums(bool textured, bool statistics) {
  return kSums + (textured ? kTextureSums : 0u) + (statistics ? 1u : 0u);
}

// Texel gradients are added up as integers, in units of 2^-48: sums do not depend on the order of threads.
constexpr float kTexelUnits = 281474976710656.0f;

}  // namespace tg::cuda
