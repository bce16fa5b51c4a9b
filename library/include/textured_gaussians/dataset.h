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

// Photographs in memory, N of them, and P points.
struct DatasetData {
  std::vector<ByteImage> images;  // [N], of 1 channel, too
  std::vector<Camera> cameras;    // [N], each of its image's size; their names are the photographs'
  // [N] of 1 channel, each of its image's size or empty for none: where it is 0 the pixel is neither trained on nor
  // scored. Or no mask at all.
  std::vector<ByteImage> masks;
  std::vector<float> points;  // [P, 3] [world units]; none: training starts from random ones
  std::vector<float> colors;  // [P, 3] RGB from 0 to 1, of the points; or empty: grey
  // RGB behind images of 4 channels; without one: black, and an evaluation goes over the model's (evaluate.h).
  std::optional<std::array<float, 3>> background = {};
  int test_every = 8;  // every n-th photograph by name is held out, where no camera is a Camera::test; 0: none; not 1
};

// Does not change: copies share its memory. One that was moved from is still the same.
class Dataset {
 public:
  Dataset(const Dataset&) = default;
  Dataset& operator=(const Dataset&) = default;
  // As of a folder with these photographs as PNGs: trainings and evaluations have the same bytes, and the order is by
  // name, those to train on first, without names as given. Keeps 3 bytes a pixel, 4 more of an image of 4 channels and
  // 1 of a mask. Throws Error(badData) naming the member, or the image by its place, whose length, size or numbers are
  // wrong, also where none is to train on; Error(usage) for cameras that are none and values out of range.
  explicit Dataset(DatasetData data);
  // A NeRF-synthetic, instant-ngp / nerfstudio or COLMAP folder (docs/training.md), which is read from there later,
  // too, whatever the working folder is by then. Throws Error: cannotRead, badData, usage for options out of range.
  static Dataset load(const std::filesystem::path& folder, const DatasetOptions& options = {});

  std::size_t size() const;  // photographs
  // [size()], those to train on first; Camera::test says which are held out.
  std::vector<Camera> cameras() const;
  std::array<float, 3> background() const;
  // What reading it passed over or took otherwise than it was listed, such as photographs that are missing, and images
  // that are ByteImage::above_white: a line each.
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
