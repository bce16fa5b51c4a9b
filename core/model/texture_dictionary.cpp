// SPDX-License-Identifier: Apache-2.0
// Textures that several Gaussians share.
#include "core/model/texture_dictionary.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/system/random.h"
#include "shared/splat.h"

namespace tg {
namespace {

constexpr std::size_t kMostFitted = 32768;  // Gaussians that k-means looks at
constexpr int kRounds = 12;                 // of it, and as many more with a price on bits
constexpr int kTurns = 8;

// How a texture lies on its Gaussian: entry(i, j) = texture(a, b) with a = i or mirrored, b = j or mirrored, and then
// the two exchanged or not.
struct Turn {
  bool mirror_u, mirror_v, exchange;
};
constexpr Turn turnOf(int number) { return {(number & 1) != 0, (number & 2) != 0, (number & 4) != 0}; }

// For every texel of an entry the one of the texture.
std::vector<std::uint32_t> texelsOf(Turn turn, int side) {
  std::vector<std::uint32_t> from;
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      int a = turn.mirror_u ? side - 1 - i : i;
      int b = turn.mirror_v ? side - 1 - j : j;
      if (turn.exchange) std::swap(a, b);
      from.push_back(static_cast<std::uint32_t>(b * side + a));
    }
  }
  return from;
}

// Turns the Gaussian's axes under its texture, so that the entry lies on it as the texture did.
void turnGaussian(GaussianModel& model, std::size_t i, Turn turn) {
  glm::vec3& log_scale = model.log_scale[i];
  const int c = shortestAxis(log_scale), a = c == 0 ? 1 : 0, b = 3 - a - c;
  glm::dmat3 axes(0.0);  // columns: the new local axes, in the old ones
  axes[a][turn.exchange ? b : a] = turn.mirror_u ? -1.0 : 1.0;
  axes[b][turn.exchange ? a : b] = turn.mirror_v ? -1.0 : 1.0;
  axes[c][c] = 1.0;
  if (turn.exchange) std::swap(log_scale[a], log_scale[b]);
  // Of two axes that are the shortest the first is the normal (docs/math.md 2.2); c may be the second now.
  const int normal = shortestAxis(log_scale);
  if (normal != c) {
    TG_ASSERT(normal == 0 && c == 1, "u was before the normal");
    axes = {axes[c], axes[a], axes[b]};
    log_scale = {log_scale[c], log_scale[a], log_scale[b]};
  }
  if (glm::determinant(axes) < 0.0) axes[normal] = -axes[normal];
  const glm::vec4 stored = model.rotation[i];
  const glm::dquat turned = glm::dquat(stored.x, stored.y, stored.z, stored.w) * glm::quat_cast(axes);
  model.rotation[i] = glm::vec4(turned.w, turned.x, turned.y, turned.z);
}

// Vector quantisation with a price on bits (Chou, Lookabaugh and Gray 1989, "Entropy-Constrained Vector Quantization",
// section II): k-means in which a choice also costs what it takes to say it, by how many others make it.
class KMeans {
 public:
  KMeans(const GaussianModel& model, std::size_t entries, std::span<const double> weights, double bit_cost,
         std::uint64_t seed, const std::atomic<bool>* stop)
      : model_(model), side_(model.atlas.rects.front().width), texels_(static_cast<std::size_t>(side_) * side_) {
    for (int turn = 0; turn < kTurns; ++turn) turns_[turn] = texelsOf(turnOf(turn), side_);
    const std::vector<double> shares = texelShares(side_);
    for (int j = 0; j < side_; ++j) {
      for (int i = 0; i < side_; ++i) roots_.push_back(static_cast<float>(std::sqrt(shares[i] * shares[j])));
    }
    const std::size_t n = model.size(), fitted = std::min(n, std::max(kMostFitted, 4 * entries));
    for (std::size_t k = 0; k < fitted; ++k) fitted_.push_back(static_cast<std::uint32_t>(k * n / fitted));
    weights_.assign(weights.begin(), weights.end());
    const double most = n > 0 ? *std::ranges::max_element(weights_) : 0.0;
    // What is not seen has a place, too, and all of them where nothing is.
    for (double& weight : weights_) weight = most > 0.0 ? std::max(weight, most * 1e-9) : 1.0;
    entries_ = std::min(entries, fitted + 1);
    entry_bits_.assign(entries_, 0.0);
    begin(seed);
    const auto move_on = [&] {
      for (int round = 0; round < kRounds && !(stop && *stop); ++round) move();
    };
    move_on();
    if (bit_cost == 0.0 || fitted_.empty()) return;
    bit_cost_ = bit_cost * meanChange();
    move_on();
  }

