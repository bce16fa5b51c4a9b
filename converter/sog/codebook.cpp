// SPDX-License-Identifier: Apache-2.0
// Codebooks by dynamic programming, palettes by k-means in two levels.
#include "converter/sog/codebook.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "core/system/random.h"

namespace tg {
namespace {

constexpr std::size_t kBins = 4096;

// Sums of the numbers of bins [0, i): their count, the numbers, their squares.
struct Sums {
  std::vector<double> count, sum, square;

  double mean(std::size_t begin, std::size_t end) const {
    return (sum[end] - sum[begin]) / (count[end] - count[begin]);
  }
  double error(std::size_t begin, std::size_t end) const {
    const double n = count[end] - count[begin], s = sum[end] - sum[begin];
    return n > 0 ? square[end] - square[begin] - s * s / n : 0.0;
  }
};

// Bins half by rank and half by value: as fine where numbers are dense as in the tails. Empty ones are left out.
Sums binned(std::span<const float> sorted) {
  const double low = sorted.front(), range = static_cast<double>(sorted.back()) - low;
  const double middle = low + 0.5 * range;  // differences of squares stay exact enough around it
  Sums sums{{0.0}, {0.0}, {0.0}};
  std::size_t bin = kBins;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const double place =
        0.5 * static_cast<double>(i) / static_cast<double>(sorted.size()) + 0.5 * (sorted[i] - low) / range;
    const std::size_t own = std::min(static_cast<std::size_t>(place * kBins), kBins - 1);
    if (own != bin) {
      for (std::vector<double>* values : {&sums.count, &sums.sum, &sums.square}) values->push_back(values->back());
      bin = own;
    }
    const double x = sorted[i] - middle;
    sums.count.back() += 1;
    sums.sum.back() += x;
    sums.square.back() += x * x;
  }
  return sums;
}

// The ends of the best `size` runs of bins. Where the last run of the first j bins begins grows with j, which halves
// the search again and again.
std::vector<std::size_t> bestEnds(const Sums& sums, std::size_t size) {
  const std::size_t bins = sums.count.size() - 1;
  std::vector<double> before(bins + 1, 0.0), best(bins + 1);
  for (std::size_t j = 1; j <= bins; ++j) before[j] = sums.error(0, j);
  std::vector<std::vector<std::uint32_t>> begin(size, std::vector<std::uint32_t>(bins + 1, 0));
  for (std::size_t k = 1; k < size; ++k) {
    struct Task {
      std::size_t low, high, first, last;
    };
    std::fill(best.begin(), best.end(), std::numeric_limits<double>::infinity());
    std::vector<Task> tasks = {{k + 1, bins, k, bins - 1}};
    while (!tasks.empty()) {
      const Task task = tasks.back();
      tasks.pop_back();
      if (task.low > task.high) continue;
      const std::size_t j = (task.low + task.high) / 2;
      std::size_t chosen = task.first;
      for (std::size_t s = task.first; s <= std::min(task.last, j - 1); ++s) {
        const double error = before[s] + sums.error(s, j);
        if (error < best[j]) {
          best[j] = error;
          chosen = s;
        }
      }
      begin[k][j] = static_cast<std::uint32_t>(chosen);
      tasks.push_back({task.low, j - 1, task.first, chosen});
      tasks.push_back({j + 1, task.high, chosen, task.last});
    }
    std::swap(before, best);
  }
  std::vector<std::size_t> ends(size);
  std::size_t end = bins;
  for (std::size_t k = size; k-- > 0; end = begin[k][end]) ends[k] = end;
  return ends;
}

// ---- Palettes
constexpr int kRounds = 8;
constexpr std::size_t kSamplesPerCell = 64;  // that choose the cells
constexpr std::size_t kLane = 16;            // centres that are compared at once

// Centres with their columns side by side: [length][count rounded up to kLane].
struct Centers {
  std::size_t length, count, stride;
  std::vector<float> values;

