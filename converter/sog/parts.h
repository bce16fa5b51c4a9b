// SPDX-License-Identifier: Apache-2.0
// What the reader and the writer of SOG files agree on. Private to converter/sog.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "converter/formats/texel_spread.h"
#include "core/model/fallback.h"
#include "core/model/model.h"

namespace tg::sog {

constexpr int kVersion = 2;
constexpr std::size_t kCodebook = 256;
constexpr std::size_t kMaxPalette = 65536;
constexpr std::size_t kPaletteColumns = 64;
constexpr int kFirstLargest = 252;  // in a quaternion's fourth byte: 252 + which of w x y z is left out

constexpr std::uint64_t kMaxMetaBytes = std::uint64_t{16} << 20;
// Gaussians in a file, or several, of so many bytes: positions alone take six bytes where they are no pattern.
constexpr std::size_t kCountAlwaysAllowed = 1 << 20;
constexpr std::size_t kMostPerByte = 4;

// Positions are stored as this logarithm.
inline double toLogarithm(double x) { return std::copysign(std::log1p(std::abs(x)), x); }
inline double fromLogarithm(double x) { return std::copysign(std::expm1(std::abs(x)), x); }

// ---- Textures
constexpr const char* kTextures = "TG_gaussian_splatting_texture";  // key of meta.json
constexpr int kOwnTextures = 1, kSharedTextures = 2;  // versions: a texture a Gaussian, or one for several
// How much coarser a texture may be than its texels' spreads, by how many Gaussians have it: the error of a step is
// theirs all together.
inline double sharedSpread(std::uint32_t members) { return 1.0 / std::sqrt(std::max(members, 1u)); }
constexpr double kSharedReach = 1.0;  // that bytes of such a texture have at least, to either side of the neutral value
// Of a texel's value, from the step of its channel and the texture's and the texel's spread.
inline double texelStep(double step, double spread, bool shared) {
  return shared ? std::max(step * spread, kSharedReach / kByteSteps) : step * spread;
}
// Of the base. Readers of the first version, textures of a Gaussian's own, know no other scales than the base's.
inline FallbackScale fallbackScale(bool shared) { return shared ? FallbackScale::fitted : FallbackScale::kept; }
// Texels of all Gaussians that share theirs: as many as an image of a texture a Gaussian could hold.
constexpr std::uint64_t kMostHandedOut = std::uint64_t{1} << 28;
constexpr int kMaxSide = 255;      // [texels]
constexpr int kNeutralByte = 128;  // of a texel's value

// Textures of one size, in their order; classes by height, then width.
struct SizeClass {
  int width, height;
  std::vector<std::uint32_t> textures;
};
std::vector<SizeClass> sizeClasses(std::span<const TextureRect> rects);

}  // namespace tg::sog
