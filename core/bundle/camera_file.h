// SPDX-License-Identifier: Apache-2.0
// cameras.json, which INRIA's viewers share.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/model/camera.h"

namespace tg {

inline constexpr std::int64_t kMaxCameraSide = 1 << 20;      // [px]
inline constexpr std::uint64_t kMaxCamerasBytes = 32 << 20;  // about 50,000 cameras

// INRIA layout: [{id, img_name, width, height, position, rotation (world from camera, rows), fx, fy}], plus our
// optional cx, cy, split ("train" / "test") and translation (camera from world: survives files exactly, which -R *
// position does not); cx, cy default to the image centre. Throws Error(badData) with index and key.
std::vector<Camera> parseCameras(const std::string& json, const std::string& path);
std::string formatCameras(const std::vector<Camera>& cameras);
// The same for a file of a model at `path`, which names it in errors. Throws Error(cannotWrite) for what no reader
// would take, by its size or by what it says.
std::string storedCameras(const std::vector<Camera>& cameras, const std::string& path);
std::vector<Camera> readCameras(const std::filesystem::path& path);

}  // namespace tg
