// SPDX-License-Identifier: Apache-2.0
// What is wrong with a glTF file although reading it gets by.
#include "converter/gltf/overlooked.h"

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "converter/gltf/document.h"
#include "converter/gltf/document_check.h"

namespace tg {
namespace {

using nlohmann::json;

bool lists(const json& root, const char* key, std::string_view extension) {
  const json list = root.value(key, json::array());
  return std::find(list.begin(), list.end(), json(std::string(extension))) != list.end();
}

// glTF: elements of attributes start at multiples of 4 bytes.
void checkAlignment(const json& root, std::size_t index, std::vector<std::string>& errors) {
  const json& accessor = root["accessors"][index];
  if (!accessor.contains("bufferView")) return;
  const json& view = root["bufferViews"][accessor["bufferView"].get<std::size_t>()];
  const std::string type = accessor["type"].get<std::string>();
  if (type.rfind("MAT", 0) == 0) return;  // no splat attribute
  const std::uint64_t element = std::uint64_t(componentBytes(accessor["componentType"].get<std::uint64_t>())) *
                                static_cast<std::uint64_t>(componentCount(type));
  const std::uint64_t stride = view.value("byteStride", element);
  const std::uint64_t offset =
      accessor.value("byteOffset", std::uint64_t{0}) + view.value("byteOffset", std::uint64_t{0});
  if (offset % 4 == 0 && stride % 4 == 0) return;
  errors.push_back("/accessors/" + std::to_string(index) +
                   ": elements of an attribute do not start at multiples of 4 bytes (found offset " +
                   std::to_string(offset) + ", stride " + std::to_string(stride) + ")");
}

}  // namespace

void findOverlooked(const std::filesystem::path& path, std::vector<std::string>& errors,
                    std::vector<std::string>& warnings) {
  const json root = readGltfJson(path);
  const std::string khr(kSplatExtension), ours(kTextureExtension);
  bool textured = false;
  for (const json& mesh : root.value("meshes", json::array())) {
    for (const json& primitive : mesh["primitives"]) {
      const json extensions = primitive.value("extensions", json::object());
      if (!extensions.contains(khr)) continue;
      const json nested = extensions[khr].value("extensions", json::object());
      textured = textured || nested.contains(ours);
      for (const auto& [semantic, accessor] : primitive["attributes"].items()) {
        checkAlignment(root, accessor.get<std::size_t>(), errors);
      }
    }
  }
  for (const std::string& extension : {khr, ours}) {
    if ((extension == khr || textured) && !lists(root, "extensionsUsed", extension)) {
      errors.push_back("/extensionsUsed: " + extension + " is used and not listed");
    }
    if (lists(root, "extensionsRequired", extension)) {
      warnings.push_back("/extensionsRequired: " + extension +
                         " is listed: loaders that could show the rest refuse the file");
    }
  }
}

}  // namespace tg
