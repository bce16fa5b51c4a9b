// SPDX-License-Identifier: Apache-2.0
// Who gets which splats, what is sent of them, and how sums find their way back.
#include "training/mpi/pass.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "core/system/assert.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr std::int64_t kGrain = 128;  // splats per grab
// What a (tile, splat) pair costs, in what a pixel costs that is blended and compared (docs/lab/training-speed.md).
constexpr std::uint64_t kPairCost = 8;

// What blending and its gradient read of a Splat; `key` is the depth that it is sorted by.
struct SentSplat {
  float center_x, center_y, log2_opacity, radius2, margin;
  std::uint32_t key;
  float w_xx, w_xy, w_yy;
  float d_xx, d_xy, d_x1, d_yy, d_y1, d_11;
  float t_x, t_y, t_1;
  glm::vec3 base;
  float kappa_first, kappa_second;
  std::int32_t x0, y0, x1, y1;
  float near;
};
static_assert(sizeof(SentSplat) == 112);
static_assert(sizeof(cpu::Splat) == 216, "name the splat's new member below where blending reads it");
SentSplat sentOf(const cpu::Splat& s, std::uint32_t key) {
  return {s.center_x, s.center_y,    s.log2_opacity, s.radius2, s.margin, key,    s.w_xx, s.w_xy, s.w_yy,
          s.d_xx,     s.d_xy,        s.d_x1,         s.d_yy,    s.d_y1,   s.d_11, s.t_x,  s.t_y,  s.t_1,
          s.base,     s.kappa_first, s.kappa_second, s.x0,      s.y0,     s.x1,   s.y1,   s.near};
}
void take(const SentSplat& from, cpu::Splat& s) {
  s.center_x = from.center_x;
  s.center_y = from.center_y;
  s.log2_opacity = from.log2_opacity;
  s.radius2 = from.radius2;
  s.margin = from.margin;
  s.w_xx = from.w_xx;
  s.w_xy = from.w_xy;
  s.w_yy = from.w_yy;
  s.d_xx = from.d_xx;
  s.d_xy = from.d_xy;
  s.d_x1 = from.d_x1;
  s.d_yy = from.d_yy;
  s.d_y1 = from.d_y1;
  s.d_11 = from.d_11;
  s.t_x = from.t_x;
  s.t_y = from.t_y;
  s.t_1 = from.t_1;
  s.base = from.base;
  s.kappa_first = from.kappa_first;
  s.kappa_second = from.kappa_second;
  s.x0 = from.x0;
  s.y0 = from.y0;
  s.x1 = from.x1;
  s.y1 = from.y1;
  s.near = from.near;
}
// The rest, where textures apply; texels follow.
struct SentTexture {
  glm::vec3 wx, wy, dx, dy, d0, kappa;
  std::uint16_t width, height;
};
static_assert(sizeof(SentTexture) == 76);
SentTexture sentTextureOf(const cpu::Splat& s) {
  return {s.wx, s.wy, s.dx, s.dy, s.d0, s.kappa, s.texture_width, s.texture_height};
}
void take(const SentTexture& from, cpu::Splat& s) {
  s.wx = from.wx;
  s.wy = from.wy;
  s.dx = from.dx;
  s.dy = from.dy;
  s.d0 = from.d0;
  s.kappa = from.kappa;
  s.texture_width = from.width;
  s.texture_height = from.height;
}
std::size_t texelCount(const cpu::Splat& s) { return std::size_t{s.texture_width} * s.texture_height; }

// Rows in both.
LossRows common(LossRows a, LossRows b) { return {std::max(a.first, b.first), std::min(a.end, b.end)}; }
bool empty(LossRows rows) { return rows.first >= rows.end; }

// Some rows of `row` values each, of pixels that have the rows `all`.
template <typename Pixels>
auto rowsOf(Pixels& pixels, LossRows all, LossRows rows, std::size_t row) {
  return std::span(pixels).subspan(static_cast<std::size_t>(rows.first - all.first) * row,
                                   static_cast<std::size_t>(rows.end - rows.first) * row);
}

}  // namespace

