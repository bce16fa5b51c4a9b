// SPDX-License-Identifier: Apache-2.0
// How many Gaussians and texels a file of some size has room for.
#include "training/run/size_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

// Of .sog files at steps of 4.
constexpr double kFileBytes = 2500;                                        // names, codebooks, heads of images
constexpr std::array<double, 4> kGaussianBytes = {8.8, 11.3, 13.8, 17.0};  // by SH degree
constexpr double kTexelBytes = 0.95;
constexpr double kSharedTexelBytes = 1.3;  // of 8 x 8
constexpr double kChoiceBytes = 0.65;      // a Gaussian's: which texture it has, and how it lies
// How many textures are shared, and which part of a file they may take for that (docs/frontier.md).
constexpr std::array<std::pair<int, double>, 3> kShared = {{{256, 0.08}, {64, 0.15}, {16, 0.15}}};
constexpr double kMostTexels = 8;        // a Gaussian
constexpr double kLeastTexels = 0.1;     // a Gaussian: with none textures would not be cut
constexpr double kPixelsPerTexel = 100;  // of the training views: with fewer, another Gaussian shows more
constexpr std::size_t kFewestGaussians = 100, kMostGaussians = 100'000'000;  // as --gaussians takes

// For Gaussians of `each` bytes. Throws Error(usage).
double roomFor(std::uint64_t bytes, double part, double each, double beside) {
  const double room = std::max(static_cast<double>(bytes) / part - beside, 0.0);
  if (room < kFewestGaussians * each) {
    const auto needed = std::llround(part * (beside + kFewestGaussians * each));
    throw Error(ErrorKind::usage,
                "--target-size is out of reach" +
                    expectedFound("at least " + std::to_string(needed) + " bytes", std::to_string(bytes)));
  }
  return room;
}

double bytesOfGaussian(int sh_degree) {
  TG_ASSERT(sh_degree >= 0 && sh_degree <= 3, "SH have degrees 0 to 3");
  return kGaussianBytes[static_cast<std::size_t>(sh_degree)];
}

}  // namespace

int planSharedTextures(std::uint64_t bytes, double part, int side) {
  for (const auto& [textures, most] : kShared) {
    if (kSharedTexelBytes * textures * side * side <= most * static_cast<double>(bytes) / part) return textures;
  }
  return 0;
}

SizePlan planForDictionary(std::uint64_t bytes, double part, int sh_degree, int textures, int side) {
  TG_ASSERT(textures > 0 && side > 0, "textures to share");
  const double each = bytesOfGaussian(sh_degree) + kChoiceBytes;
  const double room = roomFor(bytes, part, each, kFileBytes + kSharedTexelBytes * textures * side * side);
  return {std::min(static_cast<std::size_t>(room / each), kMostGaussians), 0};
}

SizePlan planForSize(std::uint64_t bytes, double part, std::uint64_t training_pixels, int sh_degree, TextureMode mode) {
  const double each = bytesOfGaussian(sh_degree);
  const double room = roomFor(bytes, part, each, kFileBytes);
  const double texels = std::min(
      {static_cast<double>(training_pixels) / kPixelsPerTexel, kMostTexels * room / (each + kMostTexels * kTexelBytes),
       std::max((room - kFewestGaussians * each) / kTexelBytes, kFewestGaussians * kLeastTexels)});
  if (mode == TextureMode::none) return {std::min(static_cast<std::size_t>(room / each), kMostGaussians), 0};
  const double gaussians = std::clamp((room - texels * kTexelBytes) / each, static_cast<double>(kFewestGaussians),
                                      static_cast<double>(kMostGaussians));
  return {static_cast<std::size_t>(gaussians), texels / gaussians};
}

}  // namespace tg
