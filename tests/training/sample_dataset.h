// SPDX-License-Identifier: Apache-2.0
// The built-in scene as a data set, without a detour over files.
#pragma once
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "training/data/dataset.h"
#include "training/data/sample.h"

namespace tg::test {

// On white; or with its transparency kept, for a background of another colour at every step.
inline Dataset sampleDataset(const SampleOptions& options, bool random_background = false) {
  Dataset dataset;
  dataset.name = "sample";
  dataset.layout = DatasetLayout::nerfSynthetic;
  dataset.background = glm::vec3(1.0f);
  dataset.random_background = random_background;
  dataset.points = samplePoints(options);
  const auto byte = [](float value) { return static_cast<std::uint8_t>(std::lround(value * 255)); };
  const float white[3] = {1, 1, 1};
  std::vector<Photograph> photographs;
  for (const bool test : {false, true}) {
    for (int i = 0; i < (test ? options.test_views : options.train_views); ++i) {
      Camera camera = sampleCamera(options, test, i);
      const Image picture = renderSample(options, camera);
      Photograph& photograph = photographs.emplace_back();
      photograph.pixels.width = camera.size.x;
      photograph.pixels.height = camera.size.y;
      if (random_background) {
        for (std::size_t p = 0; p < picture.data.size(); p += 4) {
          for (std::size_t c = 0; c < 3; ++c) photograph.pixels.rgb.push_back(byte(picture.data[p + c]));
          photograph.alpha.push_back(byte(picture.data[p + 3]));
        }
      } else {
        for (const float value : compositeOver(picture, white).data) photograph.pixels.rgb.push_back(byte(value));
      }
      dataset.views.push_back(std::move(camera));
    }
  }
  dataset.photographs = storeInMemory(std::move(photographs));
  return dataset;
}

}  // namespace tg::test
