// SPDX-License-Identifier: Apache-2.0
// PSNR and SSIM. Rows are summed separately and added in order: the same number for any thread count.
#include "core/image/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr int kRadius = 5;
constexpr int kTaps = 2 * kRadius + 1;  // 11 x 11 window
using Window = std::array<double, kTaps>;
constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;

void checkSameSize(const Image& a, const Image& b) {
  const auto size = [](const Image& i) {
    return std::to_string(i.width) + " x " + std::to_string(i.height) + " x " + std::to_string(i.channels);
  };
  if (a.width != b.width || a.height != b.height || a.channels != b.channels) {
    throw Error(ErrorKind::badData, "images of different sizes (expected " + size(a) + ", found " + size(b) + ")");
  }
  if (a.data.empty()) throw Error(ErrorKind::badData, "images without pixels (expected at least one)");
}

// How many pixels count.
std::size_t countPixels(const Image& image, Mask mask) {
  const std::size_t pixels = static_cast<std::size_t>(image.width) * image.height;
  if (mask.empty()) return pixels;
  if (mask.size() != pixels) {
    throw Error(ErrorKind::badData, "mask of another size than the image (expected " + std::to_string(pixels) +
                                        " pixels, found " + std::to_string(mask.size()) + ")");
  }
  const std::size_t counted = pixels - static_cast<std::size_t>(std::count(mask.begin(), mask.end(), 0));
  if (counted == 0) throw Error(ErrorKind::badData, "the mask hides every pixel");
  return counted;
}

double sum(const std::vector<double>& values) {
  double total = 0.0;
  for (double v : values) total += v;
  return total;
}

// `quantize` maps a value in [0, 1] to what is compared.
template <typename Quantize>
double psnrOf(const Image& a, const Image& b, Mask mask, Quantize quantize) {
  TG_ASSERT(hasImageShape(a) && hasImageShape(b), "the images' data has their size");
  checkSameSize(a, b);
  const std::size_t counted = countPixels(a, mask);
  const std::size_t row = static_cast<std::size_t>(a.width) * a.channels;
  std::vector<double> row_sums(static_cast<std::size_t>(a.height));
  parallelFor(a.height, 16, [&](std::int64_t y) {
    const float* pa = a.data.data() + static_cast<std::size_t>(y) * row;
    const float* pb = b.data.data() + static_cast<std::size_t>(y) * row;
    double total = 0.0;
    for (std::size_t i = 0; i < row; ++i) {
      if (!mask.empty() && mask[(static_cast<std::size_t>(y) * row + i) / a.channels] == 0) continue;
      const double d = quantize(std::clamp(pa[i], 0.0f, 1.0f)) - quantize(std::clamp(pb[i], 0.0f, 1.0f));
      total += d * d;
    }
    row_sums[static_cast<std::size_t>(y)] = total;
  });
  const double mse = sum(row_sums) / static_cast<double>(counted * a.channels);
  return mse == 0.0 ? std::numeric_limits<double>::infinity() : -10.0 * std::log10(mse);
}

Window gaussianWindow() {
  Window window{};
  double total = 0.0;
  for (int i = -kRadius; i <= kRadius; ++i) {
    window[static_cast<std::size_t>(i + kRadius)] = std::exp(-i * i / (2.0 * 1.5 * 1.5));
    total += window[static_cast<std::size_t>(i + kRadius)];
  }
  for (double& w : window) w /= total;
  return window;
}

// out[x] = sum of window[k] * in[k][x]. The window is symmetric, and `out` is none of `in`.
void blend(double* __restrict out, const std::array<const double*, kTaps>& in, const Window& window, int width) {
  for (int x = 0; x < width; ++x) {
    double sum = window[kRadius] * in[kRadius][x];
    for (std::size_t k = 0; k < kRadius; ++k) sum += window[k] * (in[k][x] + in[kTaps - 1 - k][x]);
    out[x] = sum;
  }
}

// SSIM summed over the rows [y0, y1) of one channel. The five moments are blurred along x once per row, into planes
// that reach kRadius rows beyond the band, then along y.
class SsimBand {
 public:
  SsimBand(const Image& a, const Image& b, Mask mask) : a_(a), b_(b), mask_(mask), window_(gaussianWindow()) {}

