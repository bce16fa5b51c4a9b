// SPDX-License-Identifier: Apache-2.0
// Vertex attributes of a checked glTF document as floats.
#include "converter/gltf/accessor.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string_view>
#include <type_traits>

#include "core/system/assert.h"

namespace tg {
namespace {

constexpr std::size_t kReadBlock = 4096;  // splats whose bytes are read at once

struct StorageName {
  Storage storage;
  int component_type;
  bool normalized;
  std::string_view name;
};
constexpr std::array<StorageName, 9> kStorages = {{
    {kFloat, TINYGLTF_COMPONENT_TYPE_FLOAT, false, "float"},
    {kByte, TINYGLTF_COMPONENT_TYPE_BYTE, false, "byte"},
    {kUnsignedByte, TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, false, "ubyte"},
    {kShort, TINYGLTF_COMPONENT_TYPE_SHORT, false, "short"},
    {kUnsignedShort, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, false, "ushort"},
    {kByteNormalized, TINYGLTF_COMPONENT_TYPE_BYTE, true, "normalised byte"},
    {kUnsignedByteNormalized, TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, true, "normalised ubyte"},
    {kShortNormalized, TINYGLTF_COMPONENT_TYPE_SHORT, true, "normalised short"},
    {kUnsignedShortNormalized, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, true, "normalised ushort"},
}};

std::string typeName(int components) {
  return components == 1 ? std::string("SCALAR") : "VEC" + std::to_string(components);
}

std::string describe(const AttributeRule& rule) {
  std::string text = typeName(rule.components) + " of ";
  bool first = true;
  for (const StorageName& s : kStorages) {
    if ((rule.storage & s.storage) == 0) continue;
    text += (first ? "" : " / ") + std::string(s.name);
    first = false;
  }
  return text;
}

// The storage of an accessor; kStorages.end() for unsigned int, which attributes never use.
const StorageName* storageOf(const tinygltf::Accessor& accessor) {
  const bool normalized = accessor.normalized && accessor.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT;
  return std::find_if(kStorages.begin(), kStorages.end(), [&](const StorageName& s) {
    return s.component_type == accessor.componentType && s.normalized == normalized;
  });
}

// glTF 2.0, 3.11: signed values below -1 after the division are clamped.
template <typename T>
float toFloat(T value, bool normalized) {
  if constexpr (std::is_same_v<T, float>) return value;
  const float f = static_cast<float>(value);
  return normalized ? std::max(f / static_cast<float>(std::numeric_limits<T>::max()), -1.0f) : f;
}

template <typename T>
void decode(const unsigned char* from, std::size_t stride, std::size_t count, int components, bool normalized,
            float* to) {
  for (std::size_t i = 0; i < count; ++i) {
    for (int c = 0; c < components; ++c) {
      T value;
      std::memcpy(&value, from + i * stride + c * sizeof(T), sizeof(T));
      *to++ = toFloat(value, normalized);
    }
  }
}

void decodeAs(int component_type, const unsigned char* from, std::size_t stride, std::size_t count, int components,
              bool normalized, float* to) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return decode<std::int8_t>(from, stride, count, components, normalized, to);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return decode<std::uint8_t>(from, stride, count, components, normalized, to);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return decode<std::int16_t>(from, stride, count, components, normalized, to);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return decode<std::uint16_t>(from, stride, count, components, normalized, to);
    default:
      return decode<float>(from, stride, count, components, normalized, to);
  }
}

std::size_t sparseIndex(int component_type, const unsigned char* from, std::size_t i) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return from[i];
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
      std::uint16_t index;
      std::memcpy(&index, from + i * sizeof(index), sizeof(index));
      return index;
    }
    default: {
      std::uint32_t index;
      std::memcpy(&index, from + i * sizeof(index), sizeof(index));
      return index;
    }
  }
}

