// SPDX-License-Identifier: Apache-2.0
// Bands of rows run in parallel; inside a band the 11 x 11 window is two 11-tap passes over rows.
#include "training/step/loss.h"

#include <algorithm>
#include <cmath>

#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "training/step/simd.h"
#include "training/step/step_math.h"

namespace tg {
namespace {

constexpr int kRadius = kSsimRadius;
constexpr int kTaps = kSsimTaps;
constexpr int kBand = 32;     // rows a task: the halo of 10 rows costs 31 % of one of two passes
constexpr int kForward = 5;   // blurred quantities: x, y, xx, yy, xy
constexpr int kBackward = 3;  // dSSIM / d(mean, variance, covariance)

// padded: [width + 10], the row with 5 zeros on either side.
TG_SIMD_CLONES void blurAlongRow(const float* __restrict padded, const float* __restrict w, int width,
                                 float* __restrict out) {
  for (int x = 0; x < width; ++x) {
    float sum = 0;
    for (int k = 0; k < kTaps; ++k) sum += w[k] * padded[x + k];
    out[x] = sum;
  }
}

TG_SIMD_CLONES void blurAcrossRows(const float* const* rows, const float* __restrict w, int width,
                                   float* __restrict out) {
  const float *r0 = rows[0], *r1 = rows[1], *r2 = rows[2], *r3 = rows[3], *r4 = rows[4], *r5 = rows[5], *r6 = rows[6],
              *r7 = rows[7], *r8 = rows[8], *r9 = rows[9], *r10 = rows[10];
  for (int x = 0; x < width; ++x) {
    out[x] = w[0] * (r0[x] + r10[x]) + w[1] * (r1[x] + r9[x]) + w[2] * (r2[x] + r8[x]) + w[3] * (r3[x] + r7[x]) +
             w[4] * (r4[x] + r6[x]) + w[5] * r5[x];
  }
}

TG_SIMD_CLONES void multiplyRows(const float* __restrict a, const float* __restrict b, int width,
                                 float* __restrict out) {
  for (int x = 0; x < width; ++x) out[x] = a[x] * b[x];
}

// SSIM of one row of windows and its derivatives with respect to the moments of the picture.
TG_SIMD_CLONES void ssimRow(const float* __restrict m1, const float* __restrict m2, const float* __restrict e11,
                            const float* __restrict e22, const float* __restrict e12, int width, float* __restrict ssim,
                            float* __restrict v_mean, float* __restrict v_variance, float* __restrict v_covariance) {
  for (int x = 0; x < width; ++x) {
    const SsimPixel pixel = ssimPixel(m1[x], m2[x], e11[x], e22[x], e12[x]);
    ssim[x] = pixel.value;
    v_mean[x] = pixel.v_mean;
    v_variance[x] = pixel.v_variance;
    v_covariance[x] = pixel.v_covariance;
  }
}

TG_SIMD_CLONES void gradientRow(const float* __restrict picture, const float* __restrict target,
                                const float* __restrict g_mean, const float* __restrict g_variance,
                                const float* __restrict g_covariance, int width, float l1_weight, float ssim_weight,
                                float* __restrict out) {
  for (int x = 0; x < width; ++x) {
    out[x] = lossGradientOf(picture[x], target[x], g_mean[x], g_variance[x], g_covariance[x], l1_weight, ssim_weight);
  }
}

// Rows of several quantities, blurred along x, the last kTaps of them kept: enough to blur across rows.
class BlurBand {
 public:
  // scratch must hold size(quantities, width) floats.
  static std::size_t size(int quantities, int width) {
    return static_cast<std::size_t>(width + 2 * kRadius) + static_cast<std::size_t>(quantities) * kTaps * width + width;
  }
  BlurBand(float* scratch, int quantities, int width, const SsimWindow& window)
      : padded_(scratch),
        rows_(scratch + width + 2 * kRadius),
        zeros_(rows_ + static_cast<std::size_t>(quantities) * kTaps * width),
        width_(width),
        window_(window) {
    std::fill(padded_, padded_ + width + 2 * kRadius, 0.0f);
    std::fill(zeros_, zeros_ + width, 0.0f);
  }
  float* input() { return padded_ + kRadius; }  // fill [width], then push
  void push(int quantity, int y) { blurAlongRow(padded_, window_.weights, width_, row(quantity, y)); }
  // The blurred row y; rows outside [0, height) are zero.
  void pull(int quantity, int y, int height, float* out) const {
    const float* rows[kTaps];
    for (int k = 0; k < kTaps; ++k) {
      const int source = y + k - kRadius;
      rows[k] = source < 0 || source >= height ? zeros_ : row(quantity, source);
    }
    blurAcrossRows(rows, window_.weights, width_, out);
  }

