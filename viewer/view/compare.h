// SPDX-License-Identifier: Apache-2.0
// Two pictures of one view: how they are put together, and how far they are apart.
#pragma once
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/model/camera.h"
#include "core/system/names.h"
#include "render/settings.h"

namespace tg {

// side: both beside each other, each at half the width. wipe: one left of the divider, the other right of it. flicker:
// one after the other. difference: how far they are apart at every pixel. flip: how far for the eye
// (core/image/flip.h).
enum class CompareMode { off, side, wipe, flicker, difference, flip };
constexpr auto namesOf(CompareMode) { return enumNames("off", "side", "wipe", "flicker", "difference", "flip"); }

constexpr float kMaxGain = 64;
constexpr double kFastestFlicker = 0.1, kSlowestFlicker = 5;  // [s] that each picture stays

struct Comparison {
  CompareMode mode = CompareMode::off;
  float divider = 0.5f;      // of the width, for wipe
  float gain = 1;            // on differences
  bool with_sign = false;    // difference: 0.5 + gain (other - first) / 2 instead of gain |other - first|
  bool shows_other = false;  // flicker
  bool operator==(const Comparison&) const = default;
};

// Both pictures have one size and 3 channels in [0, 1]; not for CompareMode::side, whose pictures are those of half the
// width each. A pixel that does not count (mask 0; empty: all do) has no difference.
Image differenceOf(const Image& first, const Image& other, const std::vector<std::uint8_t>& mask,
                   const Comparison& how);
// The FLIP map in its authors' colours, magma: 0 is black, 1 light yellow. A pixel that does not count is grey. Seconds
// of work for large pictures.
Image flipOf(const Image& first, const Image& other, const std::vector<std::uint8_t>& mask);
// What the mode shows. side: of the width of both.
Image composed(const Image& first, const Image& other, const std::vector<std::uint8_t>& mask, const Comparison& how);

// Of each picture of `side` in `width` pixels; the last column of an odd width stays empty.
int sideWidth(int width);

// What a photograph shows, too: the others have no figures against one.
constexpr OutputSet kPhotographOutputs = {Output::final, Output::base};
// A photograph beside a picture of `output` with those settings: with the picture's exposure, where it has one.
Image exposedLike(Image photograph, Output output, const RenderSettings& settings);

// Of the pixels that count.
struct PictureMetrics {
  double psnr = 0;  // [dB], infinite for equal pictures
  double ssim = 0;
  double flip = 0;
};
// Seconds of work for large pictures. None where no pixel counts.
std::optional<PictureMetrics> metricsOf(const Image& first, const Image& other, const std::vector<std::uint8_t>& mask);
std::string formatMetrics(const PictureMetrics& metrics);  // "PSNR 31.02 dB, SSIM 0.9512, FLIP 0.0671"

struct PicturePair {
  Image first, other;              // 3 channels, one size
  std::vector<std::uint8_t> mask;  // 0: the pixel does not count; empty: all do
};

// For the user, of a folder whose data set's cameras have a lens.
inline constexpr const char* kLensNote =
    "photographs have a lens, the model's pictures have none: tgtrain undistort DATASET OUT makes ones to compare with";

// What is compared, and what is known of it.
struct CompareState {
  Comparison how;
  std::filesystem::path other;        // an open model; where it is not one, the next open one counts
  std::filesystem::path photographs;  // a folder; empty: none
  bool photographs_have_lens = false;
  bool with_photographs = false;      // instead of a model
  bool timed = false;                 // flicker by itself
  double flicker_seconds = 0.5;       // that each picture stays

  // Written by the window.
  std::string problem;                    // why there is nothing to compare with; "" = there is
  std::string way_out;                    // what to do about it; "" = nothing is known
  std::string photograph;                 // its file below the folder; "" = none
  bool measured = false;                  // `metrics` are those of the picture on screen, not of one before
  std::optional<PictureMetrics> metrics;  // none: not yet, or no pixel counts
  glm::ivec2 measured_size{0};            // [px] of what is measured
};

// A photograph as `view` sees it, when `view` stands where `taken` stood and looks the same way. The photograph may
// have another size than its camera, and pixels at its right and bottom that --downscale cut. Area filtered where it gets smaller; mask 0 beside it.
struct ResampledPhotograph {
  Image image;  // 3 channels
  std::vector<std::uint8_t> mask;
};
ResampledPhotograph resampled(const Image& photograph, const Camera& taken, const Camera& view, glm::vec3 background);

}  // namespace tg