  struct Choice {
    std::uint32_t entry;
    int turn;
    double cost;
  };
  Choice choose(std::size_t gaussian) const {
    Choice best{0, 0, std::numeric_limits<double>::infinity()};
    std::vector<float> turned(length()), all(length() * kTurns), distances(kTurns * columns_.size() / length());
    for (int turn = 0; turn < kTurns; ++turn) {
      take(gaussian, turn, turned);
      for (std::size_t d = 0; d < length(); ++d) all[d * kTurns + static_cast<std::size_t>(turn)] = turned[d];
    }
    const std::size_t stride = distances.size() / kTurns;
    for (std::size_t tile = 0; tile < stride; tile += kTile) takeDistances(all, tile, stride, distances);
    for (int turn = 0; turn < kTurns; ++turn) {
      const float* of_turn = distances.data() + static_cast<std::size_t>(turn) * stride;
      for (std::size_t k = 0; k < entries_; ++k) {
        const double cost = weights_[gaussian] * of_turn[k] + bit_cost_ * (entry_bits_[k] + turn_bits_[turn]);
        if (cost < best.cost) best = {static_cast<std::uint32_t>(k), turn, cost};
      }
    }
    return best;
  }
  glm::vec4 texel(std::size_t entry, std::size_t t) const {
    glm::vec4 value;
    for (std::size_t k = 0; k < 4; ++k) value[static_cast<int>(k)] = columns_[place(entry, 4 * t + k)] / roots_[t];
    return value;
  }
  std::size_t texelCount() const { return texels_; }

 private:
  static constexpr std::size_t kTile =
      4;  // entries that lie side by side: their sums and a texture's stay in registers
  std::size_t length() const { return 4 * texels_; }
  // Of an entry's number d in columns_.
  std::size_t place(std::size_t entry, std::size_t d) const {
    return (entry / kTile * length() + d) * kTile + entry % kTile;
  }
  // Squared, of a texture in all ways it may lie, [length, kTurns], from the kTile entries from `first` on; to
  // [kTurns, stride].
  void takeDistances(std::span<const float> turned, std::size_t first, std::size_t stride, std::span<float> to) const {
    float sums[kTurns][kTile] = {};
    const float* column = columns_.data() + place(first, 0);
    for (std::size_t d = 0; d < length(); ++d, column += kTile) {
      const float* own = turned.data() + d * kTurns;
      const auto add = [&](std::size_t turn) {
        for (std::size_t k = 0; k < kTile; ++k) sums[turn][k] += (own[turn] - column[k]) * (own[turn] - column[k]);
      };
      // Written out: in a loop over turns the sums would be memory.
      [&]<std::size_t... turn>(std::index_sequence<turn...>) { (add(turn), ...); }(std::make_index_sequence<kTurns>());
    }
    for (int turn = 0; turn < kTurns; ++turn) {
      std::copy_n(sums[turn], kTile, to.data() + static_cast<std::size_t>(turn) * stride + first);
    }
  }
  // A texture as it would lie after the turn, each texel times the root of its share.
  void take(std::size_t gaussian, int turn, std::vector<float>& to) const {
    const glm::vec4* from = model_.atlas.texels.data() + model_.atlas.rects[gaussian].offset;
    for (std::size_t t = 0; t < texels_; ++t) {
      const glm::vec4 value = from[turns_[turn][t]] * roots_[t];
      for (int k = 0; k < 4; ++k) to[4 * t + static_cast<std::size_t>(k)] = value[k];
    }
  }
  void set(std::size_t entry, std::span<const float> values) {
    for (std::size_t d = 0; d < length(); ++d) columns_[place(entry, d)] = values[d];
  }

