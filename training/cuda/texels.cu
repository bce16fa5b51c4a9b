// SPDX-License-Identifier: Apache-2.0
// Half a warp a Gaussian, whatever its texture's size: its texels lie in a row, its Gaussians in any order.
#include "training/cuda/texels.h"

#include <algorithm>

#include "core/system/assert.h"
#include "training/cuda/device.h"

namespace tg::cuda {
namespace {

constexpr unsigned kLanes = 16;               // of a Gaussian
constexpr std::size_t kMoveBlocks = 1 << 11;  // at most; the host does not know how many Gaussians a range has

TG_DEVICE std::uint32_t areaOf(const TextureRect& rect) { return std::uint32_t{rect.width} * rect.height; }

TG_KERNEL areaKernel(Parameters model, const std::uint32_t* order, std::uint32_t* areas) {
  const std::size_t rank = itemIndex();
  if (rank < model.count) areas[rank] = areaOf(model.rects[order[rank]]);
}

struct CutArguments {
  std::size_t gaussians, ranges, texels;
  const std::uint32_t* order;
  const std::uint32_t* first_texel;  // by rank
  const std::uint32_t* pair_begin;   // by Gaussian
  const PairCount* pair_count;
  std::uint32_t* places;
  std::uint32_t* ranks;
  std::uint32_t* pairs;
};
// Behind the last texel there may be Gaussians without.
TG_DEVICE std::size_t rangeOf(const CutArguments& a, std::size_t rank) {
  const std::size_t range = a.first_texel[rank] / a.texels;
  return range < a.ranges ? range : a.ranges - 1;
}
// One thread more than there are Gaussians: each writes the starts of the ranges between its own and the one before.
TG_KERNEL cutKernel(CutArguments a) {
  const std::size_t rank = itemIndex();
  if (rank > a.gaussians) return;
  const std::size_t before = rank == 0 ? 0 : rangeOf(a, rank - 1) + 1;
  const std::size_t here = rank == a.gaussians ? a.ranges : rangeOf(a, rank);
  std::uint32_t pair = 0;
  if (rank < a.gaussians) {
    const std::uint32_t i = a.order[rank];
    a.places[i] = static_cast<std::uint32_t>(a.first_texel[rank] - here * a.texels);
    pair = a.pair_begin[i];
  } else {
    pair = static_cast<std::uint32_t>(*a.pair_count);
  }
  for (std::size_t range = before; range <= here; ++range) {
    a.ranks[range] = static_cast<std::uint32_t>(rank);
    a.pairs[range] = pair;
  }
}

// A thread a range and tile; one range more than there are.
TG_KERNEL listPlacesKernel(Lists lists, const std::uint32_t* pairs, std::size_t tiles, std::size_t items,
                           std::uint32_t* places) {
  const std::size_t item = itemIndex();
  if (item >= items) return;
  const std::uint32_t pair = pairs[item / tiles];
  const std::uint32_t begin = lists.tile_begin[item % tiles];
  std::uint32_t low = begin, high = lists.tile_begin[item % tiles + 1];
  while (low < high) {
    const std::uint32_t middle = low + (high - low) / 2;
    if (lists.sorted_pairs[middle] < pair) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  places[item] = low - begin;
}

// Takes a sum: channel 3 is alpha.
TG_DEVICE float takeGradient(long long& sum, float value, std::size_t channel) {
  const bool clamped = channel == 3 && !(value >= 0.0f && value <= 1.0f);
  const float gradient = clamped ? 0.0f : static_cast<float>(sum) / kTexelUnits;
  sum = 0;
  return gradient;
}

TG_KERNEL finishTexelsKernel(long long* sums, const float* texels, float* v_texels, std::size_t count) {
  const std::size_t i = itemIndex();
  if (i < count) v_texels[i] = takeGradient(sums[i], texels[i], i % 4);
}

struct MoveArguments {
  TexelSums in;
  Parameters model;
  float* first;
  float* second;
  float rate, decay;
  AdamScales scales;
  bool clamp_colors;
  const std::uint32_t* stop;
  const std::uint32_t* owners;
  std::size_t owner_count;
};
TG_KERNEL moveTexelsKernel(MoveArguments a) {
  const bool still = stopped(a.stop);
  const std::size_t begin = a.in.ranks != nullptr ? a.in.ranks[0] : 0;
  const std::size_t end = a.in.ranks != nullptr ? a.in.ranks[1] : a.owners != nullptr ? a.owner_count : a.model.count;
  const std::size_t step = static_cast<std::size_t>(gridDim.x) * (kThreads / kLanes);
  for (std::size_t k = begin + itemIndex() / kLanes; k < end; k += step) {
    const std::size_t i = a.in.order != nullptr ? a.in.order[k] : a.owners != nullptr ? a.owners[k] : k;
    const TextureRect rect = a.model.rects[i];
    const bool drawn = a.owners != nullptr || a.in.tile_counts[i] != 0;  // of owners, others may be; else sums are 0
    long long* sums = a.in.sums + 4 * static_cast<std::size_t>(a.in.places != nullptr ? a.in.places[i] : rect.offset);
    const std::size_t at = 4 * static_cast<std::size_t>(rect.offset);
    const std::size_t floats = 4 * static_cast<std::size_t>(areaOf(rect));
    for (std::size_t f = threadIdx.x % kLanes; f < floats; f += kLanes) {
      float value = a.model.texels[at + f];
      const float gradient = drawn ? takeGradient(sums[f], value, f % 4) : 0.0f;
      if (still) continue;
      adamUpdate(value, gradient, a.first[at + f], a.second[at + f], a.rate, a.scales);
      if (a.decay > 0) value = decayedTexel(value, static_cast<unsigned>(f % 4), a.decay);
      a.model.texels[at + f] = a.clamp_colors || f % 4 == 3 ? clamp(value, 0.0f, 1.0f) : value;
    }
  }
}

}  // namespace

void cutRanges(const Parameters& model, std::size_t texels_at_a_time, std::size_t tiles, Primitives& primitives,
               TileLists& lists, DepthRanges& out) {
  const bool one = model.texel_count <= texels_at_a_time;
  out.count = one ? 1 : (model.texel_count + texels_at_a_time - 1) / texels_at_a_time;
  out.texels = one ? model.texel_count : texels_at_a_time + model.largest_rect;
  if (one) return;
  out.ranks.resize(out.count + 1);
  out.pairs.resize(out.count + 1);
  out.list_places.resize((out.count + 1) * tiles);
  out.texel_places = lists.indices.data();
  launch("areas", areaKernel, blocksFor(model.count), model, lists.order.data(), lists.counts.data());
  primitives.exclusiveSum(lists.counts.data(), lists.offsets.data(), model.count);
  launch(
      "cut", cutKernel, blocksFor(model.count + 1),
      CutArguments{model.count, out.count, texels_at_a_time, lists.order.data(), lists.offsets.data(),
                   lists.pair_begin.data(), lists.pairs.data(), out.texel_places, out.ranks.data(), out.pairs.data()});
  launch("list places", listPlacesKernel, blocksFor(out.list_places.size()), lists.lists(), out.pairs.data(), tiles,
         out.list_places.size(), out.list_places.data());
}

void finishTexels(const TexelSums& sums, const Parameters& model, float* v_texels) {
  const std::size_t count = 4 * model.texel_count;
  launch("finish texels", finishTexelsKernel, blocksFor(count), sums.sums, model.texels, v_texels, count);
}

void moveTexels(const TexelSums& sums, const TexelMove& move) {
  TG_ASSERT(move.owners == nullptr || sums.ranks == nullptr, "shared texels have one range");
  const std::size_t gaussians = move.owners != nullptr ? move.owner_count : move.model.count;
  launch("move texels", moveTexelsKernel, std::min(blocksFor(kLanes * gaussians), kMoveBlocks),
         MoveArguments{sums, move.model, move.moments.first.data(), move.moments.second.data(), move.rate, move.decay,
                       move.scales, move.clamp_colors, move.stop, move.owners, move.owner_count});
}

}  // namespace tg::cuda