 private:
  float* row(int quantity, int y) const {
    return rows_ + (static_cast<std::size_t>(quantity) * kTaps + y % kTaps) * width_;
  }
  float* padded_;
  float* rows_;
  float* zeros_;
  int width_;
  const SsimWindow& window_;
};

double countedValues(int width, int height, std::size_t ignored) {
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  return static_cast<double>(3 * std::max<std::size_t>(pixels - ignored, 1));
}

}  // namespace

SsimWindow makeSsimWindow() {
  constexpr double kSigma = 1.5;
  double weights[kTaps];
  double sum = 0;
  for (int i = 0; i < kTaps; ++i) {
    weights[i] = std::exp(-(i - kRadius) * (i - kRadius) / (2 * kSigma * kSigma));
    sum += weights[i];
  }
  SsimWindow window;
  for (int i = 0; i < kTaps; ++i) window.weights[i] = static_cast<float>(weights[i] / sum);
  return window;
}

LossRows lossSurroundings(LossRows rows, int height) {
  if (rows.first >= rows.end) return {rows.first, rows.first};
  return {std::max(rows.first - 2 * kRadius, 0), std::min(rows.end + 2 * kRadius, height)};
}

LossValue PhotometricLoss::evaluate(int width, int height, std::span<const glm::vec3> picture,
                                    std::span<const std::uint8_t> target, std::span<glm::vec3> v_picture,
                                    std::span<const std::uint8_t> mask) {
  TG_ASSERT(width > 0 && height > 0, "a picture has pixels");
  TG_ASSERT(picture.size() == static_cast<std::size_t>(width) * static_cast<std::size_t>(height), "a colour a pixel");
  const std::size_t ignored = static_cast<std::size_t>(std::count(mask.begin(), mask.end(), 0));
  row_sums_.assign(3 * static_cast<std::size_t>(height), {});
  evaluateRows(width, height, {0, height}, ignored, picture, target, v_picture, mask, row_sums_);
  return total(width, height, ignored, row_sums_);
}

void PhotometricLoss::evaluateRows(int width, int height, LossRows rows, std::size_t ignored,
                                   std::span<const glm::vec3> picture, std::span<const std::uint8_t> target,
                                   std::span<glm::vec3> v_picture, std::span<const std::uint8_t> mask,
                                   std::span<LossRowSums> row_sums) {
  TG_ASSERT(width > 0 && rows.first >= 0 && rows.first <= rows.end && rows.end <= height, "a picture has these rows");
  const LossRows given = lossSurroundings(rows, height);
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(given.end - given.first);
  const auto own = static_cast<std::size_t>(rows.end - rows.first);
  TG_ASSERT(picture.size() == pixels, "a colour a pixel");
  TG_ASSERT(target.size() == 3 * pixels && v_picture.size() == own * static_cast<std::size_t>(width),
            "target and gradient have the picture's size");
  TG_ASSERT(mask.empty() || mask.size() == pixels, "a mask has the picture's size");
  TG_ASSERT(row_sums.size() == 3 * own, "sums a row and channel");
  if (own == 0) return;
  if (ignored == 0) mask = {};
  // Rows with a window whose pixels' gradients are wanted.
  const LossRows windows{std::max(rows.first - kRadius, 0), std::min(rows.end + kRadius, height)};
  const std::size_t window_pixels =
      static_cast<std::size_t>(width) * static_cast<std::size_t>(windows.end - windows.first);
  const auto isOwn = [&](int y) { return y >= rows.first && y < rows.end; };
  const SsimWindow window = makeSsimWindow();
  planes_.resize(2 * pixels);
  v_moments_.resize(3 * window_pixels);
  scratch_.resize(static_cast<std::size_t>(threadCount()));
  const std::size_t scratch_size = BlurBand::size(kForward, width) + static_cast<std::size_t>(kForward + 1) * width;
  const auto pixelAt = [&](int y) { return static_cast<std::size_t>(y - given.first) * width; };
  const auto plane = [&](int set, int y) {
    return planes_.data() + static_cast<std::size_t>(set) * pixels + pixelAt(y);
  };
  const auto moment = [&](int kind, int y) {
    return v_moments_.data() + static_cast<std::size_t>(kind) * window_pixels +
           static_cast<std::size_t>(y - windows.first) * width;
  };
  const auto sumsOf = [&](int c, int y) -> LossRowSums& {
    return row_sums[static_cast<std::size_t>(c) * own + static_cast<std::size_t>(y - rows.first)];
  };
  const float count = static_cast<float>(countedValues(width, height, ignored));
  const auto bandsOf = [](LossRows of) { return (of.end - of.first + kBand - 1) / kBand; };

  // A channel at a time: a third of the memory, which is 20 bytes a pixel.
  for (int c = 0; c < 3; ++c) {
    parallelFor(given.end - given.first, 8, [&](std::int64_t row) {
      const int y = given.first + static_cast<int>(row);
      float* a = plane(0, y);
      float* b = plane(1, y);
      LossRowSums sums;
      for (int x = 0; x < width; ++x) {
        const std::size_t i = pixelAt(y) + x;
        a[x] = picture[i][c];
        b[x] = static_cast<float>(target[i * 3 + c]) / 255.0f;
        if (!mask.empty() && mask[i] == 0) a[x] = b[x] = 0;
        const double clamped = std::clamp(a[x], 0.0f, 1.0f) - b[x];
        sums.l1 += std::abs(a[x] - b[x]);
        sums.squared += clamped * clamped;
      }
      if (isOwn(y)) sumsOf(c, y) = sums;
    });

    parallelForWorkers(bandsOf(windows), 1, std::ssize(scratch_), [&](std::int64_t band, int worker) {
      std::vector<float>& scratch = scratch_[static_cast<std::size_t>(worker)];
      scratch.resize(scratch_size);
      float* blurred = scratch.data() + BlurBand::size(kForward, width);  // [kForward + 1, width]
      const int first = windows.first + static_cast<int>(band) * kBand;
      const int last = std::min(first + kBand, windows.end);
      BlurBand blur(scratch.data(), kForward, width, window);
      for (int y = std::max(first - kRadius, 0); y < last + kRadius; ++y) {
        if (y < height) {
          const float* a = plane(0, y);
          const float* b = plane(1, y);
          std::copy(a, a + width, blur.input());
          blur.push(0, y);
          std::copy(b, b + width, blur.input());
          blur.push(1, y);
          multiplyRows(a, a, width, blur.input());
          blur.push(2, y);
          multiplyRows(b, b, width, blur.input());
          blur.push(3, y);
          multiplyRows(a, b, width, blur.input());
          blur.push(4, y);
        }
        const int done = y - kRadius;
        if (done < first) continue;
        for (int q = 0; q < kForward; ++q) blur.pull(q, done, height, blurred + static_cast<std::size_t>(q) * width);
        const auto value = [&](int q) { return blurred + static_cast<std::size_t>(q) * width; };
        float* ssim = value(kForward);
        ssimRow(value(0), value(1), value(2), value(3), value(4), width, ssim, moment(0, done), moment(1, done),
                moment(2, done));
        for (int x = 0; x < width && !mask.empty(); ++x) {
          if (mask[pixelAt(done) + x] != 0) continue;
          ssim[x] = moment(0, done)[x] = moment(1, done)[x] = moment(2, done)[x] = 0;
        }
        if (!isOwn(done)) continue;
        LossRowSums& sums = sumsOf(c, done);
        for (int x = 0; x < width; ++x) sums.ssim += ssim[x];
      }
    });

    parallelForWorkers(bandsOf(rows), 1, std::ssize(scratch_), [&](std::int64_t band, int worker) {
      std::vector<float>& scratch = scratch_[static_cast<std::size_t>(worker)];
      scratch.resize(scratch_size);
      float* blurred = scratch.data() + BlurBand::size(kForward, width);  // [kBackward + 1, width]
      const int first = rows.first + static_cast<int>(band) * kBand;
      const int last = std::min(first + kBand, rows.end);
      BlurBand blur(scratch.data(), kBackward, width, window);
      for (int y = std::max(first - kRadius, 0); y < last + kRadius; ++y) {
        if (y < height) {
          for (int q = 0; q < kBackward; ++q) {
            const float* source = moment(q, y);
            std::copy(source, source + width, blur.input());
            blur.push(q, y);
          }
        }
        const int done = y - kRadius;
        if (done < first) continue;
        const auto value = [&](int q) { return blurred + static_cast<std::size_t>(q) * width; };
        for (int q = 0; q < kBackward; ++q) blur.pull(q, done, height, value(q));
        gradientRow(plane(0, done), plane(1, done), value(0), value(1), value(2), width, (1 - ssim_weight_) / count,
                    ssim_weight_ / count, value(kBackward));
        for (int x = 0; x < width; ++x) {
          const bool counts = mask.empty() || mask[pixelAt(done) + x] != 0;
          v_picture[static_cast<std::size_t>(done - rows.first) * width + x][c] = counts ? value(kBackward)[x] : 0.0f;
        }
      }
    });
  }
}

LossValue lossOf(const LossRowSums& sums, double counted, float ssim_weight) {
  LossValue loss;
  loss.l1 = sums.l1 / counted;
  loss.ssim = sums.ssim / counted;
  loss.mean_squared_error = sums.squared / counted;
  loss.total = (1 - ssim_weight) * loss.l1 + ssim_weight * (1 - loss.ssim);
  return loss;
}

LossValue PhotometricLoss::total(int width, int height, std::size_t ignored,
                                 std::span<const LossRowSums> row_sums) const {
  TG_ASSERT(row_sums.size() == 3 * static_cast<std::size_t>(height), "sums of every row");
  const double counted = countedValues(width, height, ignored);
  LossRowSums sums;
  for (const LossRowSums& row : row_sums) {
    sums.l1 += row.l1;
    sums.ssim += row.ssim;
    sums.squared += row.squared;
  }
  return lossOf(sums, counted, ssim_weight_);
}

}  // namespace tg
