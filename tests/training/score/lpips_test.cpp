// SPDX-License-Identifier: Apache-2.0
// LPIPS with small random weights in the published structure, against plain loops in double written from the paper.
#include "training/score/lpips.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "core/system/parallel.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "core/system/random.h"

using tg::Image;
using tg::LpipsRange;
using tg::test::noise;

namespace {

// One layer of the reference: a convolution with rectifier, or a pooling. `slice` ends after it where `tap` is set.
struct Layer {
  bool pool;
  std::string name;
  int inputs, outputs, kernel, stride, padding;
  bool tap;
};

// The published structures with few channels; 5 and 18 are no multiples of a block.
std::vector<Layer> vgg() {
  std::vector<Layer> layers;
  const int channels[] = {5, 6, 18, 7, 17};
  const int counts[] = {2, 2, 3, 3, 3};
  const int names[] = {0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28};
  int inputs = 3, n = 0;
  for (int slice = 0; slice < 5; ++slice) {
    if (slice > 0) layers.push_back({true, "", inputs, inputs, 2, 2, 0, false});
    for (int i = 0; i < counts[slice]; ++i) {
      layers.push_back({false, "net.slice" + std::to_string(slice + 1) + "." + std::to_string(names[n++]), inputs,
                        channels[slice], 3, 1, 1, i + 1 == counts[slice]});
      inputs = channels[slice];
    }
  }
  return layers;
}
std::vector<Layer> alex() {
  return {{false, "net.slice1.0", 3, 6, 11, 4, 2, true}, {true, "", 6, 6, 3, 2, 0, false},
          {false, "net.slice2.3", 6, 19, 5, 1, 2, true}, {true, "", 19, 19, 3, 2, 0, false},
          {false, "net.slice3.6", 19, 9, 3, 1, 1, true}, {false, "net.slice4.8", 9, 8, 3, 1, 1, true},
          {false, "net.slice5.10", 8, 16, 3, 1, 1, true}};
}

struct Weights {
  std::map<std::string, tg::Tensor> tensors;

  explicit Weights(const std::vector<Layer>& layers) {
    tg::Random random(17);
    const auto add = [&](const std::string& name, const std::vector<std::int64_t>& shape, double low, double high) {
      tg::Tensor& tensor = tensors[name];
      tensor.shape = shape;
      std::int64_t count = 1;
      for (std::int64_t side : shape) count *= side;
      for (std::int64_t i = 0; i < count; ++i) {
        tensor.values.push_back(static_cast<float>(low + (high - low) * random.uniform()));
      }
    };
    int lin = 0;
    for (const Layer& layer : layers) {
      if (!layer.pool) {
        const double size = 2 / std::sqrt(layer.inputs * layer.kernel * layer.kernel);
        add(layer.name + ".weight", {layer.outputs, layer.inputs, layer.kernel, layer.kernel}, -size, size);
        add(layer.name + ".bias", {layer.outputs}, -0.1, 0.2);
      }
      if (layer.tap) add("lin" + std::to_string(lin++) + ".model.1.weight", {1, layer.outputs, 1, 1}, 0, 1);
    }
  }

  tg::Safetensors file() const {
    nlohmann::json header;
    std::vector<std::uint8_t> data;
    for (const auto& [name, tensor] : tensors) {
      const std::size_t begin = data.size();
      data.resize(begin + tensor.values.size() * 4);
      std::memcpy(data.data() + begin, tensor.values.data(), tensor.values.size() * 4);
      header[name] = {{"dtype", "F32"}, {"shape", tensor.shape}, {"data_offsets", {begin, data.size()}}};
    }
    const std::string text = header.dump();
    std::vector<std::uint8_t> bytes(8 + text.size());
    const std::uint64_t length = text.size();
    std::memcpy(bytes.data(), &length, 8);
    std::memcpy(bytes.data() + 8, text.data(), text.size());
    bytes.insert(bytes.end(), data.begin(), data.end());
    return tg::Safetensors::parse(bytes, "w.safetensors");
  }
};

using Planes = std::vector<std::vector<double>>;  // [channel][y * width + x]

// Distance by the definition: one sum per output, one plane per channel.
double reference(const std::vector<Layer>& layers, const Weights& weights, const Image& a, const Image& b,
                 LpipsRange range) {
  const double shift[] = {-0.030, -0.088, -0.188}, scale[] = {0.458, 0.448, 0.450};
  int width = a.width, height = a.height;
  const Image* images[] = {&a, &b};
  Planes maps[2];
  for (int n = 0; n < 2; ++n) {
    maps[n].resize(3);
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          const double value = images[n]->at(x, y, c);
          maps[n][c].push_back(((range == LpipsRange::symmetric ? 2 * value - 1 : value) - shift[c]) / scale[c]);
        }
      }
    }
  }
  double total = 0;
  int lin = 0;
  for (const Layer& layer : layers) {
    const int w = (width + 2 * layer.padding - layer.kernel) / layer.stride + 1;
    const int h = (height + 2 * layer.padding - layer.kernel) / layer.stride + 1;
    for (Planes& planes : maps) {
      Planes next(static_cast<std::size_t>(layer.outputs));
      for (int o = 0; o < layer.outputs; ++o) {
        for (int y = 0; y < h; ++y) {
          for (int x = 0; x < w; ++x) {
            double value = layer.pool ? -1e300 : weights.tensors.at(layer.name + ".bias").values[o];
            for (int i = layer.pool ? o : 0; i < (layer.pool ? o + 1 : layer.inputs); ++i) {
              for (int v = 0; v < layer.kernel; ++v) {
                for (int u = 0; u < layer.kernel; ++u) {
                  const int sx = x * layer.stride + u - layer.padding, sy = y * layer.stride + v - layer.padding;
                  if (sx < 0 || sy < 0 || sx >= width || sy >= height) continue;
                  const double in = planes[i][static_cast<std::size_t>(sy) * width + sx];
                  if (layer.pool) {
                    value = std::max(value, in);
                  } else {
                    const std::size_t tap =
                        ((static_cast<std::size_t>(o) * layer.inputs + i) * layer.kernel + v) * layer.kernel + u;
                    value += in * weights.tensors.at(layer.name + ".weight").values[tap];
                  }
                }
              }
            }
            next[o].push_back(layer.pool ? value : std::max(value, 0.0));
          }
        }
      }
      planes = std::move(next);
    }
    width = w;
    height = h;
    if (!layer.tap) continue;
    const std::vector<float>& linear = weights.tensors.at("lin" + std::to_string(lin++) + ".model.1.weight").values;
    double sum = 0;
    for (std::size_t i = 0; i < maps[0][0].size(); ++i) {
      double norms[2] = {};
      for (int n = 0; n < 2; ++n) {
        for (const auto& plane : maps[n]) norms[n] += plane[i] * plane[i];
        norms[n] = std::sqrt(norms[n]) + 1e-10;
      }
      for (std::size_t c = 0; c < maps[0].size(); ++c) {
        const double difference = maps[0][c][i] / norms[0] - maps[1][c][i] / norms[1];
        sum += linear[c] * difference * difference;
      }
    }
    total += sum / (width * height);
  }
  return total;
}

}  // namespace

