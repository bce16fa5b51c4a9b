// SPDX-License-Identifier: Apache-2.0
// Walks a checked glTF scene: where every mesh and camera stands.
#include "converter/gltf/nodes.h"

#include <algorithm>
#include <cmath>

#include "converter/gltf/axes.h"

namespace tg {
namespace {

constexpr double kNodeTolerance = 1e-4;  // relative: transforms written as floats, several levels deep

std::string pointerOf(int node) { return "/nodes/" + std::to_string(node); }

glm::dmat4 localMatrix(const GltfDocument& document, int index) {
  const tinygltf::Node& node = document.model.nodes[index];
  glm::dmat4 m(1.0);
  if (node.matrix.size() == 16) {
    for (int k = 0; k < 16; ++k) m[k / 4][k % 4] = node.matrix[k];
    return m;
  }
  glm::dmat3 linear(1.0);
  if (node.rotation.size() == 4) {
    const glm::dvec4 q(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
    if (!(glm::length(q) > 0.0)) throw document.bad(pointerOf(index) + "/rotation", "the quaternion has no length");
    linear = matrixFromQuaternion(q);
  }
  if (node.scale.size() == 3) {
    for (int axis = 0; axis < 3; ++axis) linear[axis] *= node.scale[axis];
  }
  m = glm::dmat4(linear);
  if (node.translation.size() == 3) {
    m[3] = glm::dvec4(node.translation[0], node.translation[1], node.translation[2], 1.0);
  }
  return m;
}

std::vector<int> rootNodes(const tinygltf::Model& model) {
  if (!model.scenes.empty()) return model.scenes[std::max(model.defaultScene, 0)].nodes;
  std::vector<bool> child(model.nodes.size(), false);
  for (const tinygltf::Node& node : model.nodes) {
    for (const int c : node.children) child[c] = true;
  }
  std::vector<int> roots;
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    if (!child[i]) roots.push_back(static_cast<int>(i));
  }
  return roots;
}

}  // namespace

std::vector<PlacedNode> placeNodes(const GltfDocument& document, const glm::dmat4& world_from_scene) {
  std::vector<PlacedNode> placed;
  std::vector<bool> seen(document.model.nodes.size(), false);
  const auto add = [&](int node, const glm::dmat4& parent) {
    if (seen[node]) throw document.bad(pointerOf(node), "the node is reached twice (expected a tree)");
    seen[node] = true;
    placed.push_back({node, parent * localMatrix(document, node)});
  };
  for (const int root : rootNodes(document.model)) add(root, world_from_scene);
  for (std::size_t next = 0; next < placed.size(); ++next) {
    const PlacedNode parent = placed[next];  // a copy: add() moves the vector
    for (const int child : document.model.nodes[parent.node].children) add(child, parent.world_from_node);
  }
  return placed;
}

std::optional<RigidScale> decompose(const glm::dmat4& m, std::string& wrong) {
  RigidScale result;
  result.identity = m == glm::dmat4(1.0);
  if (result.identity) return result;
  const auto fail = [&](const std::string& what) {
    wrong = what + " (expected a uniform scale, a rotation and a translation)";
    return std::nullopt;
  };
  const glm::dmat3 linear(m);
  result.translation = glm::dvec3(m[3]);
  const double determinant = glm::determinant(linear);
  bool finite = std::isfinite(determinant);
  for (int k = 0; k < 16; ++k) finite = finite && std::isfinite(m[k / 4][k % 4]);
  if (!finite) return fail("the transform is not finite");
  if (!(determinant > 0.0)) return fail("the transform mirrors or flattens");
  result.scale = std::cbrt(determinant);
  result.rotation = linear / result.scale;
  const glm::dmat3 product = glm::transpose(result.rotation) * result.rotation;
  for (int k = 0; k < 9; ++k) {
    const double expected = k / 3 == k % 3 ? 1.0 : 0.0;
    if (std::abs(product[k / 3][k % 3] - expected) > kNodeTolerance) return fail("the transform shears or stretches");
  }
  if (m[0][3] != 0.0 || m[1][3] != 0.0 || m[2][3] != 0.0 || m[3][3] != 1.0) return fail("the transform is projective");
  return result;
}

RigidScale decompose(const GltfDocument& document, const PlacedNode& placed) {
  std::string wrong;
  const std::optional<RigidScale> result = decompose(placed.world_from_node, wrong);
  if (!result) throw document.bad(pointerOf(placed.node), wrong);
  return *result;
}

}  // namespace tg
