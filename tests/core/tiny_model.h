// SPDX-License-Identifier: Apache-2.0
// Small models with a different number in every place.
#pragma once
#include <random>

#include "core/model/model.h"

namespace tg {

inline GaussianModel tinyModel(std::size_t count, int sh_degree, unsigned seed = 1) {
  std::mt19937 random(seed);
  const auto value = [&] { return static_cast<float>(random() >> 8) / 8388608.0f - 1.0f; };
  GaussianModel model;
  model.sh_degree = sh_degree;
  for (std::size_t i = 0; i < count; ++i) {
    model.mean.push_back({value(), value(), value()});
    model.rotation.push_back({1.5f + value(), value(), value(), value()});
    model.log_scale.push_back({value() - 3.0f, value() - 3.0f, value() - 3.0f});
    model.opacity_logit.push_back(4.0f * value());
    for (std::size_t k = 0; k < model.shCount(); ++k) model.sh.push_back({value(), value(), value()});
  }
  return model;
}

// Every Gaussian another rectangle, every third none; colours signed, alpha in [0, 1].
inline GaussianModel tinyTexturedModel(std::size_t count, unsigned seed = 1) {
  GaussianModel model = tinyModel(count, 1, seed);
  model.texture_mode = TextureMode::rgba;
  model.intersection = IntersectionModel::plane;
  std::mt19937 random(seed + 1);
  for (std::size_t i = 0; i < count; ++i) {
    TextureRect rect;
    if (i % 3 != 2) {
      rect.offset = static_cast<std::uint32_t>(model.atlas.texels.size());
      rect.width = static_cast<std::uint16_t>(1 + random() % 5);
      rect.height = static_cast<std::uint16_t>(1 + random() % 7);
    }
    model.atlas.rects.push_back(rect);
    // Multiples of 1/1024 up to 1 are exact as half floats.
    for (std::uint32_t t = 0; t < rect.texelCount(); ++t) {
      model.atlas.texels.push_back(
          {static_cast<float>(random() % 2049) / 1024.0f - 1.0f, static_cast<float>(random() % 2049) / 1024.0f - 1.0f,
           static_cast<float>(random() % 2049) / 1024.0f - 1.0f, static_cast<float>(random() % 1025) / 1024.0f});
    }
  }
  return model;
}

}  // namespace tg