  Centers(std::size_t row_length, std::size_t n)
      : length(row_length), count(n), stride((n + kLane - 1) / kLane * kLane), values(row_length * stride) {}
  void set(std::size_t center, const float* row) {
    for (std::size_t j = 0; j < length; ++j) values[j * stride + center] = row[j];
  }
  std::size_t nearest(const float* row, float& squared) const {
    std::size_t best = 0;
    squared = std::numeric_limits<float>::infinity();
    for (std::size_t first = 0; first < count; first += kLane) {
      float sums[kLane] = {};
      for (std::size_t j = 0; j < length; ++j) {
        const float* column = values.data() + j * stride + first;
        for (std::size_t c = 0; c < kLane; ++c) {
          const float d = row[j] - column[c];
          sums[c] += d * d;
        }
      }
      for (std::size_t c = 0; c < std::min(kLane, count - first); ++c) {
        if (sums[c] < squared) {
          squared = sums[c];
          best = first + c;
        }
      }
    }
    return best;
  }
};

using Rows = std::span<const std::uint32_t>;  // which of all rows

struct Clusters {
  std::vector<float> rows;  // [count][length]
  std::vector<std::uint32_t> labels;
  std::vector<float> squared;  // distance of each row from its centre
};

// `count` of the rows, each chosen with a chance that grows with its squared distance from those before (k-means++;
// Arthur and Vassilvitskii 2007, section 2.2).
std::vector<float> firstCenters(std::span<const float> all, std::size_t length, Rows which, std::size_t count) {
  std::vector<float> centers(count * length), squared(which.size(), std::numeric_limits<float>::infinity());
  Random random(0);
  std::size_t chosen = static_cast<std::size_t>(random.uniform() * static_cast<double>(which.size()));
  for (std::size_t c = 0;; ++c) {
    const float* center = all.data() + std::size_t{which[chosen]} * length;
    std::copy_n(center, length, centers.data() + c * length);
    if (c + 1 == count) return centers;
    double total = 0;
    for (std::size_t i = 0; i < which.size(); ++i) {
      const float* row = all.data() + std::size_t{which[i]} * length;
      float sum = 0;
      for (std::size_t j = 0; j < length && sum < squared[i]; ++j) sum += (row[j] - center[j]) * (row[j] - center[j]);
      squared[i] = std::min(squared[i], sum);
      total += squared[i];
    }
    double left = random.uniform() * total;
    for (chosen = 0; chosen + 1 < which.size() && (left -= squared[chosen]) > 0; ++chosen) {
    }
  }
}

// Lloyd's k-means of some rows; a centre that nothing is near takes the farthest row.
Clusters cluster(std::span<const float> all, std::size_t length, Rows which, std::size_t count) {
  TG_ASSERT(count >= 1 && count <= which.size(), "no more clusters than rows");
  Clusters clusters;
  clusters.rows = firstCenters(all, length, which, count);
  clusters.labels.resize(which.size());
  clusters.squared.resize(which.size());
  std::vector<double> sums(count * length);
  std::vector<std::size_t> members(count);
  for (int round = 0;; ++round) {
    Centers centers(length, count);
    for (std::size_t c = 0; c < count; ++c) centers.set(c, clusters.rows.data() + c * length);
    for (std::size_t i = 0; i < which.size(); ++i) {
      clusters.labels[i] =
          static_cast<std::uint32_t>(centers.nearest(all.data() + std::size_t{which[i]} * length, clusters.squared[i]));
    }
    if (round == kRounds) return clusters;
    std::fill(sums.begin(), sums.end(), 0.0);
    std::fill(members.begin(), members.end(), 0);
    for (std::size_t i = 0; i < which.size(); ++i) {
      const float* row = all.data() + std::size_t{which[i]} * length;
      double* sum = sums.data() + clusters.labels[i] * length;
      for (std::size_t j = 0; j < length; ++j) sum[j] += row[j];
      ++members[clusters.labels[i]];
    }
    for (std::size_t c = 0; c < count; ++c) {
      float* center = clusters.rows.data() + c * length;
      if (members[c] > 0) {
        for (std::size_t j = 0; j < length; ++j) {
          center[j] = static_cast<float>(sums[c * length + j] / static_cast<double>(members[c]));
        }
        continue;
      }
      const auto farthest = std::max_element(clusters.squared.begin(), clusters.squared.end());
      *farthest = 0.0f;
      const std::size_t from = which[static_cast<std::size_t>(farthest - clusters.squared.begin())];
      std::copy_n(all.data() + from * length, length, center);
    }
  }
}

// `total` shared out by `weights`, each getting 1 to its `limits`; the limits reach `total` together.
std::vector<std::size_t> shares(const std::vector<double>& weights, const std::vector<std::size_t>& limits,
                                std::size_t total) {
  std::vector<std::size_t> result(weights.size());
  double low = 0.0, high = 1.0;
  const auto fill = [&](double factor) {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const double wanted = std::min(weights[i] * factor, static_cast<double>(limits[i]));
      sum += result[i] = std::max<std::size_t>(1, static_cast<std::size_t>(wanted));
    }
    return sum;
  };
  const double most = *std::max_element(weights.begin(), weights.end());
  while (fill(high) < total && high * most < 1e30) high *= 2.0;
  for (int step = 0; step < 60; ++step) {
    const double middle = 0.5 * (low + high);
    (fill(middle) > total ? high : low) = middle;
  }
  fill(low);
  return result;
}

}  // namespace

