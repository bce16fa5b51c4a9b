// SPDX-License-Identifier: Apache-2.0
// Writes compressed splat PLY (converter/formats/read_compressed_ply.h): 16 bytes a Gaussian and a byte each of its
// coefficients above degree 0, in chunks of neighbours.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/model/model.h"

namespace tg {

// What the file holds otherwise than the model.
struct CompressedPlyReport {
  std::vector<std::uint32_t> order;  // Gaussian j of the file is Gaussian order[j] of the model
  std::size_t clipped_sh = 0;        // Gaussians with a coefficient of degree 1 to 3 outside [-4, 4]
};

// Without textures: bake them first (core/model/fallback.h). In the order of converter/formats/space_curve.h, since
// what a chunk spans is what its 8 to 11 bits have to span; in the model's axes. Same model in, same bytes out.
std::vector<std::uint8_t> formatCompressedPly(const GaussianModel& model, CompressedPlyReport& report);
// Atomic. Throws Error(cannotWrite), Error(badData) for a model without Gaussians.
CompressedPlyReport writeCompressedPly(const std::filesystem::path& path, const GaussianModel& model);

}  // namespace tg
