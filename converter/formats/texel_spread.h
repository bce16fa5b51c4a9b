// SPDX-License-Identifier: Apache-2.0
// How coarse texels may be stored where they weigh less (docs/sog.md, "Textures").
#pragma once
#include <vector>

namespace tg {

constexpr double kByteSteps = 127;  // from the neutral number of a byte

// How many times the step a texel's value may be off: [height, width], 1 for the texels that weigh most. Errors then
// weigh alike wherever they are. Sides of at least 1.
std::vector<double> texelSpreads(int width, int height);
// The same of a Gaussian of this opacity (0 to 1).
double opacitySpread(double opacity);

// A distance from the neutral value [steps] as a whole number of steps: the nearest, or the next one nearer to none.
double wholeSteps(double steps);

// The number below which 99.9 % of these lie. Reorders them; at least one.
float mostOf(std::vector<float>& magnitudes);
// `step` (above 0), or the least power of 2 of it of which 127 reach `most`.
double reachingStep(double step, double most);

}  // namespace tg
