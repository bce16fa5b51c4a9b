// SPDX-License-Identifier: Apache-2.0
// Vertex attributes of a checked glTF document as floats.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "converter/gltf/document.h"

namespace tg {

// How an attribute may be stored: a bit per component type, and the same again for its normalised form.
enum Storage : unsigned {
  kFloat = 1u << 0,
  kByte = 1u << 1,
  kUnsignedByte = 1u << 2,
  kShort = 1u << 3,
  kUnsignedShort = 1u << 4,
  kByteNormalized = 1u << 5,
  kUnsignedByteNormalized = 1u << 6,
  kShortNormalized = 1u << 7,
  kUnsignedShortNormalized = 1u << 8,
};

struct AttributeRule {
  std::string semantic;
  int components = 1;  // 1 = SCALAR, 3 = VEC3, 4 = VEC4
  unsigned storage = kFloat;
};

// A primitive, and where it is in the file.
struct SplatPrimitive {
  const tinygltf::Primitive* primitive = nullptr;
  std::string pointer;    // "/meshes/0/primitives/0"
  std::size_t count = 0;  // of POSITION: every attribute's

  bool has(const std::string& semantic) const { return primitive->attributes.count(semantic) != 0; }
};

// A run of a primitive's splats.
struct SplatRange {
  std::size_t first = 0;
  std::size_t count = 0;
};

// Of the splats of `range`: [range.count * components], normalised integers mapped to [0, 1] or [-1, 1], sparse values
// put in place over those of the accessor's view or over zeros. splats.count must be what the file has bytes for.
// Throws Error(badData): missing semantic, wrong type, another count.
std::vector<float> readAttribute(const GltfDocument& document, const SplatPrimitive& splats, const AttributeRule& rule,
                                 SplatRange range);
// Of all splats.
std::vector<float> readAttribute(const GltfDocument& document, const SplatPrimitive& splats, const AttributeRule& rule);

}  // namespace tg
