// SPDX-License-Identifier: Apache-2.0
// The list of a Gaussian's parameters: declared and named here alone, walked everywhere else.
#pragma once
#include <cstddef>
#include <glm/glm.hpp>
#include <vector>

namespace tg {

// What every Gaussian has, each parameter in a Column of its type: models hold vectors, Adam holds pairs of moments,
// the CUDA trainer buffers of the device. A column has one value a Gaussian, that of `sh` has K.
template <template <typename> class Column>
struct GaussianFields {
  Column<glm::vec3> mean;       // [world units]
  Column<glm::vec4> rotation;   // quaternion w, x, y, z in .x .y .z .w; any length > 0
  Column<glm::vec3> log_scale;  // ln(sigma)
  Column<float> opacity_logit;  // opacity = sigmoid(logit)
  Column<glm::vec3> sh;         // rgb, coefficient k of Gaussian i at i * K + k
  bool operator==(const GaussianFields&) const = default;
};

struct Field {
  const char* name;
  unsigned floats;          // of a value
  bool quaternion = false;  // its length must not be 0
  bool harmonic = false;    // K values a Gaussian
  constexpr std::size_t values(std::size_t k) const { return harmonic ? k : 1; }  // of a Gaussian, where K = k
  constexpr std::size_t row(std::size_t k) const { return floats * values(k); }   // floats of a Gaussian, where K = k
};

// Calls visit(field, set's member...) for every parameter, the sets side by side: forEachField(visit, model, moments).
// Whatever has members of these names is a set.
template <typename Visit, typename... Sets>
constexpr void forEachField(const Visit& visit, Sets&... sets) {
  visit(Field{"mean", 3}, sets.mean...);
  visit(Field{"rotation", 4, true}, sets.rotation...);
  visit(Field{"log_scale", 3}, sets.log_scale...);
  visit(Field{"opacity_logit", 1}, sets.opacity_logit...);
  visit(Field{"sh", 3, false, true}, sets.sh...);
}

constexpr std::size_t kFieldCount = [] {
  std::size_t count = 0;
  forEachField([&](const Field&) { ++count; });
  return count;
}();
// Floats of a Gaussian, without texels.
constexpr std::size_t gaussianFloats(std::size_t k) {
  std::size_t floats = 0;
  forEachField([&](const Field& field) { floats += field.row(k); });
  return floats;
}
template <typename T>
using One = T;
static_assert(sizeof(GaussianFields<One>) == gaussianFloats(1) * sizeof(float), "forEachField() visits every member");

// The same with the texels of the whole model, for what has a number for every number of a model.
template <template <typename> class Column>
struct ModelFields : GaussianFields<Column> {
  Column<glm::vec4> texels;
  bool operator==(const ModelFields&) const = default;
};
template <typename Set>
auto& texelsOf(Set& set) {
  if constexpr (requires { set.atlas.texels; }) {
    return set.atlas.texels;
  } else {
    return set.texels;
  }
}
// forEachField(), then visit(field of the texels, ...).
template <typename Visit, typename... Sets>
void forEachParameter(const Visit& visit, Sets&... sets) {
  forEachField(visit, sets...);
  visit(Field{"texels", 4}, texelsOf(sets)...);
}

// ---- Columns
template <typename T>
using Values = std::vector<T>;

template <typename T>
struct DoubleOf {
  using Type = double;
};
template <glm::length_t L>
struct DoubleOf<glm::vec<L, float>> {
  using Type = glm::vec<L, double>;
};
template <typename T>
using DoubleValues = std::vector<typename DoubleOf<T>::Type>;

}  // namespace tg