std::vector<cpu::TileRows> shareRows(std::span<const std::uint64_t> costs, int ranks) {
  TG_ASSERT(ranks > 0, "there is a rank");
  std::uint64_t left = 0;
  for (const std::uint64_t cost : costs) left += cost;
  std::vector<cpu::TileRows> bands;
  const int rows = static_cast<int>(costs.size());
  int row = 0;
  for (int rank = 0; rank < ranks; ++rank) {
    const int first = row;
    // An even share of what is left, as near as whole rows come to it; a row at least while there are rows.
    const std::uint64_t share = left / static_cast<std::uint64_t>(ranks - rank);
    std::uint64_t taken = 0;
    while (row < rows &&
           (rank + 1 == ranks || row == first || taken + costs[static_cast<std::size_t>(row)] / 2 < share)) {
      taken += costs[static_cast<std::size_t>(row++)];
    }
    left -= taken;
    bands.push_back({first, row});
  }
  return bands;
}

LossRows ShardedPass::pixelRows(const cpu::TileRows& band) const {
  return {std::min(band.first * cpu::kTileHeight, view_.size.y), std::min(band.end * cpu::kTileHeight, view_.size.y)};
}

void ShardedPass::forward(const GaussianModel& part, const Camera& camera, const glm::vec3& background) {
  part_ = &part;
  RenderSettings settings;
  settings.background = background;
  view_ = cpu::makeView(part, camera, settings);
  requireDifferentiable(view_.outside, "training");
  cpu::findVisible(view_, part, gaussians_, keys_);
  cpu::projectSplats(view_, part, gaussians_, screen_);
  shareTiles();
  sendSplats();
  cpu::sortByDepth(received_keys_, order_);
  cpu::buildTileLists(view_, band_, received_, order_, true, lists_);
  cpu::blendPicture(view_, received_, lists_, received_texels_.data(), picture_, record_);
}

// By what all ranks' splats have in each row of tiles.
void ShardedPass::shareTiles() {
  const auto rows = static_cast<std::size_t>(cpu::tileRowsOf(view_));
  std::vector<std::uint64_t> pairs(rows, 0);
  for (const cpu::Splat& s : screen_.splats) {
    const cpu::TileRows met = cpu::tileRowsOf(s);
    if (met.empty()) continue;
    const auto across = static_cast<std::uint64_t>((s.x1 - 1) / cpu::kTileWidth + 1 - s.x0 / cpu::kTileWidth);
    for (int row = met.first; row < met.end; ++row) pairs[static_cast<std::size_t>(row)] += across;
  }
  std::vector<std::uint64_t> costs(rows, 0);
  for (const Message& message : exchangeWithAll(channel_, std::as_bytes(std::span(pairs)))) {
    const auto theirs = MessageReader(message).get<std::uint64_t>(rows);
    for (std::size_t row = 0; row < rows; ++row) costs[row] += kPairCost * theirs[row];
  }
  for (std::size_t row = 0; row < rows; ++row) {
    const LossRows pixels = pixelRows({static_cast<int>(row), static_cast<int>(row) + 1});
    costs[row] += static_cast<std::uint64_t>(pixels.end - pixels.first) * static_cast<std::uint64_t>(view_.size.x);
  }
  bands_ = shareRows(costs, channel_.size());
  band_ = bands_[static_cast<std::size_t>(channel_.rank())];
}

