// SPDX-License-Identifier: Apache-2.0
// Walks a checked glTF scene: where every mesh and camera stands.
#pragma once
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "converter/gltf/document.h"

namespace tg {

struct PlacedNode {
  int node = 0;
  glm::dmat4 world_from_node{1.0};
};

// The nodes of the default scene (of all root nodes when there is none), parents first, in a scene that stands at
// `world_from_scene`. Throws Error(badData) when nodes form a cycle or a node has two parents.
std::vector<PlacedNode> placeNodes(const GltfDocument& document, const glm::dmat4& world_from_scene = glm::dmat4(1.0));

// A uniform scale, then a rotation, then a translation: what splats and their textures can follow.
struct RigidScale {
  glm::dvec3 stretch{1.0};  // of the local axes, before the rest: other than 1 as decomposeStretched() alone has it
  double scale = 1.0;
  glm::dmat3 rotation{1.0};
  glm::dvec3 translation{0.0};
  bool identity = true;
};
// Nothing when the matrix shears, mirrors or scales axes differently: `wrong` then says so.
std::optional<RigidScale> decompose(const glm::dmat4& m, std::string& wrong);
// The same with axes that may be scaled differently. Throws Error(badData) with the node where the matrix shears,
// mirrors, flattens or has a perspective.
RigidScale decomposeStretched(const GltfDocument& document, const PlacedNode& placed);

// Shapes a splat's linear transform of its unit axes [scales along the columns]: the scales that are left, longest
// first, and a rotation whose columns are their directions.
glm::dvec3 principalAxes(glm::dmat3 axes, glm::dmat3& rotation);

std::string nodePointer(int node);

}  // namespace tg
