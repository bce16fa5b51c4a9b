// SPDX-License-Identifier: Apache-2.0
// Any bytes are a splat PLY or an Error; what was read survives being written.
#include <cstdlib>

#include "core/error.h"
#include "core/ply.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const tg::GaussianModel model = tg::parseSplatPly({data, size}, "fuzz.ply");
    tg::checkModel(model, "fuzz.ply");
    const std::vector<std::uint8_t> written = tg::formatSplatPly(model);
    if (tg::formatSplatPly(tg::parseSplatPly(written, "again.ply")) != written) std::abort();
  } catch (const tg::Error&) {
  }
  return 0;
}