void ShardedPass::sendSplats() {
  sent_.assign(ranks(), {});
  numbers_.clear();
  reach_.assign(screen_.splats.size(), {});
  const auto owners = [&](int row) {  // the rank that has a row of tiles
    const auto after = std::ranges::upper_bound(bands_, row, {}, [](const cpu::TileRows& band) { return band.end; });
    return static_cast<int>(after - bands_.begin());
  };
  for (std::size_t k = 0; k < screen_.splats.size(); ++k) {
    const cpu::TileRows met = cpu::tileRowsOf(screen_.splats[k]);
    if (met.empty()) continue;
    const int first = owners(met.first);
    reach_[k] = {numbers_.size(), first, owners(met.end - 1) + 1 - first};
    for (int rank = first; rank < first + reach_[k].count; ++rank) {
      std::vector<std::uint32_t>& to = sent_[static_cast<std::size_t>(rank)];
      numbers_.push_back(static_cast<std::uint32_t>(to.size()));
      to.push_back(static_cast<std::uint32_t>(k));
    }
  }
  std::vector<Message> out(ranks());
  for (std::size_t r = 0; r < ranks(); ++r) {
    MessageWriter writer;
    std::vector<SentSplat> splats(sent_[r].size());
    for (std::size_t j = 0; j < splats.size(); ++j) {
      splats[j] = sentOf(screen_.splats[sent_[r][j]], keys_[sent_[r][j]].key);
    }
    std::size_t texels = 0;
    for (const std::uint32_t k : sent_[r]) texels += texelCount(screen_.splats[k]);
    writer.reserve(sizeof(std::size_t) + splats.size() * (sizeof(SentSplat) + sizeof(SentTexture)) +
                   texels * sizeof(glm::vec4));
    writer.put(splats.size());
    writer.put(splats);
    if (view_.textured()) {
      std::vector<SentTexture> textures(splats.size());
      for (std::size_t j = 0; j < splats.size(); ++j) textures[j] = sentTextureOf(screen_.splats[sent_[r][j]]);
      writer.put(textures);
      for (const std::uint32_t k : sent_[r]) {
        const cpu::Splat& s = screen_.splats[k];
        writer.put(std::span(part_->atlas.texels).subspan(s.texel_offset, texelCount(s)));
      }
    }
    out[r] = writer.take();
  }
  receiveSplats(exchangeMessages(channel_, std::move(out)));
}

void ShardedPass::receiveSplats(const std::vector<Message>& messages) {
  received_begin_.assign(1, 0);
  std::vector<MessageReader> readers(messages.begin(), messages.end());
  for (MessageReader& reader : readers) {
    received_begin_.push_back(received_begin_.back() + reader.get<std::size_t>());
  }
  received_.splats.resize(received_begin_.back());
  received_keys_.resize(received_begin_.back());
  std::size_t texels = 0;
  for (std::size_t r = 0; r < readers.size(); ++r) {
    const std::size_t first = received_begin_[r], count = received_begin_[r + 1] - first;
    const auto splats = readers[r].get<SentSplat>(count);
    for (std::size_t j = 0; j < count; ++j) {
      received_.splats[first + j].texture_width = received_.splats[first + j].texture_height = 0;
      take(splats[j], received_.splats[first + j]);
      received_keys_[first + j] = {splats[j].key, static_cast<std::uint32_t>(first + j)};
    }
    if (!view_.textured()) continue;
    const auto textures = readers[r].get<SentTexture>(count);
    const std::size_t before = texels;
    for (std::size_t j = 0; j < count; ++j) {
      cpu::Splat& s = received_.splats[first + j];
      take(textures[j], s);
      s.texel_offset = static_cast<std::uint32_t>(texels);
      texels += texelCount(s);
    }
    received_texels_.resize(texels);
    readers[r].get(std::span(received_texels_).subspan(before));
  }
}

void ShardedPass::collect(std::vector<glm::vec3>& picture) {
  picture.clear();
  const std::vector<Message> bands = toFirst(channel_, std::as_bytes(std::span(picture_)));
  for (std::size_t r = 0; r < bands.size(); ++r) {
    const LossRows rows = pixelRows(bands_[r]);
    const std::size_t pixels = static_cast<std::size_t>(rows.end - rows.first) * static_cast<std::size_t>(view_.size.x);
    const std::size_t before = picture.size();
    picture.resize(before + pixels);
    MessageReader(bands[r]).get(std::span(picture).subspan(before));
  }
}

