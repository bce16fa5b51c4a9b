// SPDX-License-Identifier: Apache-2.0
// One array after the other, so that no message holds a whole model.
#include "training/mpi/shards.h"

#include <algorithm>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "training/mpi/messages.h"

namespace tg {
namespace {

// Runs of an array's values, one a rank: [ranks + 1].
using Cuts = std::vector<std::size_t>;

Cuts cutsOf(const Shards& shards, std::size_t length) {
  Cuts cuts = shards.begin;
  for (std::size_t& cut : cuts) cut *= length;
  return cuts;
}

// Its memory, too, which an assignment of {} keeps.
template <typename T>
void free(std::vector<T>& values) {
  values = std::vector<T>();
}

// The first rank's `whole` to all ranks' parts.
template <typename T>
void scatterArray(Channel& channel, const Cuts& cuts, std::vector<T>& whole, std::vector<T>& part) {
  const auto ranks = static_cast<std::size_t>(channel.size());
  const auto rank = static_cast<std::size_t>(channel.rank());
  std::vector<std::span<const std::byte>> to(ranks);
  std::vector<std::span<std::byte>> from(ranks);
  if (rank == 0) {
    TG_ASSERT(whole.size() == cuts.back(), "the array has the length that is cut");
    for (std::size_t r = 0; r < ranks; ++r) {
      to[r] = std::as_bytes(std::span(whole).subspan(cuts[r], cuts[r + 1] - cuts[r]));
    }
  }
  part.resize(cuts[rank + 1] - cuts[rank]);
  part.shrink_to_fit();
  from[0] = std::as_writable_bytes(std::span(part));
  channel.exchange(to, from);
  if (rank == 0) free(whole);
}

template <typename T>
void gatherArray(Channel& channel, const Cuts& cuts, std::span<const T> part, std::vector<T>& whole) {
  const auto ranks = static_cast<std::size_t>(channel.size());
  const auto rank = static_cast<std::size_t>(channel.rank());
  TG_ASSERT(part.size() == cuts[rank + 1] - cuts[rank], "the part has the length that was cut");
  std::vector<std::span<const std::byte>> to(ranks);
  std::vector<std::span<std::byte>> from(ranks);
  to[0] = std::as_bytes(part);
  if (rank == 0) {
    whole.resize(cuts.back());
    for (std::size_t r = 0; r < ranks; ++r) {
      from[r] = std::as_writable_bytes(std::span(whole).subspan(cuts[r], cuts[r + 1] - cuts[r]));
    }
  }
  channel.exchange(to, from);
}

// Visits every array that is cut: visit(values a Gaussian, member of set...), but texels and their moments. Sets have
// `training`, `min_sigma` and `statistics`, as RunState and ShardState do.
template <typename Visit, typename... Sets>
void forEachArray(std::size_t k, bool filtered, const Visit& visit, Sets&... sets) {
  forEachField([&](const Field& field, auto&... values) { visit(field.values(k), values...); }, sets.training.model...);
  forEachField(
      [&](const Field& field, auto&... moments) {
        visit(field.row(k), moments.first...);
        visit(field.row(k), moments.second...);
      },
      sets.training.moments...);
  if (filtered) visit(std::size_t{1}, sets.min_sigma...);
  visit(std::size_t{1}, sets.statistics.score_sum...);
  visit(std::size_t{1}, sets.statistics.magnitude_sum...);
  visit(std::size_t{1}, sets.statistics.view_count...);
  visit(std::size_t{1}, sets.statistics.max_radius...);
}

// What all ranks know of a model.
struct Shape {
  std::uint64_t gaussians = 0;
  std::int64_t step = 0;
  int sh_degree = 0;
  TextureMode texture_mode{};
  IntersectionModel intersection{};
  TextureOutside outside{};
  bool filtered = false;
  bool rects = false;
};

// Where each rank's texels begin; those of no texture are none.
Cuts texelCuts(const Shards& shards, const TextureAtlas& atlas) {
  Cuts cuts(shards.begin.size(), 0);
  std::size_t next = 0;
  for (std::size_t r = 0; r + 1 < cuts.size(); ++r) {
    cuts[r] = next;
    for (std::size_t i = shards.begin[r]; i < shards.begin[r + 1] && !atlas.rects.empty(); ++i) {
      const TextureRect& rect = atlas.rects[i];
      if (rect.texelCount() > 0 && rect.offset != next) {
        throw Error(ErrorKind::badData,
                    "textures: expected texels in the order of their Gaussians, for several processes");
      }
      next += rect.texelCount();
    }
  }
  cuts.back() = next;
  return cuts;
}

// The cuts of their moments.
Cuts texelFloats(const Shards& shards) {
  Cuts cuts = shards.texels_begin;
  for (std::size_t& cut : cuts) cut *= 4;
  return cuts;
}

}  // namespace

Shards Shards::even(std::size_t gaussians, int ranks) {
  TG_ASSERT(ranks > 0, "there is a rank");
  Shards shards;
  const auto count = static_cast<std::size_t>(ranks);
  shards.begin.clear();
  // As gaussians * r / count, where that product may not fit.
  for (std::size_t r = 0; r <= count; ++r) {
    shards.begin.push_back(gaussians / count * r + gaussians % count * r / count);
  }
  return shards;
}

void scatter(Channel& channel, RunState& whole, Shards& shards, ShardState& shard) {
  const bool first = channel.rank() == 0;
  GaussianModel& model = whole.training.model;
  MessageWriter said;
  if (first) {
    said.put(Shape{model.size(), whole.training.step, model.sh_degree, model.texture_mode, model.intersection,
                   model.outside, !whole.min_sigma.empty(), !model.atlas.rects.empty()});
  }
  const Message message = fromFirst(channel, said.take());
  const auto shape = MessageReader(message).get<Shape>();
  shards = Shards::even(shape.gaussians, channel.size());
  GaussianModel& part = shard.training.model;
  part.sh_degree = shape.sh_degree;
  part.texture_mode = shape.texture_mode;
  part.intersection = shape.intersection;
  part.outside = shape.outside;
  shard.training.step = shape.step;
  if (!shape.filtered) free(shard.min_sigma);
  forEachArray(
      part.shCount(), shape.filtered,
      [&](std::size_t length, auto& from, auto& to) { scatterArray(channel, cutsOf(shards, length), from, to); }, whole,
      shard);

  shard.filtered = shape.filtered;
  part.atlas.rects.clear();
  if (shape.rects) {
    std::vector<TextureRect> rects = model.atlas.rects;
    scatterArray(channel, cutsOf(shards, 1), rects, part.atlas.rects);
  }
  MessageWriter texels;
  if (first) {
    shards.texels_begin = texelCuts(shards, model.atlas);
    if (shards.texels_begin.back() != model.atlas.texels.size()) {
      throw Error(ErrorKind::badData, "textures: expected no texels but those of Gaussians, for several processes" +
                                          expectedFound(shards.texels_begin.back(), model.atlas.texels.size()));
    }
    texels.put(shards.texels_begin);
  }
  const Message cut = fromFirst(channel, texels.take());
  shards.texels_begin = MessageReader(cut).get<std::size_t>(static_cast<std::size_t>(channel.size()) + 1);
  std::uint32_t offset = 0;
  for (TextureRect& rect : part.atlas.rects) {
    rect.offset = offset;
    offset += rect.texelCount();
  }
  scatterArray(channel, shards.texels_begin, model.atlas.texels, part.atlas.texels);
  TG_ASSERT(offset == part.atlas.texels.size(), "a shard has the texels of its textures");
  Moments& moments = whole.training.moments.texels;
  scatterArray(channel, texelFloats(shards), moments.first, shard.training.moments.texels.first);
  scatterArray(channel, texelFloats(shards), moments.second, shard.training.moments.texels.second);
}

void gather(Channel& channel, const Shards& shards, const ShardState& shard, RunState& whole) {
  const GaussianModel& part = shard.training.model;
  GaussianModel& model = whole.training.model;
  if (channel.rank() == 0) {
    model.sh_degree = part.sh_degree;
    whole.training.step = shard.training.step;
    if (!shard.filtered) whole.min_sigma.clear();
  }
  forEachArray(
      part.shCount(), shard.filtered,
      [&]<typename T>(std::size_t length, const std::vector<T>& from, std::vector<T>& to) {
        gatherArray(channel, cutsOf(shards, length), std::span(from), to);
      },
      shard, whole);
  gatherArray(channel, shards.texels_begin, std::span(part.atlas.texels), model.atlas.texels);
  const Moments& moments = shard.training.moments.texels;
  gatherArray(channel, texelFloats(shards), std::span(moments.first), whole.training.moments.texels.first);
  gatherArray(channel, texelFloats(shards), std::span(moments.second), whole.training.moments.texels.second);
}

void dropArrays(RunState& whole) {
  const auto drop = [](std::size_t, auto& values) { free(values); };
  forEachArray(1, true, drop, whole);
  drop(0, whole.training.model.atlas.texels);
  drop(0, whole.training.moments.texels.first);
  drop(0, whole.training.moments.texels.second);
}

template <typename T>
void gatherValues(Channel& channel, const Shards& shards, std::span<const T> part, std::vector<T>& whole) {
  gatherArray(channel, shards.begin, part, whole);
}
template void gatherValues(Channel&, const Shards&, std::span<const float>, std::vector<float>&);
template void gatherValues(Channel&, const Shards&, std::span<const std::uint32_t>, std::vector<std::uint32_t>&);
template void gatherValues(Channel&, const Shards&, std::span<const glm::vec3>, std::vector<glm::vec3>&);
template void gatherValues(Channel&, const Shards&, std::span<const glm::vec4>, std::vector<glm::vec4>&);

void selectGaussians(Channel& channel, std::span<const std::uint32_t> source, std::size_t kept, Shards& shards,
                     ShardState& shard) {
  TG_ASSERT(kept <= source.size(), "no more keep their moments than there are");
  TG_ASSERT(shards.texels_begin.back() == 0, "a model without textures");
  const Shards fresh = Shards::even(source.size(), channel.size());
  const auto ranks = static_cast<std::size_t>(channel.size());
  const auto rank = static_cast<std::size_t>(channel.rank());
  const std::size_t count = fresh.count(channel.rank());
  // Rows of this shard that rank r wants, and rows of the new one that come from r; those with their moments first.
  struct Rows {
    std::vector<std::uint32_t> all;
    std::size_t kept = 0;
    void add(std::size_t row, bool keeps) {
      all.push_back(static_cast<std::uint32_t>(row));
      kept += keeps;
    }
  };
  std::vector<Rows> give(ranks), take(ranks);
  for (std::size_t r = 0; r < ranks; ++r) {
    for (std::size_t j = fresh.begin[r]; j < fresh.begin[r + 1]; ++j) {
      const bool own = source[j] >= shards.begin[rank] && source[j] < shards.begin[rank + 1];
      if (own) give[r].add(source[j] - shards.begin[rank], j < kept);
    }
  }
  for (std::size_t j = fresh.begin[rank]; j < fresh.begin[rank + 1]; ++j) {
    const auto owner = std::ranges::upper_bound(shards.begin, std::size_t{source[j]}) - shards.begin.begin() - 1;
    take[static_cast<std::size_t>(owner)].add(j - fresh.begin[rank], j < kept);
  }
  const auto move = [&]<typename T>(std::vector<T>& values, std::size_t length, bool moments) {
    std::vector<Message> out(ranks);
    for (std::size_t r = 0; r < ranks; ++r) {
      MessageWriter writer;
      const std::size_t rows = moments ? give[r].kept : give[r].all.size();
      writer.reserve(rows * length * sizeof(T));
      for (std::size_t i = 0; i < rows; ++i) {
        writer.put(std::span<const T>(values).subspan(give[r].all[i] * length, length));
      }
      out[r] = writer.take();
    }
    values = std::vector<T>(count * length, T{});
    const std::vector<Message> in = exchangeMessages(channel, std::move(out));
    for (std::size_t r = 0; r < ranks; ++r) {
      MessageReader reader(in[r]);
      const std::size_t rows = moments ? take[r].kept : take[r].all.size();
      for (std::size_t i = 0; i < rows; ++i) {
        reader.get(std::span(values).subspan(take[r].all[i] * length, length));
      }
    }
  };
  const std::size_t k = shard.training.model.shCount();
  forEachField(
      [&](const Field& field, auto& values, Moments& moments) {
        move(values, field.values(k), false);
        move(moments.first, field.row(k), true);
        move(moments.second, field.row(k), true);
      },
      shard.training.model, shard.training.moments);
  shard.statistics.reset(count);
  shard.min_sigma.clear();
  shard.filtered = false;
  shards = fresh;
  shards.texels_begin.assign(ranks + 1, 0);
}

}  // namespace tg