TEST_CASE("LPIPS equals plain loops in double, for both networks and ranges", "[lpips]") {
  for (const auto& [layers, network] :
       {std::pair{vgg(), tg::LpipsNetwork::vgg16}, std::pair{alex(), tg::LpipsNetwork::alexNet}}) {
    const Weights weights(layers);
    const tg::Lpips lpips(weights.file());
    CHECK(lpips.network() == network);
    const Image a = noise(50, 37, 1), b = noise(50, 37, 2);
    for (const LpipsRange range : {LpipsRange::symmetric, LpipsRange::unit}) {
      const double expected = reference(layers, weights, a, b, range);
      CHECK(expected > 0.01);
      CHECK(lpips.distance(a, b, range) == Approx(expected).epsilon(1e-5));  // float32 sums of up to 162 products
    }
  }
}

TEST_CASE("LPIPS is 0 for equal pictures, symmetric, and the same at any thread count", "[lpips]") {
  const tg::Lpips lpips(Weights(vgg()).file());
  const Image a = noise(33, 40, 3), b = noise(33, 40, 4);
  CHECK(lpips.distance(a, a, LpipsRange::symmetric) == 0);
  tg::setThreadCount(1);
  const double one = lpips.distance(a, b, LpipsRange::symmetric);
  tg::setThreadCount(3);
  CHECK(lpips.distance(a, b, LpipsRange::symmetric) == one);
  CHECK(lpips.distance(b, a, LpipsRange::symmetric) == one);
  tg::setThreadCount(0);
  // Values beyond [0, 1] are clamped, as every metric here does.
  Image bright = a, clamped = a;
  bright.data[7] = 3;
  clamped.data[7] = 1;
  CHECK(lpips.distance(bright, clamped, LpipsRange::symmetric) == 0);
}

TEST_CASE("LPIPS refuses weights that do not fit together, and pictures that are too small", "[lpips]") {
  const auto refusal = [](const Weights& weights) -> std::string {
    try {
      const tg::Lpips lpips(weights.file());
    } catch (const tg::Error& error) {
      return error.what();
    }
    return "accepted";
  };
  const Weights whole(vgg());
  CHECK(refusal(whole) == "accepted");
  Weights missing = whole;
  missing.tensors.erase("net.slice3.12.bias");
  CHECK_THAT(refusal(missing), Contains("w.safetensors: tensor 'net.slice3.12.bias' is missing"));
  Weights channels = whole;
  channels.tensors["net.slice1.2.weight"].shape = {15, 5, 3, 1};
  CHECK_THAT(refusal(channels), Contains("'net.slice1.2.weight' has another shape (expected [15, 5, 3, 3]"));
  Weights linear = whole;
  linear.tensors["lin1.model.1.weight"].shape = {6};
  CHECK_THAT(refusal(linear), Contains("'lin1.model.1.weight' has another shape (expected [1, 6, 1, 1], found [6])"));
  const tg::Lpips lpips(whole.file());
  CHECK_THROWS_WITH(lpips.distance(noise(15, 40, 1), noise(15, 40, 2), LpipsRange::symmetric),
                    Contains("too small for LPIPS (15 x 40)"));
  CHECK_NOTHROW(lpips.distance(noise(16, 16, 1), noise(16, 16, 2), LpipsRange::symmetric));
  CHECK_THROWS_AS(lpips.distance(noise(20, 20, 1), noise(20, 21, 2), LpipsRange::symmetric), tg::Error);
}