  // The texture that changes nothing, as take() would give it.
  std::vector<float> neutral() const {
    std::vector<float> values(length(), 0.0f);
    for (std::size_t t = 0; t < texels_; ++t) values[4 * t + 3] = roots_[t];
    return values;
  }
  static float distance(std::span<const float> a, std::span<const float> b) {
    float sum = 0.0f;
    for (std::size_t d = 0; d < a.size(); ++d) sum += (a[d] - b[d]) * (a[d] - b[d]);
    return sum;
  }
  // Weighted: what textures change.
  double meanChange() const {
    const std::vector<float> none = neutral();
    std::vector<float> own(length());
    double sum = 0.0;
    for (const std::uint32_t i : fitted_) {
      take(i, 0, own);
      sum += weights_[i] * distance(own, none);
    }
    return sum / static_cast<double>(fitted_.size());
  }

  // k-means++: the next entry is a texture that is far from all before; the first one changes nothing.
  void begin(std::uint64_t seed) {
    Random random(seed);
    columns_.assign(length() * ((entries_ + kTile - 1) / kTile * kTile), 0.0f);
    std::vector<float> values = neutral();
    std::vector<double> far(fitted_.size(), std::numeric_limits<double>::infinity());
    for (std::size_t entry = 0; entry < entries_; ++entry) {
      if (entry > 0) {
        double sum = 0.0;
        for (std::size_t k = 0; k < far.size(); ++k) sum += far[k] * weights_[fitted_[k]];
        double place = random.uniform() * sum;
        std::size_t chosen = 0;
        while (chosen + 1 < far.size() && (place -= far[chosen] * weights_[fitted_[chosen]]) > 0.0) ++chosen;
        take(fitted_[chosen], 0, values);
      }
      set(entry, values);
      parallelFor(static_cast<std::int64_t>(far.size()), 256, [&](std::int64_t k) {
        std::vector<float> turned(length());
        for (int turn = 0; turn < kTurns; ++turn) {
          take(fitted_[k], turn, turned);
          far[k] = std::min(far[k], static_cast<double>(distance(turned, values)));
        }
      });
    }
  }

  // One of Lloyd's rounds. An entry that nobody chooses stays where it is.
  void move() {
    std::vector<Choice> found(fitted_.size());
    parallelFor(static_cast<std::int64_t>(found.size()), 16, [&](std::int64_t k) { found[k] = choose(fitted_[k]); });
    std::vector<double> sums(length() * entries_, 0.0), weights(entries_, 0.0), users(entries_, 0.0);
    std::array<double, kTurns> turned_so{};
    std::vector<float> turned(length());
    for (std::size_t k = 0; k < found.size(); ++k) {
      const double weight = weights_[fitted_[k]];
      take(fitted_[k], found[k].turn, turned);
      weights[found[k].entry] += weight;
      users[found[k].entry] += 1.0;
      turned_so[found[k].turn] += 1.0;
      for (std::size_t d = 0; d < length(); ++d) sums[d * entries_ + found[k].entry] += weight * turned[d];
    }
    for (std::size_t d = 0; d < length(); ++d) {
      for (std::size_t k = 0; k < entries_; ++k) {
        if (weights[k] > 0.0) columns_[place(k, d)] = static_cast<float>(sums[d * entries_ + k] / weights[k]);
      }
    }
    // With half a user more, or what nobody chose would never be chosen again.
    const auto bits = [&](double part) { return std::log2((static_cast<double>(found.size()) + 0.5) / (part + 0.5)); };
    for (std::size_t k = 0; k < entries_; ++k) entry_bits_[k] = bits(users[k]);
    for (int turn = 0; turn < kTurns; ++turn) turn_bits_[turn] = bits(turned_so[turn]);
  }

