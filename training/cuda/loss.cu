// SPDX-License-Identifier: Apache-2.0
// A block a 16 x 16 window of one channel: the 11 x 11 blur is 11 taps along rows, then 11 across, in shared memory.
// What lies beyond the border or under the mask is 0.
#include "training/cuda/device.h"
#include "training/cuda/step.h"

namespace tg::cuda {
namespace {

constexpr int kSide = 16;
constexpr int kPatch = kSide + 2 * kSsimRadius;
static_assert(kSide * kSide == static_cast<int>(kThreads));

struct LossArguments {
  LossInput in;
  SsimWindow window;
  int windows_x;
  std::size_t windows;  // of a channel
  float* derivatives;
  double* block_sums;
  float* v_picture;
};

// The block's channel and the pixel at its top left.
struct Window {
  int channel, x, y;
};
TG_DEVICE Window windowOf(const LossArguments& a) {
  const int window = static_cast<int>(blockIdx.x % a.windows);
  return {static_cast<int>(blockIdx.x / a.windows), window % a.windows_x * kSide, window / a.windows_x * kSide};
}

// Whether a pixel counts, and its index.
TG_DEVICE bool counts(const LossInput& in, int x, int y, std::size_t& index) {
  if (x < 0 || y < 0 || x >= in.width || y >= in.height) return false;
  index = static_cast<std::size_t>(y) * in.width + x;
  return in.mask == nullptr || in.mask[index] != 0;
}

TG_DEVICE float targetAt(const LossInput& in, std::size_t index, int channel) {
  return static_cast<float>(in.target[3 * index + channel]) / 255.0f;
}

template <int kQuantities>
struct BlurShared {
  float patch[kQuantities][kPatch][kPatch];
  float rows[kQuantities][kPatch][kSide];
};

// patch to rows, on all threads; a barrier on either side.
template <int kQuantities>
TG_DEVICE void blurAlongRows(const float (*patch)[kPatch][kPatch], float (*rows)[kPatch][kSide],
                             const SsimWindow& window) {
  for (int item = static_cast<int>(threadIdx.x); item < kPatch * kSide; item += static_cast<int>(kThreads)) {
    const int y = item / kSide, x = item % kSide;
    for (int q = 0; q < kQuantities; ++q) {
      float sum = 0.0f;
      for (int k = 0; k < kSsimTaps; ++k) sum += window.weights[k] * patch[q][y][x + k];
      rows[q][y][x] = sum;
    }
  }
}
TG_DEVICE float blurAcross(const float (*rows)[kSide], const SsimWindow& window, int x, int y) {
  float sum = 0.0f;
  for (int k = 0; k < kSsimTaps; ++k) sum += window.weights[k] * rows[y + k][x];
  return sum;
}

struct ForwardShared {
  float pictures[2][kPatch][kPatch];
  float rows[5][kPatch][kSide];  // blurred x, y, xx, yy, xy
  double scratch[kThreads / kWarp];
};

TG_KERNEL lossForwardKernel(LossArguments a) {
  TG_BLOCK_SHARED(ForwardShared, shared);
  const Window window = windowOf(a);
  for (int item = static_cast<int>(threadIdx.x); item < kPatch * kPatch; item += static_cast<int>(kThreads)) {
    std::size_t index = 0;
    const bool inside =
        counts(a.in, window.x + item % kPatch - kSsimRadius, window.y + item / kPatch - kSsimRadius, index);
    shared.pictures[0][item / kPatch][item % kPatch] = inside ? a.in.picture[3 * index + window.channel] : 0.0f;
    shared.pictures[1][item / kPatch][item % kPatch] = inside ? targetAt(a.in, index, window.channel) : 0.0f;
  }
  __syncthreads();
  for (int item = static_cast<int>(threadIdx.x); item < kPatch * kSide; item += static_cast<int>(kThreads)) {
    const int y = item / kSide, x = item % kSide;
    float sums[5] = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    for (int k = 0; k < kSsimTaps; ++k) {
      const float weight = a.window.weights[k];
      const float p = shared.pictures[0][y][x + k], t = shared.pictures[1][y][x + k];
      sums[0] += weight * p;
      sums[1] += weight * t;
      sums[2] += weight * (p * p);
      sums[3] += weight * (t * t);
      sums[4] += weight * (p * t);
    }
    for (int q = 0; q < 5; ++q) shared.rows[q][y][x] = sums[q];
  }
  __syncthreads();

  const int x = static_cast<int>(threadIdx.x) % kSide, y = static_cast<int>(threadIdx.x) / kSide;
  std::size_t index = 0;
  const bool counted = counts(a.in, window.x + x, window.y + y, index);
  double l1 = 0, ssim = 0, squared = 0;
  if (window.x + x < a.in.width && window.y + y < a.in.height) {
    index = static_cast<std::size_t>(window.y + y) * a.in.width + window.x + x;
    SsimPixel pixel = {0.0f, 0.0f, 0.0f, 0.0f};
    if (counted) {
      float blurred[5];
      for (int q = 0; q < 5; ++q) blurred[q] = blurAcross(shared.rows[q], a.window, x, y);
      pixel = ssimPixel(blurred[0], blurred[1], blurred[2], blurred[3], blurred[4]);
      const float p = shared.pictures[0][y + kSsimRadius][x + kSsimRadius];
      const float t = shared.pictures[1][y + kSsimRadius][x + kSsimRadius];
      const double clamped = static_cast<double>(clamp(p, 0.0f, 1.0f) - t);
      l1 = ::fabsf(p - t);
      ssim = pixel.value;
      squared = clamped * clamped;
    }
    const std::size_t pixels = static_cast<std::size_t>(a.in.width) * a.in.height;
    float* derivatives = a.derivatives + window.channel * pixels + index;
    derivatives[0] = pixel.v_mean;
    derivatives[3 * pixels] = pixel.v_variance;
    derivatives[6 * pixels] = pixel.v_covariance;
  }
  const double sums[3] = {blockSum(l1, shared.scratch), blockSum(ssim, shared.scratch),
                          blockSum(squared, shared.scratch)};
  if (threadIdx.x != 0) return;
  for (int k = 0; k < 3; ++k) a.block_sums[3 * static_cast<std::size_t>(blockIdx.x) + k] = sums[k];
}

struct SumShared {
  double scratch[kThreads / kWarp];
};
TG_KERNEL sumKernel(const double* block_sums, std::size_t blocks, double* sums) {
  TG_BLOCK_SHARED(SumShared, shared);
  for (int k = 0; k < 3; ++k) {
    double sum = 0;
    for (std::size_t block = threadIdx.x; block < blocks; block += kThreads) sum += block_sums[3 * block + k];
    sum = blockSum(sum, shared.scratch);
    if (threadIdx.x == 0) sums[k] = sum;
  }
}

TG_KERNEL lossBackwardKernel(LossArguments a) {
  TG_BLOCK_SHARED(BlurShared<3>, shared);
  const Window window = windowOf(a);
  const std::size_t pixels = static_cast<std::size_t>(a.in.width) * a.in.height;
  for (int item = static_cast<int>(threadIdx.x); item < kPatch * kPatch; item += static_cast<int>(kThreads)) {
    std::size_t index = 0;
    const bool inside =
        counts(a.in, window.x + item % kPatch - kSsimRadius, window.y + item / kPatch - kSsimRadius, index);
    for (int q = 0; q < 3; ++q) {
      shared.patch[q][item / kPatch][item % kPatch] =
          inside ? a.derivatives[(3 * q + window.channel) * pixels + index] : 0.0f;
    }
  }
  __syncthreads();
  blurAlongRows<3>(shared.patch, shared.rows, a.window);
  __syncthreads();
  const int x = static_cast<int>(threadIdx.x) % kSide, y = static_cast<int>(threadIdx.x) / kSide;
  if (window.x + x >= a.in.width || window.y + y >= a.in.height) return;
  std::size_t index = static_cast<std::size_t>(window.y + y) * a.in.width + window.x + x;
  float v = 0.0f;
  if (counts(a.in, window.x + x, window.y + y, index)) {
    const auto count = static_cast<float>(a.in.counted);
    v = lossGradientOf(a.in.picture[3 * index + window.channel], targetAt(a.in, index, window.channel),
                       blurAcross(shared.rows[0], a.window, x, y), blurAcross(shared.rows[1], a.window, x, y),
                       blurAcross(shared.rows[2], a.window, x, y), (1 - a.in.ssim_weight) / count,
                       a.in.ssim_weight / count);
  }
  a.v_picture[3 * index + window.channel] = v;
}

}  // namespace

void evaluateLoss(const LossInput& input, LossBuffers& buffers, float* v_picture) {
  const auto windows = [](int pixels) { return (pixels + kSide - 1) / kSide; };
  const std::size_t per_channel = static_cast<std::size_t>(windows(input.width)) * windows(input.height);
  buffers.derivatives.resize(9 * static_cast<std::size_t>(input.width) * input.height);
  buffers.block_sums.resize(9 * per_channel);
  buffers.sums.resize(3);
  const LossArguments arguments{input,       makeSsimWindow(),           windows(input.width),
                                per_channel, buffers.derivatives.data(), buffers.block_sums.data(),
                                v_picture};
  launch("loss", lossForwardKernel, 3 * per_channel, arguments);
  launch("loss sums", sumKernel, 1, buffers.block_sums.data(), 3 * per_channel, buffers.sums.data());
  launch("loss backward", lossBackwardKernel, 3 * per_channel, arguments);
}

}  // namespace tg::cuda
