// SPDX-License-Identifier: Apache-2.0
// Any bytes are an SPZ, a compressed PLY, a .splat, a .ksplat, a SOG, a PLY that is mended or an Error; what was read
// is a sound model. The first byte chooses the reader; others do nothing, so that a new reader leaves the corpus as it
// is.
#include "converter/formats/read_compressed_ply.h"
#include "converter/formats/read_ksplat.h"
#include "converter/formats/repair.h"
#include "converter/formats/splat.h"
#include "converter/formats/spz.h"
#include "converter/sog/sog.h"
#include "core/bundle/ply.h"
#include "core/system/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const std::uint8_t> bytes(data + 1, size - 1);
  try {
    switch (data[0]) {
      case 0:
        tg::checkModel(tg::parseSpz(bytes, "fuzz.spz").model, "fuzz.spz");
        break;
      case 1:
        tg::checkModel(tg::parseCompressedPly(bytes, "fuzz.ply"), "fuzz.ply");
        break;
      case 2:
        tg::checkModel(tg::parseSog(bytes, "fuzz.sog").model, "fuzz.sog");
        break;
      case 3:
        tg::checkModel(tg::parseKsplat(bytes, "fuzz.ksplat").model, "fuzz.ksplat");
        break;
      case 4:
        tg::checkModel(tg::parseSplat(bytes, "fuzz.splat").model, "fuzz.splat");
        break;
      case 5: {
        bool broken = false;
        std::vector<std::string> warnings;
        tg::GaussianModel model = tg::parseSplatPly(bytes, "fuzz.ply", &broken);
        if (broken) tg::mendSplats(model, "fuzz.ply", warnings);
        tg::checkModel(model, "fuzz.ply");
        break;
      }
      default:
        break;
    }
  } catch (const tg::Error&) {
  }
  return 0;
}
