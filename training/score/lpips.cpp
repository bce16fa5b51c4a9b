// SPDX-License-Identifier: Apache-2.0
// Both pictures walk through the network side by side, one slice at a time, so that only the maps in use are held: at
// VGG16's first slice three of 64 channels, 768 bytes a pixel.
#include "training/score/lpips.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "training/score/convolution.h"

namespace tg {
namespace {

constexpr int kMaxChannels = 4096;
constexpr double kNormEpsilon = 1e-10;
// The scaling layer of the published networks: ImageNet's mean and deviation, moved to [-1, 1].
constexpr std::array<float, 3> kShift = {-0.030f, -0.088f, -0.188f};
constexpr std::array<float, 3> kScale = {0.458f, 0.448f, 0.450f};

struct ConvolutionPlace {
  int slice;  // 0 to 4
  int index;  // in the network's list of layers, which names the tensor
  int kernel, stride, padding;
  int pool;  // side of the maximum pooling (stride 2) in front; 0: none
};

constexpr std::array<ConvolutionPlace, 13> kVgg16 = {{{0, 0, 3, 1, 1, 0},
                                                      {0, 2, 3, 1, 1, 0},
                                                      {1, 5, 3, 1, 1, 2},
                                                      {1, 7, 3, 1, 1, 0},
                                                      {2, 10, 3, 1, 1, 2},
                                                      {2, 12, 3, 1, 1, 0},
                                                      {2, 14, 3, 1, 1, 0},
                                                      {3, 17, 3, 1, 1, 2},
                                                      {3, 19, 3, 1, 1, 0},
                                                      {3, 21, 3, 1, 1, 0},
                                                      {4, 24, 3, 1, 1, 2},
                                                      {4, 26, 3, 1, 1, 0},
                                                      {4, 28, 3, 1, 1, 0}}};
constexpr std::array<ConvolutionPlace, 5> kAlexNet = {
    {{0, 0, 11, 4, 2, 0}, {1, 3, 5, 1, 2, 3}, {2, 6, 3, 1, 1, 3}, {3, 8, 3, 1, 1, 0}, {4, 10, 3, 1, 1, 0}}};
constexpr int kSlices = 5;

std::string shapeText(const std::vector<std::int64_t>& shape) {
  std::string text = "[";
  for (std::size_t i = 0; i < shape.size(); ++i) text += (i ? ", " : "") + std::to_string(shape[i]);
  return text + "]";
}

Tensor tensorOfShape(const Safetensors& file, const std::string& name, const std::vector<std::int64_t>& shape) {
  if (file.shape(name) != shape) {
    throw Error(ErrorKind::badData, file.path(),
                "tensor '" + name + "' has another shape (expected " + shapeText(shape) + ", found " +
                    shapeText(file.shape(name)) + ")");
  }
  return file.tensor(name);
}

// Weights and bias of a convolution; the number of outputs is what the file says.
Convolution readConvolution(const Safetensors& file, const ConvolutionPlace& place, int inputs) {
  const std::string name = "net.slice" + std::to_string(place.slice + 1) + "." + std::to_string(place.index);
  const std::vector<std::int64_t>& shape = file.shape(name + ".weight");
  const std::int64_t outputs = shape.empty() ? 0 : shape[0];
  if (outputs < 1 || outputs > kMaxChannels) {
    throw Error(ErrorKind::badData, file.path(),
                "tensor '" + name + ".weight' has another shape (expected 1 to " + std::to_string(kMaxChannels) +
                    " outputs, found " + shapeText(shape) + ")");
  }
  Tensor weights = tensorOfShape(file, name + ".weight", {outputs, inputs, place.kernel, place.kernel});
  Tensor bias = tensorOfShape(file, name + ".bias", {outputs});
  return Convolution({inputs, static_cast<int>(outputs), place.kernel, place.stride, place.padding}, weights.values,
                     std::move(bias.values));
}

FeatureMap networkInput(const Image& image, LpipsRange range, int border) {
  FeatureMap map(image.width, image.height, 3, border);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const float value = std::clamp(image.at(x, y, c), 0.0f, 1.0f);
        map.at(x, y)[c] = ((range == LpipsRange::symmetric ? 2 * value - 1 : value) - kShift[c]) / kScale[c];
      }
    }
  }
  return map;
}

double norm(const float* values, int count) {
  double sum = 0;
  for (int i = 0; i < count; ++i) sum += static_cast<double>(values[i]) * values[i];
  return std::sqrt(sum) + kNormEpsilon;
}

