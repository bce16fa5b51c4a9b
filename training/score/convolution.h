// SPDX-License-Identifier: Apache-2.0
// Two-dimensional convolutions and pooling over feature maps: forward only, all cores, no copies of windows.
#pragma once
#include <vector>

namespace tg {

// Channels innermost, with a border of zeros that the next convolution reads.
struct FeatureMap {
  int width = 0;
  int height = 0;
  int channels = 0;
  int border = 0;           // [px] on every side
  std::vector<float> data;  // [height + 2 border, width + 2 border, channels]

  FeatureMap() = default;
  FeatureMap(int w, int h, int c, int b);
  float* at(int x, int y) { return data.data() + offset(x, y); }
  const float* at(int x, int y) const { return data.data() + offset(x, y); }
  std::size_t rowStride() const { return static_cast<std::size_t>(width + 2 * border) * channels; }

 private:
  std::size_t offset(int x, int y) const {
    return static_cast<std::size_t>(y + border) * rowStride() + static_cast<std::size_t>(x + border) * channels;
  }
};

struct ConvolutionShape {
  int inputs = 0;
  int outputs = 0;
  int kernel = 0;  // square
  int stride = 1;
  int padding = 0;
};

class Convolution {
 public:
  // weights: [outputs, inputs, kernel, kernel]; bias: [outputs].
  Convolution(const ConvolutionShape& shape, const std::vector<float>& weights, std::vector<float> bias);
  const ConvolutionShape& shape() const { return shape_; }

  // max(0, conv(input) + bias). The input's border must be the padding; it must hold one window at least.
  FeatureMap operator()(const FeatureMap& input, int output_border) const;

 private:
  ConvolutionShape shape_;
  std::vector<float> weights_;  // [outputs / kBlock, kernel, kernel, inputs, kBlock], zeros beyond the last output
  std::vector<float> bias_;     // as many, rounded up to a block
};

// Maximum over kernel x kernel windows; those that reach beyond the map are left out.
FeatureMap maxPool(const FeatureMap& input, int kernel, int stride, int output_border);

}  // namespace tg
