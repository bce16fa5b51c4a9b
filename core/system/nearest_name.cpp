// SPDX-License-Identifier: Apache-2.0
// Slips of a hand.
#include "core/system/nearest_name.h"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

namespace tg {

std::string nearestName(std::string_view text, std::span<const std::string> names) {
  std::string best;
  // Slips of a hand: a letter more, less, another, or two that changed places.
  std::size_t fewest = std::max<std::size_t>(1, std::min<std::size_t>(text.size() / 3, 3)) + 1;
  for (const std::string& name : names) {
    if (text.size() >= name.size() + fewest || name.size() >= text.size() + fewest) continue;
    const std::size_t columns = name.size() + 1;
    std::vector<std::size_t> older(columns), last(columns), row(columns);
    std::iota(last.begin(), last.end(), std::size_t{0});
    for (std::size_t i = 1; i <= text.size(); ++i) {
      row[0] = i;
      for (std::size_t j = 1; j < columns; ++j) {
        row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (text[i - 1] == name[j - 1] ? 0 : 1)});
        const bool swapped = i > 1 && j > 1 && text[i - 1] == name[j - 2] && text[i - 2] == name[j - 1];
        if (swapped) row[j] = std::min(row[j], older[j - 2] + 1);
      }
      older = std::exchange(last, row);
    }
    if (last.back() < fewest) {
      fewest = last.back();
      best = name;
    }
  }
  if (!best.empty() || text.size() < 3) return best;
  const auto longer = std::ranges::find_if(names, [&](const std::string& name) { return name.starts_with(text); });
  return longer == names.end() ? "" : *longer;
}

}  // namespace tg
