// SPDX-License-Identifier: Apache-2.0
// Walks a checked glTF scene: where every mesh and camera stands.
#include "converter/gltf/nodes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "converter/gltf/axes.h"

namespace tg {
namespace {

constexpr double kNodeTolerance = 1e-4;  // relative: transforms written as floats, several levels deep

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
    if (!(glm::length(q) > 0.0)) throw document.bad(nodePointer(index) + "/rotation", "the quaternion has no length");
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

// Nothing when the matrix is more than `scale`, a rotation and a translation: `wrong` then says so. `bent`: what it
// does whose axes are neither at right angles nor of one length.
std::optional<RigidScale> decomposeAs(const glm::dmat4& m, const std::string& bent, const std::string& scale,
                                      std::string& wrong) {
  RigidScale result;
  result.identity = m == glm::dmat4(1.0);
  if (result.identity) return result;
  const auto fail = [&](const std::string& what) {
    wrong = "the transform " + what + " (expected " + scale + ", a rotation and a translation)";
    return std::nullopt;
  };
  glm::dmat3 linear(m);
  result.translation = glm::dvec3(m[3]);
  double determinant = glm::determinant(linear), unit = 1.0;
  if (std::abs(determinant) < std::numeric_limits<double>::min()) {  // the product of three lengths may leave doubles
    double largest = 0.0;
    for (int k = 0; k < 9; ++k) largest = std::max(largest, std::abs(linear[k / 3][k % 3]));
    if (largest > 0.0) unit = std::ldexp(1.0, std::ilogb(largest));
    linear /= unit;
    determinant = glm::determinant(linear);
  }
  bool finite = std::isfinite(determinant);
  for (int k = 0; k < 16; ++k) finite = finite && std::isfinite(m[k / 4][k % 4]);
  if (!finite) return fail("is not finite");
  if (!(determinant > 0.0)) return fail("mirrors or flattens");
  const double scale_in_units = std::cbrt(determinant);
  result.scale = unit * scale_in_units;
  result.rotation = linear / scale_in_units;
  const glm::dmat3 product = glm::transpose(result.rotation) * result.rotation;
  for (int k = 0; k < 9; ++k) {
    const double expected = k / 3 == k % 3 ? 1.0 : 0.0;
    if (std::abs(product[k / 3][k % 3] - expected) > kNodeTolerance) return fail(bent);
  }
  if (m[0][3] != 0.0 || m[1][3] != 0.0 || m[2][3] != 0.0 || m[3][3] != 1.0) return fail("is projective");
  return result;
}

}  // namespace

std::string nodePointer(int node) { return "/nodes/" + std::to_string(node); }

std::vector<PlacedNode> placeNodes(const GltfDocument& document, const glm::dmat4& world_from_scene) {
  std::vector<PlacedNode> placed;
  std::vector<bool> seen(document.model.nodes.size(), false);
  const auto add = [&](int node, const glm::dmat4& parent) {
    if (seen[node]) throw document.bad(nodePointer(node), "the node is reached twice (expected a tree)");
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
  return decomposeAs(m, "shears or stretches", "a uniform scale", wrong);
}

RigidScale decomposeStretched(const GltfDocument& document, const PlacedNode& placed) {
  const std::string bent = "shears", scale = "a scale per axis";
  std::string wrong;
  if (const std::optional<RigidScale> rigid = decomposeAs(placed.world_from_node, bent, scale, wrong)) return *rigid;
  const glm::dmat3 linear(placed.world_from_node);
  const glm::dvec3 lengths(glm::length(linear[0]), glm::length(linear[1]), glm::length(linear[2]));
  std::optional<RigidScale> result;
  if (std::isfinite(lengths.x + lengths.y + lengths.z) && std::min({lengths.x, lengths.y, lengths.z}) > 0.0) {
    glm::dmat4 rest = placed.world_from_node;
    for (int axis = 0; axis < 3; ++axis) rest[axis] /= lengths[axis];
    result = decomposeAs(rest, bent, scale, wrong);
  }
  if (!result) throw document.bad(nodePointer(placed.node), wrong);
  result->scale = std::cbrt(lengths.x) * std::cbrt(lengths.y) * std::cbrt(lengths.z);  // no product beyond doubles
  result->stretch = lengths / result->scale;
  result->identity = false;
  return *result;
}

glm::dvec3 principalAxes(glm::dmat3 axes, glm::dmat3& rotation) {
  // One-sided Jacobi rotations: thin axes keep their digits, which a covariance's eigenvalues would lose.
  constexpr int kMostSweeps = 30;
  constexpr double kOrthogonal = 1e-15;
  for (int sweep = 0, turned = 1; sweep < kMostSweeps && turned != 0; ++sweep) {
    turned = 0;
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      const double pp = glm::dot(axes[p], axes[p]), qq = glm::dot(axes[q], axes[q]), pq = glm::dot(axes[p], axes[q]);
      if (!(std::abs(pq) > kOrthogonal * std::sqrt(pp) * std::sqrt(qq))) continue;
      const double zeta = (qq - pp) / (2.0 * pq);
      const double tangent = std::copysign(1.0, zeta) / (std::abs(zeta) + std::hypot(1.0, zeta));
      const double cosine = 1.0 / std::hypot(1.0, tangent), sine = cosine * tangent;
      const glm::dvec3 first = axes[p];
      axes[p] = cosine * first - sine * axes[q];
      axes[q] = sine * first + cosine * axes[q];
      ++turned;
    }
  }
  std::array<glm::dvec3, 3> longest = {axes[0], axes[1], axes[2]};
  std::ranges::sort(longest, std::greater(), [](const glm::dvec3& axis) { return glm::dot(axis, axis); });
  const glm::dvec3 lengths(glm::length(longest[0]), glm::length(longest[1]), glm::length(longest[2]));
  rotation = glm::dmat3(1.0);
  if (lengths[0] > 0.0) rotation[0] = longest[0] / lengths[0];
  glm::dvec3 other = longest[1];
  if (!(lengths[1] > 0.0)) {  // any that is not along the first
    other = glm::dvec3(0.0);
    const glm::dvec3 size = glm::abs(rotation[0]);
    other[size.x <= size.y && size.x <= size.z ? 0 : size.y <= size.z ? 1 : 2] = 1.0;
  }
  other /= std::max({std::abs(other.x), std::abs(other.y), std::abs(other.z)});
  rotation[1] = glm::normalize(other - glm::dot(other, rotation[0]) * rotation[0]);
  rotation[2] = glm::cross(rotation[0], rotation[1]);
  return lengths;
}

}  // namespace tg