void putSparse(const GltfDocument& document, const tinygltf::Accessor& accessor, const std::string& pointer,
               int components, SplatRange range, std::vector<float>& values) {
  const auto& sparse = accessor.sparse;
  const std::size_t element =
      static_cast<std::size_t>(components) * tinygltf::GetComponentSizeInBytes(accessor.componentType);
  const std::size_t count = static_cast<std::size_t>(sparse.count);
  std::vector<std::uint8_t> indices(count * static_cast<std::size_t>(tinygltf::GetComponentSizeInBytes(
                                                static_cast<std::uint32_t>(sparse.indices.componentType))));
  document.read(sparse.indices.bufferView, sparse.indices.byteOffset, indices);
  std::vector<std::uint8_t> from(count * element);
  document.read(sparse.values.bufferView, sparse.values.byteOffset, from);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t target = sparseIndex(sparse.indices.componentType, indices.data(), i);
    if (target >= accessor.count) {
      throw document.bad(pointer, "sparse index " + std::to_string(i) + " is out of range (expected below " +
                                      std::to_string(accessor.count) + ", found " + std::to_string(target) + ")");
    }
    if (target < range.first || target - range.first >= range.count) continue;
    decodeAs(accessor.componentType, from.data() + i * element, element, 1, components, accessor.normalized,
             values.data() + (target - range.first) * components);
  }
}

}  // namespace

std::vector<float> readAttribute(const GltfDocument& document, const SplatPrimitive& splats, const AttributeRule& rule,
                                 SplatRange range) {
  TG_ASSERT(range.first + range.count <= splats.count, "the primitive has these splats");
  TG_ASSERT(rule.components == 1 || rule.components == 3 || rule.components == 4,
            "an attribute is SCALAR, VEC3 or VEC4");
  const auto found = splats.primitive->attributes.find(rule.semantic);
  if (found == splats.primitive->attributes.end()) {
    throw document.bad(splats.pointer + "/attributes", "the attribute " + rule.semantic + " is missing");
  }
  const std::string pointer = splats.pointer + "/attributes/" + rule.semantic;
  const tinygltf::Accessor& accessor = document.model.accessors[found->second];
  const StorageName* storage = storageOf(accessor);
  const int components = tinygltf::GetNumComponentsInType(accessor.type);
  const bool matrix = accessor.type >= TINYGLTF_TYPE_MAT2 && accessor.type <= TINYGLTF_TYPE_MAT4;
  if (matrix || components != rule.components || storage == kStorages.end() || (rule.storage & storage->storage) == 0) {
    throw document.bad(pointer, "wrong type (expected " + describe(rule) + ", found " +
                                    (matrix ? "a matrix" : typeName(components)) + " of " +
                                    (storage == kStorages.end() ? "uint" : std::string(storage->name)) + ")");
  }
  if (accessor.count != splats.count) {
    throw document.bad(pointer, "the count differs from POSITION's (expected " + std::to_string(splats.count) +
                                    ", found " + std::to_string(accessor.count) + ")");
  }
  // An accessor without a view means zeros: a few bytes of JSON that ask for gigabytes.
  if (accessor.bufferView < 0) throw document.bad(pointer, "the accessor has no bufferView");

  std::vector<float> values(range.count * components);
  const tinygltf::BufferView& view = document.model.bufferViews[accessor.bufferView];
  const std::size_t element =
      static_cast<std::size_t>(components) * tinygltf::GetComponentSizeInBytes(accessor.componentType);
  const std::size_t stride = view.byteStride != 0 ? view.byteStride : element;
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i < range.count; i += kReadBlock) {
    const std::size_t count = std::min(kReadBlock, range.count - i);
    bytes.resize((count - 1) * stride + element);  // the last one may end with the view
    document.read(accessor.bufferView, accessor.byteOffset + (range.first + i) * stride, bytes);
    decodeAs(accessor.componentType, bytes.data(), stride, count, components, accessor.normalized,
             values.data() + i * components);
  }
  if (accessor.sparse.isSparse) putSparse(document, accessor, pointer, components, range, values);
  return values;
}

std::vector<float> readAttribute(const GltfDocument& document, const SplatPrimitive& splats,
                                 const AttributeRule& rule) {
  return readAttribute(document, splats, rule, {0, splats.count});
}

}  // namespace tg
