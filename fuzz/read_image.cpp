// SPDX-License-Identifier: Apache-2.0
// Any bytes are a PNG, JPEG, WebP or EXR picture, or an Error.
#include <cstdlib>

#include "core/image/image.h"
#include "core/system/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const tg::Image image = tg::decodeImage({data, size}, "fuzz");
    if (image.data.size() != static_cast<std::size_t>(image.width) * image.height * image.channels) std::abort();
  } catch (const tg::Error&) {
  }
  return 0;
}
