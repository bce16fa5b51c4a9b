// SPDX-License-Identifier: Apache-2.0
// Data sets as folders that dataset.h reads.
#pragma once
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/bundle/ply.h"
#include "core/model/camera.h"
#include "training/data/dataset.h"

namespace tg {

// An entry of `frames`: file_path and the camera-to-world matrix in OpenGL axes.
nlohmann::json transformsFrame(const Camera& camera, const std::string& file_path);

// Binary PLY of x, y, z (float) and red, green, blue (uchar). Throws Error(cannotWrite).
void writePoints(const std::filesystem::path& path, const PointCloud& points);

// `write`s `files`, which are names below `folder`. Where that throws, those that were not there before go again, and
// so do their folders and a new `folder` where nothing else is in them. Throws Error(cannotWrite), also where another
// call writes into `folder` meanwhile.
void writeAllOrNone(const std::filesystem::path& folder, std::vector<std::string> files,
                    const std::function<void()>& write);

// What training sees of a data set - pinholes, downscaled - in nerfstudio's layout: transforms.json with each frame's
// intrinsics, the split and a background that is not black, images/NAME.png, masks/NAME.png where pixels do not count,
// points3d.ply. NAME is that of the photograph without its extension, below train/ or test/ where one has the name of
// both, numbered where two would be the same. Transparency stays where the data set was loaded with random_background.
// Throws Error(cannotWrite), and when `folder` holds a data set already. Without `overwrite` it is then as it was.
void writeDataset(const std::filesystem::path& folder, const Dataset& dataset, bool overwrite);

}  // namespace tg