  void sumRows(int channel, int y0, int y1, std::vector<double>& row_sums) const {
    const int width = a_.width;
    const std::size_t row = static_cast<std::size_t>(width);
    const int first = std::max(0, y0 - kRadius);
    const int last = std::min(a_.height, y1 + kRadius);
    const std::vector<double> zeros(row, 0.0);  // the rows beyond the image
    std::vector<double> blurred(static_cast<std::size_t>(last - first) * 5 * row);
    std::vector<double> moments[5];  // of one row, with the zero padding along x
    for (auto& m : moments) m.assign(row + 2 * kRadius, 0.0);
    std::array<const double*, kTaps> taps;
    for (int y = first; y < last; ++y) {
      computeMoments(channel, y, moments);
      double* out = blurred.data() + static_cast<std::size_t>(y - first) * 5 * row;
      for (int m = 0; m < 5; ++m, out += width) {
        for (std::size_t k = 0; k < kTaps; ++k) taps[k] = moments[m].data() + k;
        blend(out, taps, window_, width);
      }
    }
    std::vector<double> columns(5 * row);
    for (int y = y0; y < y1; ++y) {
      for (std::size_t m = 0; m < 5; ++m) {
        for (int k = 0; k < kTaps; ++k) {
          const int v = y + k - kRadius;
          const bool inside = v >= first && v < last;
          taps[static_cast<std::size_t>(k)] =
              inside ? blurred.data() + (static_cast<std::size_t>(v - first) * 5 + m) * row : zeros.data();
        }
        blend(columns.data() + m * row, taps, window_, width);
      }
      row_sums[static_cast<std::size_t>(channel) * a_.height + static_cast<std::size_t>(y)] =
          sumSsim(columns.data(), width, y);
    }
  }

 private:
  void computeMoments(int channel, int y, std::vector<double> (&moments)[5]) const {
    const std::size_t channels = static_cast<std::size_t>(a_.channels);
    const std::size_t begin = static_cast<std::size_t>(y) * a_.width * channels + static_cast<std::size_t>(channel);
    for (std::size_t x = 0; x < static_cast<std::size_t>(a_.width); ++x) {
      const double p = counts(static_cast<int>(x), y) ? a_.data[begin + x * channels] : 0.0;
      const double q = counts(static_cast<int>(x), y) ? b_.data[begin + x * channels] : 0.0;
      moments[0][x + kRadius] = p;
      moments[1][x + kRadius] = q;
      moments[2][x + kRadius] = p * p;
      moments[3][x + kRadius] = q * q;
      moments[4][x + kRadius] = p * q;
    }
  }

  bool counts(int x, int y) const { return mask_.empty() || mask_[static_cast<std::size_t>(y) * a_.width + x] != 0; }

  double sumSsim(const double* columns, int width, int y) const {
    double total = 0.0;
    for (int x = 0; x < width; ++x) {
      if (!counts(x, y)) continue;
      const double* c = columns + x;
      const double mean_a = c[0];
      const double mean_b = c[width];
      const double var_a = c[2 * width] - mean_a * mean_a;
      const double var_b = c[3 * width] - mean_b * mean_b;
      const double covariance = c[4 * width] - mean_a * mean_b;
      total += (2.0 * mean_a * mean_b + kC1) * (2.0 * covariance + kC2) /
               ((mean_a * mean_a + mean_b * mean_b + kC1) * (var_a + var_b + kC2));
    }
    return total;
  }

  const Image& a_;
  const Image& b_;
  const Mask mask_;
  const Window window_;
};

}  // namespace

double psnr(const Image& a, const Image& b, Mask mask) {
  return psnrOf(a, b, mask, [](float v) { return static_cast<double>(v); });
}

double psnr8Bit(const Image& a, const Image& b, Mask mask) {
  return psnrOf(a, b, mask, [](float v) { return std::floor(v * 255.0f + 0.5f) / 255.0; });
}

double ssim(const Image& a, const Image& b, Mask mask) {
  TG_ASSERT(hasImageShape(a) && hasImageShape(b), "the images' data has their size");
  checkSameSize(a, b);
  const std::size_t counted = countPixels(a, mask);
  constexpr int band_rows = 32;
  const int bands = (a.height + band_rows - 1) / band_rows;
  const SsimBand band(a, b, mask);
  std::vector<double> row_sums(static_cast<std::size_t>(a.channels) * a.height);
  parallelFor(std::int64_t{bands} * a.channels, 1, [&](std::int64_t item) {
    const int y0 = static_cast<int>(item % bands) * band_rows;
    band.sumRows(static_cast<int>(item / bands), y0, std::min(y0 + band_rows, a.height), row_sums);
  });
  return sum(row_sums) / static_cast<double>(counted * a.channels);
}

}  // namespace tg
