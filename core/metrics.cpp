// SPDX-License-Identifier: Apache-2.0
// PSNR and SSIM. Rows are summed separately and added in order: the same number for any thread count.
#include "core/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"

namespace tg {
namespace {

constexpr int kRadius = 5;  // 11 x 11 window
constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;

void checkSameSize(const Image& a, const Image& b) {
  const auto size = [](const Image& i) {
    return std::to_string(i.width) + " x " + std::to_string(i.height) + " x " + std::to_string(i.channels);
  };
  if (a.width != b.width || a.height != b.height || a.channels != b.channels)
    throw Error(ErrorKind::badData, "images of different sizes (expected " + size(a) + ", found " + size(b) + ")");
  if (a.data.empty()) throw Error(ErrorKind::badData, "images without pixels (expected at least one)");
}

double sum(const std::vector<double>& values) {
  double total = 0.0;
  for (double v : values) total += v;
  return total;
}

// `quantize` maps a value in [0, 1] to what is compared.
template <typename Quantize>
double psnrOf(const Image& a, const Image& b, Quantize quantize) {
  checkSameSize(a, b);
  const std::size_t row = static_cast<std::size_t>(a.width) * a.channels;
  std::vector<double> row_sums(static_cast<std::size_t>(a.height));
  parallelFor(a.height, 16, [&](std::int64_t y) {
    const float* pa = a.data.data() + static_cast<std::size_t>(y) * row;
    const float* pb = b.data.data() + static_cast<std::size_t>(y) * row;
    double total = 0.0;
    for (std::size_t i = 0; i < row; ++i) {
      const double d = quantize(std::clamp(pa[i], 0.0f, 1.0f)) - quantize(std::clamp(pb[i], 0.0f, 1.0f));
      total += d * d;
    }
    row_sums[static_cast<std::size_t>(y)] = total;
  });
  const double mse = sum(row_sums) / static_cast<double>(a.data.size());
  return mse == 0.0 ? std::numeric_limits<double>::infinity() : -10.0 * std::log10(mse);
}

std::array<double, 2 * kRadius + 1> gaussianWindow() {
  std::array<double, 2 * kRadius + 1> window{};
  double total = 0.0;
  for (int i = -kRadius; i <= kRadius; ++i) {
    window[static_cast<std::size_t>(i + kRadius)] = std::exp(-i * i / (2.0 * 1.5 * 1.5));
    total += window[static_cast<std::size_t>(i + kRadius)];
  }
  for (double& w : window) w /= total;
  return window;
}

// SSIM summed over the rows [y0, y1) of one channel. The five moments are blurred along x once per row, into planes
// that reach kRadius rows beyond the band, then along y.
class SsimBand {
 public:
  SsimBand(const Image& a, const Image& b) : a_(a), b_(b), window_(gaussianWindow()) {}

  void sumRows(int channel, int y0, int y1, std::vector<double>& row_sums) const {
    const int width = a_.width;
    const int first = std::max(0, y0 - kRadius);
    const int last = std::min(a_.height, y1 + kRadius);
    const std::size_t stride = static_cast<std::size_t>(width) * 5;
    std::vector<double> blurred(static_cast<std::size_t>(last - first) * stride);
    // Zero padding along x lives in the row buffers.
    std::vector<double> moments[5];
    for (auto& m : moments) m.assign(static_cast<std::size_t>(width) + 2 * kRadius, 0.0);
    for (int y = first; y < last; ++y) {
      for (int x = 0; x < width; ++x) {
        const double p = a_.at(x, y, channel);
        const double q = b_.at(x, y, channel);
        const std::size_t i = static_cast<std::size_t>(x + kRadius);
        moments[0][i] = p;
        moments[1][i] = q;
        moments[2][i] = p * p;
        moments[3][i] = q * q;
        moments[4][i] = p * q;
      }
      double* out = blurred.data() + static_cast<std::size_t>(y - first) * stride;
      for (int m = 0; m < 5; ++m, out += width) {
        std::fill(out, out + width, 0.0);
        for (int k = 0; k <= 2 * kRadius; ++k) {
          const double w = window_[static_cast<std::size_t>(k)];
          const double* in = moments[m].data() + k;
          for (int x = 0; x < width; ++x) out[x] += w * in[x];
        }
      }
    }
    std::vector<double> columns(stride);
    for (int y = y0; y < y1; ++y) {
      std::fill(columns.begin(), columns.end(), 0.0);
      for (int v = std::max(first, y - kRadius); v <= std::min(last - 1, y + kRadius); ++v) {
        const double w = window_[static_cast<std::size_t>(v - y + kRadius)];
        const double* in = blurred.data() + static_cast<std::size_t>(v - first) * stride;
        for (std::size_t i = 0; i < stride; ++i) columns[i] += w * in[i];
      }
      double total = 0.0;
      for (int x = 0; x < width; ++x) {
        const double* c = columns.data() + x;
        const double mean_a = c[0];
        const double mean_b = c[width];
        const double var_a = c[2 * width] - mean_a * mean_a;
        const double var_b = c[3 * width] - mean_b * mean_b;
        const double covariance = c[4 * width] - mean_a * mean_b;
        total += (2.0 * mean_a * mean_b + kC1) * (2.0 * covariance + kC2) /
                 ((mean_a * mean_a + mean_b * mean_b + kC1) * (var_a + var_b + kC2));
      }
      row_sums[static_cast<std::size_t>(channel) * a_.height + static_cast<std::size_t>(y)] = total;
    }
  }

 private:
  const Image& a_;
  const Image& b_;
  std::array<double, 2 * kRadius + 1> window_;
};

}  // namespace

double psnr(const Image& a, const Image& b) {
  return psnrOf(a, b, [](float v) { return static_cast<double>(v); });
}

double psnr8Bit(const Image& a, const Image& b) {
  return psnrOf(a, b, [](float v) { return std::floor(v * 255.0 + 0.5) / 255.0; });
}

double ssim(const Image& a, const Image& b) {
  checkSameSize(a, b);
  constexpr int band_rows = 32;
  const int bands = (a.height + band_rows - 1) / band_rows;
  const SsimBand band(a, b);
  std::vector<double> row_sums(static_cast<std::size_t>(a.channels) * a.height);
  parallelFor(std::int64_t{bands} * a.channels, 1, [&](std::int64_t item) {
    const int y0 = static_cast<int>(item % bands) * band_rows;
    band.sumRows(static_cast<int>(item / bands), y0, std::min(y0 + band_rows, a.height), row_sums);
  });
  return sum(row_sums) / static_cast<double>(a.data.size());
}

}  // namespace tg
