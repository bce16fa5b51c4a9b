// SPDX-License-Identifier: Apache-2.0
// The inspector: what lies under a pixel, and the Gaussian picked of it.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "viewer/view/state.h"

namespace tg {

// The pixel of a picture of that size to be inspected next: asked for here, answered by InspectorThread.
void inspect(ViewerState& state, glm::ivec2 pixel);
// Which of the hits is looked at; -1: none. Out of range: the nearest one that is there.
void pickHit(ViewerState& state, int hit);
void stepHit(ViewerState& state, int step);
int strongestHit(const std::vector<PixelHit>& hits);  // the first of most weight; -1: there is none
// [hits] their numbers as the list shows them; equal ones stay front to back.
std::vector<int> sortedHits(const GaussianModel& model, const std::vector<PixelHit>& hits, HitColumn column,
                            bool descending);
// A second click turns the order round; weights and sizes begin with the largest.
void sortHits(ViewerState& state, HitColumn column);
// In the world, on the ray of the inspected pixel at the depth of the picked hit.
std::optional<glm::dvec3> inspectedPoint(const ViewerState& state);
// [world] the outline of an ellipsoid of `sigmas` around a Gaussian, as seen from `eye`; empty from inside of it.
std::vector<glm::dvec3> outlineOf(const GaussianModel& model, std::size_t index, double sigmas, glm::dvec3 eye);
void clearInspection(ViewerState& state);
// Turns the camera about what those hits of a pixel show: the point at which half of its light is stopped, else the
// brightest hit. It comes to the middle of the picture.
void turnAbout(ViewerState& state, const Camera& camera, glm::ivec2 pixel, const std::vector<PixelHit>& hits);
// The picked Gaussian's number in the model; nothing while none is picked.
std::optional<std::uint32_t> pickedGaussian(const ViewerState& state);

// A Gaussian by its stored numbers.
struct GaussianFacts {
  glm::dvec3 mean{0.0};   // world
  glm::dvec3 sigma{0.0};  // world units
  double opacity = 0;     // after the sigmoid
  double effective_rank = 0;
  int width = 0, height = 0;  // [texels] of its texture; 0: none
};
GaussianFacts factsOf(const GaussianModel& model, std::size_t index);  // index < size

// A texel as two colours to be looked at: 0.5 + rgb / 2, and its factor on alpha as grey.
struct TexelColors {
  glm::vec3 rgb{0.5f};
  glm::vec3 alpha{1.0f};
};
TexelColors texelColors(const GaussianModel& model, std::size_t index, int i, int j);  // i, j inside the texture
// Where a hit falls on a texture of w x h cells of side 1, (0, 0) at its first corner: texel centres lie on +-3 sigma.
glm::dvec2 texelPosition(glm::dvec2 uv, int width, int height);

// What the hits of a pixel add up to over the background, not clamped.
glm::dvec3 colorOf(const std::vector<PixelHit>& hits, glm::vec3 background);
double lightLeft(const std::vector<PixelHit>& hits);  // behind the last of them, [0, 1]

// The inspected pixel as JSON (docs/viewer.md).
std::string formatInspection(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                             glm::ivec2 pixel, const std::vector<PixelHit>& hits);

}  // namespace tg
