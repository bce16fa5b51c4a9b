// SPDX-License-Identifier: Apache-2.0
// Any bytes are a photograph with or without EXIF, or an Error.
#include <cstdlib>

#include "core/system/error.h"
#include "training/photos/photograph.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const tg::TakenPhotograph photograph = tg::decodePhotograph({data, size}, "fuzz");
    if (!tg::hasImageShape(photograph.image)) std::abort();
    const int orientation = photograph.facts.orientation;
    if (orientation < 1 || orientation > 8) std::abort();
  } catch (const tg::Error&) {
  }
  return 0;
}
