// SPDX-License-Identifier: Apache-2.0
// A viewer's state with a model to edit, as the window keeps it between frames.
#pragma once
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "support/scenes.h"
#include "viewer/keys.h"
#include "viewer/view/actions.h"
#include "viewer/view/edits.h"

namespace tg::test {

inline ViewerState sampleState(GaussianModel model = trainedLikeModel(11, 400)) {
  Scene scene;
  scene.path = "sample.tgz";
  scene.model = std::make_shared<GaussianModel>(std::move(model));
  measure(scene);
  scene.cameras.push_back(trainedLikeCamera(96, 72));
  ViewerState state;
  state.camera.aspect = 96.0 / 72.0;
  setScene(state, scene);
  state.documents.open.emplace_back().path = scene.path;
  state.documents.shown = 0;
  recordChanges(state, false, false);
  return state;
}

inline void frame(ViewerState& state, bool busy = false, bool flowing = false) {
  state.time += 1;
  recordChanges(state, busy, flowing);
}

inline std::vector<std::uint8_t> everyThird(std::size_t count) {
  std::vector<std::uint8_t> mask(count);
  for (std::size_t i = 0; i < count; i += 3) mask[i] = 1;
  return mask;
}

inline Similarity someSimilarity() {
  Similarity s;
  s.scale = 1.25;
  s.rotation = glm::dmat3(0, 1, 0, -1, 0, 0, 0, 0, 1);
  s.translation = {0.5, -1, 2};
  return s;
}

inline constexpr int kUndo = kControl | 'Z', kRedo = kControl | 'Y';

}  // namespace tg::test
