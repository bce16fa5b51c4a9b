// SPDX-License-Identifier: Apache-2.0
// The expected picture of docs/gltf-extension/sample.glb.
#include "sample_picture.h"

#include <algorithm>

#include "converter/registry/file_format.h"
#include "render/reference/reference.h"

namespace tg::test {

Image renderSample(const std::filesystem::path& folder) {
  constexpr int kWidth = 320, kHeight = 160;
  const Bundle loaded = readModel(folder / "sample.glb");
  const FrameT<double> frame =
      renderReference(ReferenceModel(loaded.model), resized(loaded.cameras.at(0), kWidth, kHeight), {});
  Image image(kWidth, kHeight, 3);
  for (std::size_t i = 0; i < frame.base.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      image.data[i * 3 + c] = static_cast<float>(std::clamp(frame.color(i)[c], 0.0, 1.0));
    }
  }
  return image;
}

}  // namespace tg::test
