// SPDX-License-Identifier: Apache-2.0
// Vertex attributes of a checked glTF document as floats.
#include "converter/gltf/accessor.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>
#include <type_traits>

#include "core/system/assert.h"

namespace tg {
namespace {

constexpr std::size_t kReadBlock = 4096;  // splats whose bytes are read at once

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

struct StorageType {
  Storage storage;
  int component_type;
  bool normalized;
  std::string_view name;
  void (*decode)(const unsigned char* from, std::size_t stride, std::size_t count, int components, bool normalized,
                 float* to);
};
constexpr std::array<StorageType, 9> kStorages = {{
    {kFloat, TINYGLTF_COMPONENT_TYPE_FLOAT, false, "float", decode<float>},
    {kByte, TINYGLTF_COMPONENT_TYPE_BYTE, false, "byte", decode<std::int8_t>},
    {kUnsignedByte, TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, false, "ubyte", decode<std::uint8_t>},
    {kShort, TINYGLTF_COMPONENT_TYPE_SHORT, false, "short", decode<std::int16_t>},
    {kUnsignedShort, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, false, "ushort", decode<std::uint16_t>},
    {kByteNormalized, TINYGLTF_COMPONENT_TYPE_BYTE, true, "normalised byte", decode<std::int8_t>},
    {kUnsignedByteNormalized, TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, true, "normalised ubyte", decode<std::uint8_t>},
    {kShortNormalized, TINYGLTF_COMPONENT_TYPE_SHORT, true, "normalised short", decode<std::int16_t>},
    {kUnsignedShortNormalized, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, true, "normalised ushort",
     decode<std::uint16_t>},
}};

std::string typeName(int components) {
  return components == 1 ? std::string("SCALAR") : "VEC" + std::to_string(components);
}

std::string describe(const AttributeRule& rule) {
  std::string text = typeName(rule.components) + " of ";
  bool first = true;
  for (const StorageType& s : kStorages) {
    if ((rule.storage & s.storage) == 0) continue;
    text += (first ? "" : " / ") + std::string(s.name);
    first = false;
  }
  return text;
}

// The storage of an accessor; kStorages.end() for unsigned int, which attributes never use.
const StorageType* storageOf(const tinygltf::Accessor& accessor) {
  const bool normalized = accessor.normalized && accessor.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT;
  return std::find_if(kStorages.begin(), kStorages.end(), [&](const StorageType& s) {
    return s.component_type == accessor.componentType && s.normalized == normalized;
  });
}

void putSparse(const GltfDocument& document, const tinygltf::Accessor& accessor, const StorageType& storage,
               const std::string& pointer, int components, SplatRange range, std::vector<float>& values) {
  const auto& sparse = accessor.sparse;
  const std::size_t element =
      static_cast<std::size_t>(components) * tinygltf::GetComponentSizeInBytes(accessor.componentType);
  const std::size_t count = static_cast<std::size_t>(sparse.count);
  const auto index_bytes = static_cast<std::size_t>(
      tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(sparse.indices.componentType)));
  std::vector<std::uint8_t> indices(count * index_bytes);
  document.read(sparse.indices.bufferView, sparse.indices.byteOffset, indices);
  std::vector<std::uint8_t> from(count * element);
  document.read(sparse.values.bufferView, sparse.values.byteOffset, from);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint32_t target = 0;  // its lower bytes are the stored ones
    std::memcpy(&target, indices.data() + i * index_bytes, index_bytes);
    if (target >= accessor.count) {
      throw document.bad(pointer, "sparse index " + std::to_string(i) + " is out of range (expected below " +
                                      std::to_string(accessor.count) + ", found " + std::to_string(target) + ")");
    }
    if (target < range.first || target - range.first >= range.count) continue;
    storage.decode(from.data() + i * element, element, 1, components, storage.normalized,
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
  const StorageType* storage = storageOf(accessor);
  const int components = tinygltf::GetNumComponentsInType(accessor.type);
  const bool matrix = accessor.type >= TINYGLTF_TYPE_MAT2 && accessor.type <= TINYGLTF_TYPE_MAT4;
  if (matrix || components != rule.components || storage == kStorages.end() || (rule.storage & storage->storage) == 0) {
    throw document.bad(pointer, "wrong type (expected " + describe(rule) + ", found " +
                                    (matrix ? "a matrix" : typeName(components)) + " of " +
                                    (storage == kStorages.end() ? "uint" : std::string(storage->name)) + ")");
  }
  if (accessor.count != splats.count) {
    throw document.bad(pointer, "the count differs from POSITION's" + expectedFound(splats.count, accessor.count));
  }
  std::vector<float> values(range.count * components);  // zeros, where the accessor has no view
  if (accessor.bufferView >= 0) {
    const tinygltf::BufferView& view = document.model.bufferViews[accessor.bufferView];
    const std::size_t element =
        static_cast<std::size_t>(components) * tinygltf::GetComponentSizeInBytes(accessor.componentType);
    const std::size_t stride = view.byteStride != 0 ? view.byteStride : element;
    std::vector<std::uint8_t> bytes;
    for (std::size_t i = 0; i < range.count; i += kReadBlock) {
      const std::size_t count = std::min(kReadBlock, range.count - i);
      bytes.resize((count - 1) * stride + element);  // the last one may end with the view
      document.read(accessor.bufferView, accessor.byteOffset + (range.first + i) * stride, bytes);
      storage->decode(bytes.data(), stride, count, components, storage->normalized, values.data() + i * components);
    }
  }
  if (accessor.sparse.isSparse) putSparse(document, accessor, *storage, pointer, components, range, values);
  return values;
}

std::vector<float> readAttribute(const GltfDocument& document, const SplatPrimitive& splats,
                                 const AttributeRule& rule) {
  return readAttribute(document, splats, rule, {0, splats.count});
}

}  // namespace tg