LossValue ShardedPass::compare(PhotometricLoss& loss, int owner, const ViewPixels* photograph) {
  const int height = view_.size.y;
  const auto width = static_cast<std::size_t>(view_.size.x);
  const auto surroundings = [&](std::size_t rank) { return lossSurroundings(pixelRows(bands_[rank]), height); };
  const auto own = static_cast<std::size_t>(channel_.rank());
  const LossRows rows = pixelRows(band_), around = surroundings(own), whole{0, height};
  TG_ASSERT((photograph != nullptr) == (channel_.rank() == owner), "the photograph's owner has it");

  // Rows of the picture to whoever's windows need them, and the photograph's from who has it.
  std::vector<Message> out(ranks());
  const std::size_t hidden =
      photograph ? static_cast<std::size_t>(std::ranges::count(photograph->mask, std::uint8_t{0})) : 0;
  for (std::size_t r = 0; r < ranks(); ++r) {
    MessageWriter writer;
    const LossRows theirs = surroundings(r), shared = common(rows, theirs);
    if (!empty(shared)) writer.put(rowsOf(std::as_const(picture_), rows, shared, width));
    if (photograph) {
      writer.put(hidden);
      if (!empty(theirs)) {
        writer.put(rowsOf(photograph->rgb, whole, theirs, 3 * width));
        if (hidden > 0) writer.put(rowsOf(photograph->mask, whole, theirs, width));
      }
    }
    out[r] = writer.take();
  }
  const std::vector<Message> in = exchangeMessages(channel_, std::move(out));
  const std::size_t pixels = static_cast<std::size_t>(around.end - around.first) * width;
  std::vector<glm::vec3> picture(pixels);
  std::vector<std::uint8_t> rgb(3 * pixels), mask;
  std::size_t ignored = 0;
  for (std::size_t r = 0; r < ranks(); ++r) {
    MessageReader reader(in[r]);
    const LossRows shared = common(pixelRows(bands_[r]), around);
    if (!empty(shared)) reader.get(rowsOf(picture, around, shared, width));
    if (r != static_cast<std::size_t>(owner)) continue;
    ignored = reader.get<std::size_t>();
    if (empty(around)) continue;
    reader.get(std::span(rgb));
    if (ignored > 0) mask = reader.get<std::uint8_t>(pixels);
  }

  std::vector<LossRowSums> sums(3 * static_cast<std::size_t>(rows.end - rows.first));
  v_picture_.resize(picture_.size());
  loss.evaluateRows(view_.size.x, height, rows, ignored, picture, rgb, v_picture_, mask, sums);

  // Of all rows, in the order in which one process adds them.
  std::vector<LossRowSums> all(3 * static_cast<std::size_t>(height));
  const std::vector<Message> theirs = exchangeWithAll(channel_, std::as_bytes(std::span(sums)));
  for (std::size_t r = 0; r < ranks(); ++r) {
    MessageReader reader(theirs[r]);
    const LossRows of = pixelRows(bands_[r]);
    for (std::size_t c = 0; c < 3; ++c) {
      reader.get(std::span(all).subspan(c * static_cast<std::size_t>(height) + static_cast<std::size_t>(of.first),
                                        static_cast<std::size_t>(of.end - of.first)));
    }
  }
  return loss.total(view_.size.x, height, ignored, all);
}

