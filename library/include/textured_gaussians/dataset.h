// SPDX-License-Identifier: Apache-2.0
// Photographs with known cameras, to train on or to compare with.
#pragma once
#include <array>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "textured_gaussians/camera.h"
#include "textured_gaussians/image.h"

namespace textured_gaussians {

struct DatasetOptions {
  int downscale = 1;  // 1 to 64: photographs are reduced by a box filter
  // RGB behind transparent photographs; without one: the data set's own, else white for NeRF-synthetic, else black. An
  // evaluation without one goes over the model's (evaluate.h).
  std::optional<std::array<float, 3>> background = {};
  int test_every = 8;  // every n-th photograph by name is held out, where the data set has no split; 0: none; not 1
  // Cameras and points are moved and scaled, of scenes that are small or far from the origin: a model of them is of
  // that world, which a line of warnings() says how to leave. An evaluation wants the same.
  bool normalize = false;
};

// Does not change: copies share its memory. One that was moved from is still the same.
class Dataset {
 public:
  Dataset(const Dataset&) = default;
  Dataset& operator=(const Dataset&) = default;
  // A NeRF-synthetic, instant-ngp / nerfstudio or COLMAP folder (docs/training.md), which is read from there later,
  // too, whatever the working folder is by then. Throws Error: cannotRead, badData, usage for options out of range.
  static Dataset load(const std::filesystem::path& folder, const DatasetOptions& options = {});

  std::size_t size() const;  // photographs
  // [size()], those to train on first; Camera::test says which are held out.
  std::vector<Camera> cameras() const;
  std::array<float, 3> background() const;
  // What reading it passed over or took otherwise than it was listed, such as photographs that are missing: a line
  // each.
  std::vector<std::string> warnings() const;
  // [height, width, 3] over the background. Throws Error(usage) for an index beyond size(), and what reading the file
  // throws.
  Image photograph(std::size_t index) const;

 private:
  friend struct Access;
  struct Parts;
  explicit Dataset(std::shared_ptr<const Parts> parts) : parts_(std::move(parts)) {}
  std::shared_ptr<const Parts> parts_;
};

}  // namespace textured_gaussians
