// SPDX-License-Identifier: Apache-2.0
// Any bytes are a glTF file with splats or an Error; what was read is a sound model.
#include "converter/read_gltf.h"
#include "core/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (const bool base_only : {false, true}) {
    try {
      tg::ReadOptions options;
      options.base_only = base_only;
      tg::checkModel(tg::parseGltf({data, size}, "fuzz.glb", options).model, "fuzz.glb");
    } catch (const tg::Error&) {
    }
  }
  return 0;
}