void ShardedPass::backward(const GradientOptions& options, ModelGradient& gradient) {
  if (view_.textured()) {
    v_texels_.assign(received_texels_.size(), glm::vec4(0.0f));
    v_texels_range_.assign(received_.splats.size(), {0, 0});
    kept_begin_.assign(lists_.splats.size(), 0);
    kept_range_.assign(lists_.splats.size(), {0, 0});
    kept_texels_.clear();
  }
  cpu::backwardPairs({view_, received_, lists_, record_, received_texels_.data(), v_picture_, options},
                     texels_in_flight_, pairs_, [&] { keepTexels(); });
  std::vector<Message> out(ranks());
  for (std::size_t r = 0; r < ranks(); ++r) out[r] = sumsFor(r, options);
  std::vector<Message> in = exchangeMessages(channel_, std::move(out));
  std::vector<Returned> returned(ranks());
  for (std::size_t r = 0; r < ranks(); ++r) {
    returned[r] = readSums(in[r], sent_[r].size(), options);
    in[r] = Message();
  }
  if (view_.textured()) {
    gradient.texels.assign(part_->atlas.texels.size(), glm::vec4(0.0f));
    gatherTexels(returned, gradient);
  }
  cpu::finishModel(
      view_, *part_, gaussians_, screen_,
      [&](std::uint32_t k, cpu::SplatSums& sums) { return gather(k, returned, sums); }, splat_of_, gradient);
}

// Of the group of tiles whose texels' gradients are there now.
void ShardedPass::keepTexels() {
  parallelFor(static_cast<std::int64_t>(received_.splats.size()), kGrain, [&](std::int64_t k) {
    const cpu::Splat& s = received_.splats[k];
    if (s.texture_width == 0 || !beginsHere(s)) return;
    const auto [first, end] =
        cpu::addSlots(pairs_.slots, lists_.pair_begin[k], lists_.pair_begin[k + 1], v_texels_.data() + s.texel_offset);
    if (first >= end) return;
    cpu::TexelSlots::Range& range = v_texels_range_[k];
    range = range.first < range.end ? cpu::TexelSlots::Range{std::min(range.first, first), std::max(range.end, end)}
                                    : cpu::TexelSlots::Range{first, end};
  });
  for (std::size_t k = 0; k < received_.splats.size(); ++k) {
    const cpu::Splat& s = received_.splats[k];
    if (s.texture_width == 0 || beginsHere(s)) continue;
    for (std::uint32_t pair = lists_.pair_begin[k]; pair < lists_.pair_begin[k + 1]; ++pair) {
      if (pairs_.slots.begin[pair] == cpu::TexelSlots::kNone) continue;
      const cpu::TexelSlots::Range range = pairs_.slots.written[pair];
      const auto slot = pairs_.slots.texels.begin() + static_cast<std::ptrdiff_t>(pairs_.slots.begin[pair]);
      kept_begin_[pair] = kept_texels_.size();
      kept_range_[pair] = range;
      if (range.first < range.end) kept_texels_.insert(kept_texels_.end(), slot + range.first, slot + range.end);
    }
  }
}

// A splat whose pairs begin here has one record, the sum of its pairs so far; one that has pairs above has a record a
// pair, which its owner adds to those.
Message ShardedPass::sumsFor(std::size_t rank, const GradientOptions& options) const {
  std::vector<std::uint32_t> counts;
  std::vector<cpu::SplatSums> records;
  std::vector<cpu::TexelSlots::Range> written;
  MessageWriter texels;
  for (std::size_t k = received_begin_[rank]; k < received_begin_[rank + 1]; ++k) {
    const cpu::Splat& s = received_.splats[k];
    const bool begins = beginsHere(s), textured = s.texture_width > 0;
    const std::size_t before = records.size();
    for (std::uint32_t pair = lists_.pair_begin[k]; pair < lists_.pair_begin[k + 1]; ++pair) {
      if (pairs_.shows[pair] == 0) continue;
      if (!begins || records.size() == before) {
        records.push_back({&s, {}, {}, 0.0f});
        if (textured) {
          const cpu::TexelSlots::Range range = begins ? v_texels_range_[k] : kept_range_[pair];
          const glm::vec4* from =
              begins ? v_texels_.data() + s.texel_offset + range.first : kept_texels_.data() + kept_begin_[pair];
          texels.put(std::span(from, range.end - range.first));
          written.push_back(range);
        } else if (view_.textured()) {
          written.push_back({0, 0});
        }
      }
      cpu::addPair(pairs_, pair, textured, records.back());
    }
    counts.push_back(static_cast<std::uint32_t>(records.size() - before));
  }
  Message of_texels = texels.take();
  MessageWriter writer;
  writer.reserve(counts.size() * sizeof(counts[0]) +
                 records.size() * (sizeof(cpu::PairSums) + sizeof(float) + sizeof(cpu::PairTextureSums) +
                                   sizeof(cpu::TexelSlots::Range)) +
                 of_texels.size());
  writer.put(counts);
  for (const cpu::SplatSums& record : records) writer.put(record.pairs);
  if (options.statistics) {
    for (const cpu::SplatSums& record : records) writer.put(record.screen_abs);
  }
  if (view_.textured()) {
    for (const cpu::SplatSums& record : records) writer.put(record.texture);
    writer.put(written);
    writer.put(of_texels);
  }
  return writer.take();
}

