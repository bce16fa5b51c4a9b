// SPDX-License-Identifier: Apache-2.0
// Cameras as glTF camera nodes, and back.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <vector>

#include "converter/gltf/document.h"
#include "converter/gltf/nodes.h"
#include "core/model/camera.h"

namespace tg {

// The key in `extras` under which this toolchain keeps what glTF has no word for.
inline constexpr const char* kExtrasKey = "textured_gaussians";

// Appends one camera and one node per camera and lists the nodes in scene 0. The vertical field of view and the pose
// are glTF's; image size, focal lengths, principal point and split go to the node's extras.
void addCameras(nlohmann::ordered_json& root, std::span<const Camera> cameras);

// A list of cameras that are no nodes, for asset.extras: name, translation and rotation as of a node, and what its
// extras hold but the split.
nlohmann::ordered_json listViews(std::span<const Camera> views);
// And back, of a scene that stands at `world_from_scene`: those that are whole; `skipped` counts the others.
std::vector<Camera> readViews(const tinygltf::Value& list, const RigidScale& world_from_scene, std::size_t& skipped);

// The camera of a node. Files of other programs know no image size: 720 rows then. Nothing, with a warning, for an
// orthographic camera and for a pose that is not rigid.
std::optional<Camera> readCamera(GltfDocument& document, const PlacedNode& placed);

}  // namespace tg
