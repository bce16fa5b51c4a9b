// SPDX-License-Identifier: Apache-2.0
// What other people's viewers open, and what they do with a splat, as numbers, each read from the viewer's own sources.
#pragma once
#include <span>
#include <string_view>

#include "core/system/names.h"

namespace tg {

enum class SplatViewer : unsigned { three, playcanvas, babylon, cesium, spark };
constexpr auto namesOf(SplatViewer) { return enumNames("three", "playcanvas", "babylon", "cesium", "spark"); }

// By what a viewer sorts.
enum class ViewerOrder {
  depth,        // camera z
  sphereBins,   // camera z in 4,095 bins over the depths of the sphere around all splats
  cameraRadius  // distance from the camera
};

// All of them project affinely: the mean by the camera, the covariance by the camera's derivative at the mean.
struct ViewerProfile {
  std::string_view program;       // with the version that was read
  std::string_view source;        // where the numbers stand
  float blur = 0;                 // [px^2] added to both variances on the screen
  bool compensated = false;       // the opacity pays for the blur: times the root of the determinants' ratio
  float least_variance = 0;       // [px^2] of the shorter axis
  float cut = 0;                  // [sigma] nothing is drawn beyond
  bool square = false;            // the cut is a square along the ellipse's axes, not the ellipse
  bool lifted = false;            // the falloff at the cut is taken off, so that it ends in 0
  float most_reach = 0;           // [px] from the mean to the cut; longer axes become shorter
  bool reach_in_picture = false;  // and never more than the picture's shorter side
  float least_reach = 0;          // [px] both axes reach less: not drawn
  float guard = 0;        // means beyond so many half pictures from the middle are not drawn; 0: those that reach in
  float near = 0;         // [world units] means nearer are not drawn
  float least_alpha = 0;  // less is not drawn
  bool premultiplied = false;  // colours above white count where alpha is low
  ViewerOrder order = ViewerOrder::depth;
  // What its own loaders open of what the toolchain writes, by the names of converter/registry/file_format.h.
  std::span<const std::string_view> opens;
  bool opens_meshopt = true;  // .glb and .gltf packed by EXT_meshopt_compression
  int newest_spz = 4;         // version
};

const ViewerProfile& profileOf(SplatViewer viewer);

}  // namespace tg
