// SPDX-License-Identifier: Apache-2.0
// SPZ, as github.com/nianticlabs/spz describes it. Reads versions 2 and 3 (one gzip stream, or that stream's bytes in
// the clear) and 4 (a Zstandard stream an attribute); writes 4 and, for readers older than it, 3.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/bundle/bundle.h"
#include "core/system/names.h"

namespace tg {

// How a file's numbers lie, whatever it says itself (docs/formats.md).
enum class SpzAxes {
  rub,  // x right, y up, z back: the format's own
  rdf   // x right, y down, z front: a PLY's, in files of programs that store its numbers unturned
};
constexpr auto namesOf(SpzAxes) { return enumNames("rub", "rdf"); }

// In the model's axes. `axes`: without any, those of the file's SPZ_ADOBE_coordinate_system, else rub. Other vendor
// extensions and SH of degree 4 are left out with a warning. Throws Error(cannotRead / badData).
Bundle readSpz(const std::filesystem::path& path, std::optional<SpzAxes> axes = {});
Bundle parseSpz(std::span<const std::uint8_t> bytes, const std::string& path, std::optional<SpzAxes> axes = {});

// What the 8 bits of a number could not hold.
struct SpzReport {
  int fractional_bits = 0;         // positions are multiples of 2^-fractional_bits
  std::size_t clipped_scales = 0;  // splats with a log scale outside [-10, 5.9375]
  std::size_t clipped_colors = 0;  // splats with a DC coefficient outside +-3.33
  std::size_t clipped_sh = 0;      // splats with a coefficient of degree 1 to 3 outside [-1, 1]
};

// What is written; both hold the same numbers.
constexpr int kOldestSpz = 3;
constexpr int kNewestSpz = 4;

// In the format's own axes. Without textures: bake them first (core/model/fallback.h). `version` is one of the two
// above. Same model in, same bytes out, as long as zlib and libzstd stay theirs. Throws Error(badData) when a mean is
// too far out for 24 bits; `path` starts the message.
std::vector<std::uint8_t> formatSpz(const GaussianModel& model, const std::string& path, SpzReport& report,
                                    int version = kNewestSpz);
SpzReport writeSpz(const std::filesystem::path& path, const GaussianModel& model, int version = kNewestSpz);

}  // namespace tg
