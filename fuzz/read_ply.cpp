// SPDX-License-Identifier: Apache-2.0
// Any bytes are a splat PLY or an Error, whether they come at once or piece by piece, which refuses bytes behind the
// last row; what was read survives being written.
#include <algorithm>
#include <cstdlib>
#include <optional>

#include "core/bundle/ply.h"
#include "core/bundle/splat_rows.h"
#include "core/system/error.h"

namespace {

std::optional<tg::GaussianModel> inPieces(std::span<const std::uint8_t> bytes, std::size_t piece) {
  try {
    tg::SplatStream stream(bytes.size(), "fuzz.ply");
    for (std::size_t at = 0; at < bytes.size(); at += piece) {
      stream.add(bytes.subspan(at, std::min(piece, bytes.size() - at)));
    }
    return stream.finish();
  } catch (const tg::Error&) {
    return std::nullopt;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::optional<tg::GaussianModel> streamed = inPieces({data, size}, 1 + size / 3);
  try {
    const tg::GaussianModel model = tg::parseSplatPly({data, size}, "fuzz.ply");
    tg::checkModel(model, "fuzz.ply");
    const std::vector<std::uint8_t> written = tg::formatSplatPly(model);
    if (tg::formatSplatPly(tg::parseSplatPly(written, "again.ply")) != written) std::abort();
    const bool exact = tg::SplatRows({data, size}, size, "fuzz.ply").trailing() == 0;
    if (streamed.has_value() != exact || (exact && tg::formatSplatPly(*streamed) != written)) std::abort();
  } catch (const tg::Error&) {
    if (streamed) std::abort();
  }
  return 0;
}
