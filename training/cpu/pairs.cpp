// SPDX-License-Identifier: Apache-2.0
// Groups of tiles; then Gaussians in their own order, so that the gradient is written as one stream.
#include "training/cpu/pairs.h"

#include <algorithm>
#include <array>

#include "core/system/assert.h"
#include "core/system/parallel.h"

namespace tg::cpu {
namespace {

constexpr std::size_t kGrain = 128;  // Gaussians per grab
constexpr std::uint32_t kNoSplat = ~std::uint32_t{0};

// Texels of the splat at a position of the tile lists, 0 if it does not show there.
std::uint32_t texelsAt(const BackwardInput& input, std::uint32_t position) {
  const Splat& s = input.screen.splats[input.lists.splats[position]];
  return input.record.shows(position) ? std::uint32_t{s.texture_width} * s.texture_height : 0;
}

// Lays out the texel slots of as many tiles from `first` on as fit, at least one. Returns the tile after the last.
int makeSlots(const BackwardInput& input, std::size_t texels_in_flight, int first, TexelSlots& slots) {
  const TileLists& lists = input.lists;
  slots.begin.assign(lists.splats.size(), TexelSlots::kNone);
  slots.written.resize(lists.splats.size());
  std::size_t texels = 0;
  int tile = first;
  for (; tile < lists.tiles(); ++tile) {
    std::size_t next = texels;
    for (std::uint32_t at = lists.begin[tile]; at < lists.begin[tile + 1]; ++at) next += texelsAt(input, at);
    if (tile > first && next > texels_in_flight) break;
    for (std::uint32_t at = lists.begin[tile]; at < lists.begin[tile + 1]; ++at) {
      if (texelsAt(input, at) == 0) continue;
      slots.begin[lists.pairs[at]] = texels;
      texels += texelsAt(input, at);
    }
  }
  if (slots.texels.size() < texels) slots.texels.resize(texels);
  return tile;
}

void clear(const GaussianModel& model, std::size_t i, ModelGradient& gradient) {
  forEachField(
      [&]<typename T>(const Field& field, std::vector<T>& v) {
        const std::size_t count = field.values(model.shCount());
        std::fill_n(v.data() + i * count, count, T{});
      },
      gradient);
  gradient.screen_gradient[i] = 0.0f;
  gradient.screen_gradient_abs[i] = 0.0f;
}

// An alpha texel outside [0, 1] is about to be clamped by its owner: no gradient pushes it further.
void maskAlphaTexels(const GaussianModel& model, const Splat& s, ModelGradient& gradient) {
  const std::size_t texels = std::size_t{s.texture_width} * s.texture_height;
  for (std::size_t i = s.texel_offset; i < s.texel_offset + texels; ++i) {
    const float alpha = model.atlas.texels[i].a;
    if (!(alpha >= 0.0f && alpha <= 1.0f)) gradient.texels[i].a = 0.0f;
  }
}

}  // namespace

void backwardPairs(const BackwardInput& input, std::size_t texels_in_flight, PairBuffers& out,
                   const std::function<void()>& gather) {
  const TileLists& lists = input.lists;
  const bool textured = input.view.textured();
  out.shows.assign(lists.splats.size(), 0);
  out.sums.resize(lists.splats.size());
  out.screen_abs.resize(input.options.statistics ? lists.splats.size() : 0);
  out.texture_sums.resize(textured ? lists.splats.size() : 0);
  for (int first = 0; first < lists.tiles();) {
    const int end = textured ? makeSlots(input, texels_in_flight, first, out.slots) : lists.tiles();
    backwardTiles(input, first, end, {out.shows, out.sums, out.screen_abs, out.texture_sums, out.slots});
    if (textured) gather();
    first = end;
  }
}

void addPair(const PairBuffers& pairs, std::uint32_t pair, bool textured, SplatSums& to) {
  TG_ASSERT(pairs.shows[pair] != 0, "a pair that shows");
  addSums(pairs.sums[pair], to.pairs);
  if (!pairs.screen_abs.empty()) to.screen_abs += pairs.screen_abs[pair];
  if (textured) addSums(pairs.texture_sums[pair], to.texture);
}

TexelSlots::Range addSlots(const TexelSlots& slots, std::uint32_t first, std::uint32_t end, glm::vec4* v_texels) {
  TexelSlots::Range changed{0, 0};
  for (std::uint32_t pair = first; pair < end; ++pair) {
    if (slots.begin[pair] == TexelSlots::kNone) continue;
    const glm::vec4* slot = slots.texels.data() + slots.begin[pair];
    const TexelSlots::Range written = slots.written[pair];
    for (std::uint32_t i = written.first; i < written.end; ++i) v_texels[i] += slot[i];
    if (written.first >= written.end) continue;
    if (changed.first >= changed.end) changed = written;
    changed = {std::min(changed.first, written.first), std::max(changed.end, written.end)};
  }
  return changed;
}

void finishModel(const View& view, const GaussianModel& model, std::span<const std::uint32_t> gaussians,
                 const ScreenSplats& screen, const GatherSplat& gather, std::vector<std::uint32_t>& splat_of,
                 ModelGradient& gradient) {
  const std::size_t n = model.size();
  TG_ASSERT(gaussians.size() == screen.splats.size(), "a splat a Gaussian");
  TG_ASSERT(!view.textured() || gradient.texels.size() == model.atlas.texels.size(), "the texels' part is there");
  forEachField([](const Field&, auto& v, const auto& values) { v.resize(values.size()); }, gradient, model);
  if (!view.textured()) gradient.texels.assign(model.atlas.texels.size(), glm::vec4(0.0f));
  gradient.screen_gradient.resize(n);
  gradient.screen_gradient_abs.resize(n);
  gradient.screen_radius.resize(n);
  splat_of.assign(n, kNoSplat);
  for (std::size_t k = 0; k < gaussians.size(); ++k) splat_of[gaussians[k]] = static_cast<std::uint32_t>(k);

  const auto batch = static_cast<std::size_t>(finishBatchSize());
  parallelFor(static_cast<std::int64_t>((n + kGrain - 1) / kGrain), 1, [&](std::int64_t chunk) {
    std::array<SplatSums, kMaxFinishBatch> sums;
    std::size_t filled = 0;
    const std::size_t begin = static_cast<std::size_t>(chunk) * kGrain;
    const std::size_t end = std::min(n, begin + kGrain);
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t k = splat_of[i];
      gradient.screen_radius[i] = k == kNoSplat ? 0.0f : screen.screen_radius[k];
      if (k == kNoSplat || !gather(k, sums[filled])) {
        clear(model, i, gradient);
        continue;
      }
      maskAlphaTexels(model, *sums[filled].splat, gradient);
      if (++filled == batch) {
        finishSplats(view, model, std::span(sums).first(filled), gradient);
        filled = 0;
      }
    }
    if (filled > 0) finishSplats(view, model, std::span(sums).first(filled), gradient);
  });
}

}  // namespace tg::cpu
