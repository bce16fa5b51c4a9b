// SPDX-License-Identifier: Apache-2.0
// The golden frames' scenes.
#include "goldens/goldens.h"

#include "render/reference/reference.h"
#include "support/scenes.h"

namespace tg::test {
namespace {

RenderSettings settingsOf(IntersectionModel intersection, TextureMode textures, glm::vec3 background) {
  RenderSettings settings;
  settings.intersection = intersection;
  settings.textures = textures;
  settings.background = background;
  return settings;
}

FrameT<double> render(SceneKind kind, const RenderSettings& settings) {
  const TestScene scene = makeScene(kind, 1, 80, 32, 24);
  return renderReference(ReferenceModel(scene.model), scene.camera, settings);
}

// Copies `tile` into `frame` with its corner at (x0, y0).
void paste(FrameT<double>& frame, const FrameT<double>& tile, int x0, int y0) {
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; ++x) {
      const std::size_t from = static_cast<std::size_t>(y) * tile.width + x;
      const std::size_t to = static_cast<std::size_t>(y0 + y) * frame.width + x0 + x;
      frame.base[to] = tile.base[from];
      frame.texture[to] = tile.texture[from];
      frame.alpha[to] = tile.alpha[from];
      frame.depth[to] = tile.depth[from];
      frame.normal[to] = tile.normal[from];
      frame.count[to] = tile.count[from];
    }
  }
}

// One Gaussian at rising angles, the plane model above, the maximum response below.
FrameT<double> grazingStrip() {
  constexpr int kWidth = 16, kHeight = 12;
  constexpr double kDegrees[] = {0.0, 60.0, 80.0, 88.0, 89.9};
  FrameT<double> strip(kWidth * 5, kHeight * 2);
  for (int column = 0; column < 5; ++column) {
    const TestScene scene = grazingScene(kDegrees[column], kWidth, kHeight);
    for (IntersectionModel intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      const auto settings = settingsOf(intersection, TextureMode::rgba, glm::vec3(0.0f));
      const int row = intersection == IntersectionModel::plane ? 0 : 1;
      paste(strip, renderReference(ReferenceModel(scene.model), scene.camera, settings), column * kWidth,
            row * kHeight);
    }
  }
  return strip;
}

template <typename T>
void append(std::vector<float>& values, const std::vector<T>& output) {
  const auto* numbers = reinterpret_cast<const double*>(output.data());
  values.insert(values.end(), numbers, numbers + output.size() * sizeof(T) / sizeof(double));
}

}  // namespace

std::vector<Golden> renderGoldens() {
  const glm::vec3 black(0.0f), white(1.0f);
  std::vector<Golden> goldens;
  goldens.push_back(
      {"ordinary", render(SceneKind::ordinary, settingsOf(IntersectionModel::maxResponse, TextureMode::rgba, black))});
  goldens.push_back(
      {"flat_plane", render(SceneKind::flat, settingsOf(IntersectionModel::plane, TextureMode::rgb, black))});
  goldens.push_back(
      {"mixed_alpha", render(SceneKind::mixed, settingsOf(IntersectionModel::maxResponse, TextureMode::alpha, white))});
  goldens.push_back(
      {"trained_like", renderReference(ReferenceModel(trainedLikeModel(1, 600)), trainedLikeCamera(40, 30),
                                       settingsOf(IntersectionModel::maxResponse, TextureMode::rgba, white))});
  goldens.push_back({"grazing", grazingStrip()});
  return goldens;
}

std::vector<float> goldenValues(const FrameT<double>& frame) {
  std::vector<float> values;
  append(values, frame.base);
  append(values, frame.texture);
  append(values, frame.alpha);
  append(values, frame.depth);
  append(values, frame.normal);
  append(values, frame.count);
  return values;
}

FrameT<float> toFloat(const FrameT<double>& frame) {
  FrameT<float> result(frame.width, frame.height);
  result.base.assign(frame.base.begin(), frame.base.end());
  result.texture.assign(frame.texture.begin(), frame.texture.end());
  result.alpha.assign(frame.alpha.begin(), frame.alpha.end());
  result.depth.assign(frame.depth.begin(), frame.depth.end());
  result.normal.assign(frame.normal.begin(), frame.normal.end());
  result.count.assign(frame.count.begin(), frame.count.end());
  return result;
}

}  // namespace tg::test
