// SPDX-License-Identifier: Apache-2.0
// COLMAP's camera models (its src/colmap/sensor/models.h).
#pragma once
#include <array>
#include <cstddef>
#include <string_view>

namespace tg {

// `parameters` are, in a file's order: f one focal length, x and y two, c the principal point, then Lens's k, d, p, t
// in their order, o the FOV model's angle.
struct ColmapCameraModel {
  std::string_view name;
  const char* parameters;  // null: not supported
  std::size_t count;
  bool fisheye = false;
};
// By id.
inline constexpr std::array<ColmapCameraModel, 18> kColmapCameraModels = {
    {{"SIMPLE_PINHOLE", "fcc", 3},
     {"PINHOLE", "xycc", 4},
     {"SIMPLE_RADIAL", "fcck", 4},
     {"RADIAL", "fcckk", 5},
     {"OPENCV", "xycckkpp", 8},
     {"OPENCV_FISHEYE", "xycckkkk", 8, true},
     {"FULL_OPENCV", "xycckkppkddd", 12},
     {"FOV", "xycco", 5},
     {"SIMPLE_RADIAL_FISHEYE", "fcck", 4, true},
     {"RADIAL_FISHEYE", "fcckk", 5, true},
     {"THIN_PRISM_FISHEYE", "xycckkppkktt", 12, true},
     {"RAD_TAN_THIN_PRISM_FISHEYE", nullptr, 16, true},
     {"SIMPLE_DIVISION", nullptr, 4},
     {"DIVISION", nullptr, 5},
     {"SIMPLE_FISHEYE", "fcc", 3, true},
     {"FISHEYE", "xycc", 4, true},
     {"EUCM", nullptr, 6},
     {"EQUIRECTANGULAR", nullptr, 2}}};

}  // namespace tg