ShardedPass::Returned ShardedPass::readSums(const Message& message, std::size_t splats,
                                            const GradientOptions& options) const {
  MessageReader reader(message);
  Returned returned;
  returned.begin.assign(1, 0);
  for (const std::uint32_t count : reader.get<std::uint32_t>(splats)) {
    returned.begin.push_back(returned.begin.back() + count);
  }
  const std::size_t records = returned.begin.back();
  returned.sums = reader.get<cpu::PairSums>(records);
  if (options.statistics) returned.screen_abs = reader.get<float>(records);
  if (!view_.textured()) return returned;
  returned.texture_sums = reader.get<cpu::PairTextureSums>(records);
  returned.written = reader.get<cpu::TexelSlots::Range>(records);
  std::size_t texels = 0;
  for (const cpu::TexelSlots::Range& range : returned.written) {
    returned.texels_begin.push_back(texels);
    texels += range.end - range.first;
  }
  returned.texels = reader.get<glm::vec4>(texels);
  return returned;
}

// Of the splat's bands from top to bottom, which is the order of its tiles.
bool ShardedPass::gather(std::uint32_t k, const std::vector<Returned>& returned, cpu::SplatSums& sums) const {
  bool shows = false;
  const Reach& reach = reach_[k];
  for (int b = 0; b < reach.count; ++b) {
    const Returned& from = returned[static_cast<std::size_t>(reach.first + b)];
    const std::uint32_t number = numbers_[reach.begin + static_cast<std::size_t>(b)];
    for (std::uint32_t i = from.begin[number]; i < from.begin[number + 1]; ++i) {
      if (!shows) sums = {&screen_.splats[k], {}, {}, 0.0f};
      shows = true;
      cpu::addSums(from.sums[i], sums.pairs);
      if (!from.screen_abs.empty()) sums.screen_abs += from.screen_abs[i];
      if (screen_.splats[k].texture_width > 0) cpu::addSums(from.texture_sums[i], sums.texture);
    }
  }
  return shows;
}

void ShardedPass::gatherTexels(const std::vector<Returned>& returned, ModelGradient& gradient) const {
  parallelFor(static_cast<std::int64_t>(screen_.splats.size()), kGrain, [&](std::int64_t k) {
    const Reach& reach = reach_[k];
    glm::vec4* v_texels = gradient.texels.data() + screen_.splats[k].texel_offset;
    for (int b = 0; b < reach.count; ++b) {
      const Returned& from = returned[static_cast<std::size_t>(reach.first + b)];
      const std::uint32_t number = numbers_[reach.begin + static_cast<std::size_t>(b)];
      for (std::uint32_t i = from.begin[number]; i < from.begin[number + 1]; ++i) {
        const cpu::TexelSlots::Range range = from.written[i];
        const glm::vec4* texels = from.texels.data() + from.texels_begin[i];
        for (std::uint32_t t = range.first; t < range.end; ++t) v_texels[t] += texels[t - range.first];
      }
    }
  });
}

}  // namespace tg
