// SPDX-License-Identifier: Apache-2.0
// SSIM in float64, written from the definition.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace tg::test {

// Of one channel, every window summed on its own. Masked pixels are zero in both, and their windows are left out.
inline double referenceSsim(std::vector<double> a, std::vector<double> b, int width, int height,
                            const std::vector<std::uint8_t>& mask = {}) {
  int windows = 0;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0) a[i] = b[i] = 0;
  }
  double weights[11];
  double norm = 0;
  for (int i = 0; i < 11; ++i) norm += weights[i] = std::exp(-(i - 5) * (i - 5) / 4.5);
  double total = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (!mask.empty() && mask[static_cast<std::size_t>(y) * width + x] == 0) continue;
      ++windows;
      double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
      for (int j = std::max(0, y - 5); j <= std::min(height - 1, y + 5); ++j) {
        for (int i = std::max(0, x - 5); i <= std::min(width - 1, x + 5); ++i) {
          const double w = weights[j - y + 5] * weights[i - x + 5] / (norm * norm);
          const double p = a[static_cast<std::size_t>(j) * width + i];
          const double q = b[static_cast<std::size_t>(j) * width + i];
          ma += w * p, mb += w * q, aa += w * p * p, bb += w * q * q, ab += w * p * q;
        }
      }
      total += (2 * ma * mb + 1e-4) * (2 * (ab - ma * mb) + 9e-4) /
               ((ma * ma + mb * mb + 1e-4) * (aa - ma * ma + bb - mb * mb + 9e-4));
    }
  }
  return total / windows;
}

}  // namespace tg::test
