// SPDX-License-Identifier: Apache-2.0
// A task is a row of outputs times a block of channels. Six pixels times two vectors of channels stay in registers: two
// loads of weights and six broadcasts feed twelve multiply-adds.
#include "training/score/convolution.h"

#include <algorithm>
#include <limits>

#include "core/system/assert.h"
#include "core/system/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "training/score/convolution.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#ifndef TG_TRAINING_CONVOLUTION_ARGS
#define TG_TRAINING_CONVOLUTION_ARGS
namespace tg {
constexpr int kBlock = 16;  // output channels of a task

struct ConvolutionRow {
  const float* input;  // the first window's first value
  std::size_t row_stride;
  std::size_t pixel_stride;  // between the windows of neighbouring outputs
  int kernel;
  int run;               // values of a window's row, contiguous: kernel * inputs
  const float* weights;  // [kernel, run, kBlock]
  const float* bias;     // [kBlock]
  float* output;         // [width, output_stride]
  int output_stride;
  int outputs;  // of this block that exist, at most kBlock
  int width;
};
}  // namespace tg
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, kBlock / 2>;

template <int kPixels>
void convolvePixels(const ConvolutionRow& row, int x) {
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  alignas(64) float results[kPixels][kBlock];
  for (std::size_t first = 0; first < kBlock; first += 2 * lanes) {
    const auto bias0 = hn::LoadU(d, row.bias + first);
    const auto bias1 = hn::LoadU(d, row.bias + first + lanes);
    auto a0 = bias0, a1 = bias0, a2 = bias0, a3 = bias0, a4 = bias0, a5 = bias0;
    auto b0 = bias1, b1 = bias1, b2 = bias1, b3 = bias1, b4 = bias1, b5 = bias1;
    const float* weights = row.weights + first;
    for (int ky = 0; ky < row.kernel; ++ky) {
      const float* p[6];
      for (int j = 0; j < 6; ++j) {
        p[j] = row.input + static_cast<std::size_t>(ky) * row.row_stride +
               static_cast<std::size_t>(x + std::min(j, kPixels - 1)) * row.pixel_stride;
      }
      for (int i = 0; i < row.run; ++i, weights += kBlock) {
        const auto w0 = hn::LoadU(d, weights);
        const auto w1 = hn::LoadU(d, weights + lanes);
        const auto step = [&](auto& a, auto& b, const float* pixel) {
          const auto value = hn::Set(d, pixel[i]);
          a = hn::MulAdd(value, w0, a);
          b = hn::MulAdd(value, w1, b);
        };
        step(a0, b0, p[0]);
        if constexpr (kPixels > 1) {
          step(a1, b1, p[1]);
          step(a2, b2, p[2]);
          step(a3, b3, p[3]);
          step(a4, b4, p[4]);
          step(a5, b5, p[5]);
        }
      }
    }
    const auto zero = hn::Zero(d);
    const auto keep = [&](int j, auto a, auto b) {
      hn::StoreU(hn::Max(a, zero), d, results[j] + first);
      hn::StoreU(hn::Max(b, zero), d, results[j] + first + lanes);
    };
    keep(0, a0, b0);
    if constexpr (kPixels > 1) {
      keep(1, a1, b1);
      keep(2, a2, b2);
      keep(3, a3, b3);
      keep(4, a4, b4);
      keep(5, a5, b5);
    }
  }
  for (int j = 0; j < kPixels; ++j) {
    std::copy_n(results[j], row.outputs, row.output + static_cast<std::size_t>(x + j) * row.output_stride);
  }
}

void convolveRow(const ConvolutionRow& row) {
  int x = 0;
  for (; x + 6 <= row.width; x += 6) convolvePixels<6>(row, x);
  for (; x < row.width; ++x) convolvePixels<1>(row, x);
}

}  // namespace tg::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg {
HWY_EXPORT(convolveRow);