// Mean over the map of the weighted squared differences of features scaled to unit length.
double sliceDistance(const FeatureMap& a, const FeatureMap& b, const std::vector<float>& weights) {
  std::vector<double> rows(static_cast<std::size_t>(a.height));
  parallelFor(a.height, 4, [&](std::int64_t item) {
    const int y = static_cast<int>(item);
    double total = 0;
    for (int x = 0; x < a.width; ++x) {
      const float* p = a.at(x, y);
      const float* q = b.at(x, y);
      const double p_norm = norm(p, a.channels);
      const double q_norm = norm(q, a.channels);
      for (int c = 0; c < a.channels; ++c) {
        const double difference = p[c] / p_norm - q[c] / q_norm;
        total += weights[static_cast<std::size_t>(c)] * difference * difference;
      }
    }
    rows[static_cast<std::size_t>(item)] = total;
  });
  double total = 0;
  for (double row : rows) total += row;
  return total / (static_cast<double>(a.width) * a.height);
}

}  // namespace

struct Lpips::Layers {
  LpipsNetwork network = LpipsNetwork::vgg16;
  std::vector<ConvolutionPlace> places;
  std::vector<Convolution> convolutions;
  std::array<std::vector<float>, kSlices> linear;  // [channels of the slice]
  std::string path;
};

Lpips::Lpips(const Safetensors& weights) : layers_(std::make_unique<Layers>()) {
  Layers& layers = *layers_;
  layers.path = weights.path();
  const std::vector<std::int64_t>& first = weights.shape("net.slice1.0.weight");
  layers.network = first.size() == 4 && first[2] == kAlexNet[0].kernel ? LpipsNetwork::alexNet : LpipsNetwork::vgg16;
  if (layers.network == LpipsNetwork::alexNet) {
    layers.places.assign(kAlexNet.begin(), kAlexNet.end());
  } else {
    layers.places.assign(kVgg16.begin(), kVgg16.end());
  }
  int channels = 3;
  for (std::size_t i = 0; i < layers.places.size(); ++i) {
    layers.convolutions.push_back(readConvolution(weights, layers.places[i], channels));
    channels = layers.convolutions.back().shape().outputs;
    const int slice = layers.places[i].slice;
    if (i + 1 == layers.places.size() || layers.places[i + 1].slice != slice) {
      layers.linear[slice] =
          tensorOfShape(weights, "lin" + std::to_string(slice) + ".model.1.weight", {1, channels, 1, 1}).values;
    }
  }
}

Lpips::~Lpips() = default;
Lpips::Lpips(Lpips&&) noexcept = default;

LpipsNetwork Lpips::network() const { return layers_->network; }

double Lpips::distance(const Image& reference, const Image& picture, LpipsRange range) const {
  TG_ASSERT(layers_, "the network was not moved away");
  if (reference.width != picture.width || reference.height != picture.height || reference.channels != 3 ||
      picture.channels != 3) {
    throw Error(ErrorKind::badData, "LPIPS compares two pictures of one size with 3 channels");
  }
  const std::vector<ConvolutionPlace>& places = layers_->places;
  std::array<FeatureMap, 2> maps = {networkInput(reference, range, places[0].padding),
                                    networkInput(picture, range, places[0].padding)};
  double total = 0;
  for (std::size_t i = 0; i < places.size();) {
    std::size_t end = i;
    while (end < places.size() && places[end].slice == places[i].slice) ++end;
    for (FeatureMap& map : maps) {
      for (std::size_t layer = i; layer < end; ++layer) {
        const ConvolutionPlace& place = places[layer];
        const int smallest = place.pool > 0 ? place.pool : place.kernel - 2 * place.padding;
        if (std::min(map.width, map.height) < smallest) {
          throw Error(ErrorKind::badData, "picture too small for LPIPS (" + std::to_string(reference.width) + " x " +
                                              std::to_string(reference.height) + ")");
        }
        if (place.pool > 0) map = maxPool(map, place.pool, 2, place.padding);
        // What follows the pooling of the next slice needs no border.
        const bool next_pools = layer + 1 == places.size() || places[layer + 1].pool > 0;
        map = layers_->convolutions[layer](map, next_pools ? 0 : places[layer + 1].padding);
      }
    }
    total += sliceDistance(maps[0], maps[1], layers_->linear[static_cast<std::size_t>(places[i].slice)]);
    i = end;
  }
  return total;
}

}  // namespace tg
