// SPDX-License-Identifier: Apache-2.0
// How far a float renderer's frame lies from the reference's, by the band rule: tight where both blended the same
// splats, counted and bounded where a threshold (the alpha cut, the transmittance stop, the near plane) fell
// differently; and how different the pictures look (LDR-FLIP).
#pragma once
#include <array>
#include <cstddef>
#include <string>

#include "render/renderer.h"

namespace tg::test {

// Differences count per pixel as max over channels of |a - b| / max(1, |b|). Where either is not finite: infinity.
struct OutputDifference {
  double max = 0;       // over all pixels
  double max_same = 0;  // over pixels with the same number of blended splats
  double mean = 0;
  std::size_t outliers = 0;  // pixels beyond Tolerance::tight
};

struct FrameDifference {
  std::array<OutputDifference, 7> outputs;  // by Output
  std::size_t pixels = 0;
  std::size_t flipped = 0;  // pixels with another number of blended splats: a threshold fell differently
  double look_mean = 0;     // LDR-FLIP of the final picture over black, mean over the pixels
  double look_99 = 0;       // its 99th percentile
  const OutputDifference& operator[](Output output) const { return outputs[static_cast<std::size_t>(output)]; }
};

struct Tolerance {
  double tight = 1e-5;          // what all but `outlier_share` of the pixels keep
  double outlier_share = 1e-3;  // of the pixels, per output, flipped pixels among them
  double loose = 2e-4;          // what every pixel keeps that blended the same splats
  double flip = 2e-2;           // what flipped pixels keep in final, base, texture, alpha and normal: the stop can take
                                // alpha 0.99 at transmittance 0.01 in or out, of colours up to 2
  double look_mean = 1e-3;      // all tests stay below but those of compact storage
  double look_99 = 1e-2;
  double depth_factor = 1.0;    // on tight and loose for depth: along a grazing plane, t multiplies rounding
};

FrameDifference compareFrames(const FrameT<float>& frame, const FrameT<double>& reference,
                              const Tolerance& tolerance = {});
// Two float frames, for example of two backends.
FrameDifference compareFrames(const Frame& frame, const Frame& reference, const Tolerance& tolerance = {});

// To float, so that the reference is a backend like any other.
Frame rounded(const FrameT<double>& exact);

// One line per broken promise, "" when all hold: CHECK(violations(difference, tolerance) == "").
std::string violations(const FrameDifference& difference, const Tolerance& tolerance = {});
// A table for people: per output max, max of unflipped pixels, mean, share of outliers.
std::string report(const FrameDifference& difference);

}  // namespace tg::test