FeatureMap::FeatureMap(int w, int h, int c, int b)
    : width(w),
      height(h),
      channels(c),
      border(b),
      data(static_cast<std::size_t>(w + 2 * b) * static_cast<std::size_t>(h + 2 * b) * static_cast<std::size_t>(c)) {
  TG_ASSERT(w >= 0 && h >= 0 && c > 0 && b >= 0, "a map has a size");
}

Convolution::Convolution(const ConvolutionShape& shape, const std::vector<float>& weights, std::vector<float> bias)
    : shape_(shape), bias_(std::move(bias)) {
  const std::size_t blocks = static_cast<std::size_t>((shape.outputs + kBlock - 1) / kBlock);
  const std::size_t taps = static_cast<std::size_t>(shape.kernel) * shape.kernel;
  const std::size_t inputs = static_cast<std::size_t>(shape.inputs);
  bias_.resize(blocks * kBlock);
  weights_.resize(blocks * taps * inputs * kBlock);
  for (std::size_t o = 0; o < static_cast<std::size_t>(shape.outputs); ++o) {
    for (std::size_t i = 0; i < inputs; ++i) {
      for (std::size_t t = 0; t < taps; ++t) {
        weights_[((o / kBlock * taps + t) * inputs + i) * kBlock + o % kBlock] = weights[(o * inputs + i) * taps + t];
      }
    }
  }
}

FeatureMap Convolution::operator()(const FeatureMap& input, int output_border) const {
  TG_ASSERT(input.channels == shape_.inputs, "the input has the layer's channels");
  TG_ASSERT(input.border == shape_.padding, "the input's border is the padding");
  TG_ASSERT(std::min(input.width, input.height) + 2 * input.border >= shape_.kernel,
            "the input holds a window at least");
  const int k = shape_.kernel;
  FeatureMap output((input.width + 2 * shape_.padding - k) / shape_.stride + 1,
                    (input.height + 2 * shape_.padding - k) / shape_.stride + 1, shape_.outputs, output_border);
  const int blocks = static_cast<int>(bias_.size()) / kBlock;
  // Rows of one block follow each other: its weights stay in the cache.
  parallelFor(std::int64_t{blocks} * output.height, 4, [&](std::int64_t item) {
    const int block = static_cast<int>(item / output.height);
    const int y = static_cast<int>(item % output.height);
    ConvolutionRow row;
    row.input = input.at(-shape_.padding, y * shape_.stride - shape_.padding);
    row.row_stride = input.rowStride();
    row.pixel_stride = static_cast<std::size_t>(shape_.stride) * static_cast<std::size_t>(shape_.inputs);
    row.kernel = k;
    row.run = k * shape_.inputs;
    row.weights = weights_.data() + static_cast<std::size_t>(block) * k * static_cast<std::size_t>(row.run) * kBlock;
    row.bias = bias_.data() + static_cast<std::size_t>(block) * kBlock;
    row.output = output.at(0, y) + static_cast<std::size_t>(block) * kBlock;
    row.output_stride = shape_.outputs;
    row.outputs = std::min(kBlock, shape_.outputs - block * kBlock);
    row.width = output.width;
    HWY_DYNAMIC_DISPATCH(convolveRow)(row);
  });
  return output;
}

FeatureMap maxPool(const FeatureMap& input, int kernel, int stride, int output_border) {
  TG_ASSERT(kernel >= 1 && stride >= 1, "windows have a size and a step");
  TG_ASSERT(std::min(input.width, input.height) >= kernel, "the input holds a window at least");
  FeatureMap output((input.width - kernel) / stride + 1, (input.height - kernel) / stride + 1, input.channels,
                    output_border);
  parallelFor(output.height, 4, [&](int y) {
    for (int x = 0; x < output.width; ++x) {
      float* target = output.at(x, y);
      std::fill_n(target, output.channels, -std::numeric_limits<float>::infinity());
      for (int v = 0; v < kernel; ++v) {
        for (int u = 0; u < kernel; ++u) {
          const float* source = input.at(x * stride + u, y * stride + v);
          for (int c = 0; c < output.channels; ++c) target[c] = std::max(target[c], source[c]);
        }
      }
    }
  });
  return output;
}

}  // namespace tg
#endif
