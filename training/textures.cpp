// SPDX-License-Identifier: Apache-2.0
// Neutral texels for every Gaussian.
#include "training/textures.h"

namespace tg {

void addTextures(TrainingState& state, int size, TextureMode mode) {
  state.model.texture_mode = mode;
  if (mode != TextureMode::none) state.model.atlas = makeUniformAtlas(state.model.size(), size, size);
  resetMoments(state);
}

}  // namespace tg