  const GaussianModel& model_;
  int side_;
  std::size_t texels_, entries_ = 0;
  std::array<std::vector<std::uint32_t>, kTurns> turns_;
  std::vector<float> roots_;
  std::vector<std::uint32_t> fitted_;
  std::vector<double> weights_;
  std::vector<float> columns_;  // [entries / kTile, length, kTile], times the roots
  double bit_cost_ = 0.0;
  std::vector<double> entry_bits_;  // that say a choice, after the last round
  std::array<double, kTurns> turn_bits_{};
};

// textureGroups() of the first n Gaussians.
std::vector<std::uint32_t> groupsOf(const TextureAtlas& atlas, std::size_t n) {
  const auto texelsOf = [&](const TextureRect& rect) {
    return std::span(atlas.texels).subspan(rect.offset, rect.texelCount());
  };
  const auto compare = [&](std::uint32_t i, std::uint32_t j) {  // below, at or above 0
    const TextureRect &a = atlas.rects[i], &b = atlas.rects[j];
    if (a.width != b.width) return a.width - b.width;
    if (a.height != b.height) return a.height - b.height;
    const auto first = texelsOf(a);
    return first.empty() ? 0 : std::memcmp(first.data(), texelsOf(b).data(), first.size_bytes());
  };
  struct Key {
    std::uint64_t hash;  // what differs seldom has the same: texels are looked at where it is
    std::uint32_t gaussian;
  };
  std::vector<Key> keys(n);
  constexpr std::int64_t kChunk = 4096;
  parallelFor((static_cast<std::int64_t>(n) + kChunk - 1) / kChunk, 1, [&](std::int64_t chunk) {
    const auto end = std::min<std::size_t>(n, (chunk + 1) * kChunk);
    for (auto i = static_cast<std::size_t>(chunk * kChunk); i < end; ++i) {
      const TextureRect& rect = atlas.rects[i];
      std::uint64_t hash = std::uint64_t{rect.width} << 16 | rect.height;
      for (const glm::vec4& texel : texelsOf(rect)) {
        for (int c = 0; c < 4; ++c) hash = Random(hash ^ std::bit_cast<std::uint32_t>(texel[c])).bits();
      }
      keys[i] = {hash, static_cast<std::uint32_t>(i)};
    }
  });
  std::ranges::sort(keys, [&](const Key& a, const Key& b) {
    if (a.hash != b.hash) return a.hash < b.hash;
    const auto found = compare(a.gaussian, b.gaussian);
    return found != 0 ? found < 0 : a.gaussian < b.gaussian;
  });
  std::vector<std::uint32_t> first(n), groups(n);  // the first Gaussian of each one's group; numbers
  for (std::size_t k = 0; k < n; ++k) {
    const std::uint32_t own = keys[k].gaussian;
    const bool same = k > 0 && keys[k - 1].hash == keys[k].hash && compare(keys[k - 1].gaussian, own) == 0;
    first[own] = same ? first[keys[k - 1].gaussian] : own;
  }
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < n; ++i) groups[i] = first[i] == i ? count++ : groups[first[i]];
  return groups;
}

}  // namespace

std::vector<std::uint32_t> textureGroups(const TextureAtlas& atlas) { return groupsOf(atlas, atlas.rects.size()); }

std::vector<std::uint32_t> firstOfGroups(std::span<const std::uint32_t> groups) {
  std::vector<std::uint32_t> first;
  for (std::uint32_t i = 0; i < groups.size(); ++i) {
    if (groups[i] == first.size()) first.push_back(i);
  }
  return first;
}

