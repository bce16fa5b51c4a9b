// SPDX-License-Identifier: Apache-2.0
// What a reader of models tells whoever waits for one: how far it is, and a part of the model to look at meanwhile.
#pragma once
#include <cmath>
#include <functional>

#include "core/file/byte_progress.h"
#include "core/model/model.h"
#include "core/system/assert.h"

namespace tg {

struct ReadProgress : ByteProgress {
  // Set before reading: receives a part of a large model, spread evenly over what has been read so far, without
  // textures. Called in the reader's thread, now and then; formats that are read at once do not call it.
  std::function<void(GaussianModel part)> preview;
};

constexpr std::size_t kPreviewGaussians = 100'000;  // in a part, at most

// What the log scales of a part of `part` Gaussians grow by, so that it covers the surfaces of all `whole` of them.
inline float previewGrowth(std::size_t whole, std::size_t part) {
  TG_ASSERT(part <= whole, "a part is no more than all");
  return part == 0 ? 0.0f : 0.5f * std::log(static_cast<float>(whole) / static_cast<float>(part));
}

}  // namespace tg
