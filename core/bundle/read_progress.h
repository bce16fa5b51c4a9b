// SPDX-License-Identifier: Apache-2.0
// What a reader of models tells whoever waits for one: how far it is, and a part of the model to look at meanwhile.
#pragma once
#include <functional>

#include "core/file/file.h"
#include "core/model/model.h"

namespace tg {

struct ReadProgress : ByteProgress {
  // Set before reading: receives a part of a large model, spread evenly over what has been read so far, without
  // textures. Called in the reader's thread, now and then; formats that are read at once do not call it.
  std::function<void(GaussianModel part)> preview;
};

constexpr std::size_t kPreviewGaussians = 100'000;  // in a part, at most

}  // namespace tg