std::vector<float> makeCodebook(std::span<const float> numbers, std::size_t size) {
  TG_ASSERT(!numbers.empty() && size >= 1, "numbers and room for one");
  std::vector<float> sorted(numbers.begin(), numbers.end());
  std::sort(sorted.begin(), sorted.end());
  std::vector<float> codebook = sorted;
  codebook.erase(std::unique(codebook.begin(), codebook.end()), codebook.end());
  if (codebook.size() > size) {
    const Sums sums = binned(sorted);
    const double middle = sorted.front() + 0.5 * (static_cast<double>(sorted.back()) - sorted.front());
    std::size_t begin = 0;
    codebook.clear();
    for (const std::size_t end : bestEnds(sums, std::min(size, sums.count.size() - 1))) {
      codebook.push_back(static_cast<float>(middle + sums.mean(begin, end)));
      begin = end;
    }
  }
  return codebook;
}

std::size_t nearestIn(std::span<const float> codebook, float number) {
  const auto after = std::lower_bound(codebook.begin(), codebook.end(), number);
  if (after == codebook.begin()) return 0;
  const auto at = static_cast<std::size_t>(after - codebook.begin());
  if (after == codebook.end()) return at - 1;
  return number - codebook[at - 1] <= *after - number ? at - 1 : at;
}

Palette makePalette(std::span<const float> rows, std::size_t length, std::size_t size) {
  TG_ASSERT(length >= 1 && rows.size() % length == 0 && size >= 1, "whole rows and room for one");
  const std::size_t n = rows.size() / length;
  Palette palette;
  palette.labels.resize(n);
  if (n <= size) {
    palette.rows.assign(rows.begin(), rows.end());
    std::iota(palette.labels.begin(), palette.labels.end(), 0u);
    return palette;
  }
  // Cells of the sampled rows, then every row into its cell.
  const auto cells = std::min<std::size_t>(static_cast<std::size_t>(std::sqrt(static_cast<double>(size))), 256);
  std::vector<std::uint32_t> sample(std::min(n, cells * kSamplesPerCell));
  Random random(0);
  for (std::size_t i = 0; i < sample.size(); ++i) {
    const std::size_t begin = i * n / sample.size(), end = (i + 1) * n / sample.size();
    sample[i] = static_cast<std::uint32_t>(
        begin + static_cast<std::size_t>(random.uniform() * static_cast<double>(end - begin)));
  }
  const Clusters coarse = cluster(rows, length, sample, cells);
  Centers centers(length, cells);
  for (std::size_t c = 0; c < cells; ++c) centers.set(c, coarse.rows.data() + c * length);
  std::vector<std::uint32_t> cell(n);
  std::vector<float> squared(n);
  parallelFor(static_cast<std::int64_t>(n), 256, [&](std::int64_t i) {
    cell[i] =
        static_cast<std::uint32_t>(centers.nearest(rows.data() + static_cast<std::size_t>(i) * length, squared[i]));
  });
  std::vector<std::vector<std::uint32_t>> members(cells);
  std::vector<double> error(cells, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    members[cell[i]].push_back(static_cast<std::uint32_t>(i));
    error[cell[i]] += squared[i];
  }
  std::vector<std::size_t> filled;
  for (std::size_t c = 0; c < cells; ++c) {
    if (!members[c].empty()) filled.push_back(c);
  }
  std::vector<double> weights;
  std::vector<std::size_t> limits;
  for (const std::size_t c : filled) {
    weights.push_back(error[c] + 1e-30);
    limits.push_back(members[c].size());
  }
  const std::vector<std::size_t> counts = shares(weights, limits, size);
  std::vector<Clusters> fine(filled.size());
  parallelFor(static_cast<std::int64_t>(filled.size()), 1,
              [&](std::int64_t k) { fine[k] = cluster(rows, length, members[filled[k]], counts[k]); });
  std::size_t first = 0;
  for (std::size_t k = 0; k < filled.size(); ++k) {
    palette.rows.insert(palette.rows.end(), fine[k].rows.begin(), fine[k].rows.end());
    for (std::size_t i = 0; i < members[filled[k]].size(); ++i) {
      palette.labels[members[filled[k]][i]] = static_cast<std::uint32_t>(first) + fine[k].labels[i];
    }
    first += counts[k];
  }
  return palette;
}

}  // namespace tg
