// SPDX-License-Identifier: Apache-2.0
// Any bytes are named tensors or an Error; what is read has the size that its shape says.
#include <cstdlib>

#include "core/file/safetensors.h"
#include "core/system/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const tg::Safetensors file = tg::Safetensors::parse({data, data + size}, "fuzz.safetensors");
    for (const std::string& name : file.names()) {
      try {
        const tg::Tensor tensor = file.tensor(name);
        std::size_t elements = 1;
        for (std::int64_t side : tensor.shape) elements *= static_cast<std::size_t>(side);
        if (elements != tensor.values.size()) std::abort();
      } catch (const tg::Error&) {  // a type that is not read
      }
    }
  } catch (const tg::Error&) {
  }
  return 0;
}