bool areShared(const TextureAtlas& atlas, std::span<const std::uint32_t> groups) {
  TG_ASSERT(groups.size() == atlas.rects.size(), "a group of each Gaussian");
  const std::vector<std::uint32_t> first = firstOfGroups(groups);
  const auto hasTexels = [&](std::uint32_t i) { return atlas.rects[i].texelCount() > 0; };
  const auto different = std::ranges::count_if(first, hasTexels);
  const auto textured =
      std::ranges::count_if(atlas.rects, [](const TextureRect& rect) { return rect.texelCount() > 0; });
  return different > 0 && first.size() <= kMostSharedTextures && 2 * different <= textured;
}

TextureAtlas heldOnce(const TextureAtlas& atlas, std::span<const std::uint32_t> groups) {
  TextureAtlas once;
  std::vector<TextureRect> rects;  // of the groups
  for (const std::uint32_t first : firstOfGroups(groups)) {
    TextureRect rect = atlas.rects[first];
    const auto texels = atlas.texels.begin() + rect.offset;
    rect.offset = static_cast<std::uint32_t>(once.texels.size());
    once.texels.insert(once.texels.end(), texels, texels + rect.texelCount());
    rects.push_back(rect);
  }
  for (const std::uint32_t group : groups) once.rects.push_back(rects[group]);
  return once;
}

std::optional<TextureAtlas> heldOnce(const TextureAtlas& atlas) {
  constexpr std::size_t kEnough = 2 * kMostSharedTextures;  // Gaussians that may have too many by themselves
  if (atlas.rects.size() > kEnough) {
    if (firstOfGroups(groupsOf(atlas, kEnough)).size() > kMostSharedTextures) return std::nullopt;
  }
  const std::vector<std::uint32_t> groups = textureGroups(atlas);
  if (!areShared(atlas, groups)) return std::nullopt;
  return heldOnce(atlas, groups);
}

void requireShareable(const TextureAtlas& atlas) {
  if (atlas.rects.empty()) return;
  const TextureRect size = atlas.rects.front();
  const auto text = [](const TextureRect& rect) {
    return std::to_string(rect.width) + " x " + std::to_string(rect.height);
  };
  for (const TextureRect& rect : atlas.rects) {
    if (rect.texelCount() > 0 && rect.width == size.width && rect.height == size.width) continue;
    if (rect.texelCount() == 0 || size.texelCount() == 0) {
      throw Error(ErrorKind::usage, "textures that Gaussians share are of all of them (found some without)");
    }
    const bool square = size.width == size.height;
    throw Error(ErrorKind::usage, "textures that Gaussians share are squares of one size (found " +
                                      (square ? text(size) + " and " : "") + text(rect) + " texels)");
  }
}

bool shareTextures(GaussianModel& model, std::size_t entries, std::span<const double> weights, double bit_cost,
                   std::uint64_t seed, const std::atomic<bool>* stop) {
  TG_ASSERT(entries > 0 && entries <= kMostSharedTextures, "a number of textures that Gaussians can share");
  TG_ASSERT(weights.size() == model.size(), "a weight a Gaussian");
  TG_ASSERT(bit_cost >= 0.0, "bits that cost something, or nothing");
  if (model.atlas.rects.empty()) return true;
  requireShareable(model.atlas);
  const KMeans dictionary(model, entries, weights, bit_cost, seed, stop);
  if (stop && *stop) return false;
  std::vector<KMeans::Choice> found(model.size());
  parallelFor(static_cast<std::int64_t>(found.size()), 16,
              [&](std::int64_t i) { found[i] = dictionary.choose(static_cast<std::size_t>(i)); });
  for (std::size_t i = 0; i < found.size(); ++i) {
    glm::vec4* texels = model.atlas.texels.data() + model.atlas.rects[i].offset;
    for (std::size_t t = 0; t < dictionary.texelCount(); ++t) texels[t] = dictionary.texel(found[i].entry, t);
    turnGaussian(model, i, turnOf(found[i].turn));
  }
  return true;
}

}  // namespace tg
