// SPDX-License-Identifier: Apache-2.0
// Whether a glTF file names the extensions that it uses.
#include "converter/gltf/extension_lists.h"

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <set>

#include "converter/gltf/document.h"
#include "converter/gltf/json_members.h"
#include "converter/gltf/resolve.h"
#include "converter/gltf/spz_extension.h"

namespace tg {
namespace {

using nlohmann::json;

constexpr const char* kQuantization = "KHR_mesh_quantization";

// Names under "extensions" anywhere but in what is an application's own.
void collect(const json& value, std::set<std::string>& used) {
  if (value.is_object()) {
    const json& extensions = member(value, "extensions");
    if (extensions.is_object()) {
      for (const auto& [name, extension] : extensions.items()) used.insert(name);
    }
    for (const auto& [key, child] : value.items()) {
      if (key != "extras") collect(child, used);
    }
  } else if (value.is_array()) {
    for (const json& child : value) collect(child, used);
  }
}

// Whether a mesh that is no splats' has integers where glTF alone wants floats; of splats reading says it.
bool quantized(const json& root, bool of_splats) {
  for (const json& mesh : list(root, "meshes")) {
    for (const json& primitive : list(mesh, "primitives")) {
      if (!of_splats && member(primitive, "extensions").contains(kSplatExtension)) continue;
      for (const char* name : {"POSITION", "NORMAL", "TANGENT"}) {
        const json& accessor = member(member(primitive, "attributes"), name);
        if (accessor.is_null()) continue;
        if (list(root, "accessors")[accessor.get<std::size_t>()]["componentType"] != TINYGLTF_COMPONENT_TYPE_FLOAT)
          return true;
      }
    }
  }
  return false;
}

// The codec of a view whose plain bytes are nowhere; null: none.
const char* indispensableCodec(const json& root) {
  const json& buffers = list(root, "buffers");
  for (const json& view : list(root, "bufferViews")) {
    const char* codec = codecOf(view);
    if (codec == nullptr) continue;
    const json& index = member(view, "buffer");  // which no reader needs
    if (!index.is_number_unsigned() || index.get<std::uint64_t>() >= buffers.size()) continue;
    const json& buffer = buffers[index.get<std::size_t>()];
    if (codecOf(buffer) != nullptr && !buffer.contains("uri")) return codec;
  }
  return nullptr;
}

}  // namespace

void checkExtensionLists(const json& root, std::vector<std::string>& errors, std::vector<std::string>& warnings) {
  const auto error = [&](const std::string& pointer, const std::string& what) {
    errors.push_back(printable(pointer + ": " + what));
  };
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    const json& names = member(root, key);
    const std::string pointer = std::string("/").append(key);
    if (!names.is_array()) continue;
    if (names.empty()) error(pointer, "is empty (expected at least one element, or no such key)");
    if (std::set<json>(names.begin(), names.end()).size() != names.size()) error(pointer, "names something twice");
  }
  const json &used = list(root, "extensionsUsed"), &required = list(root, "extensionsRequired");
  const std::set<json> listed(used.begin(), used.end()), needed(required.begin(), required.end());
  std::set<std::string> found;
  collect(root, found);
  if (quantized(root, false)) found.insert(kQuantization);
  for (const std::string& name : found) {
    if (!listed.contains(name)) error("/extensionsUsed", shortened(name) + " is used and not listed");
  }
  for (std::size_t i = 0; i < required.size(); ++i) {
    if (listed.contains(required[i])) continue;
    error("/extensionsRequired/" + std::to_string(i), "is required and not listed in extensionsUsed");
  }
  if (const char* codec = indispensableCodec(root); codec != nullptr && !needed.contains(codec)) {
    error("/extensionsRequired", std::string(codec) + " packs what is nowhere else and is not listed");
  }
  if (listed.contains(kQuantization) && !needed.contains(kQuantization) && quantized(root, true)) {
    error("/extensionsRequired", std::string(kQuantization) + " is used and not listed");
  }
  for (const std::string_view extension : {kSplatExtension, kTextureExtension}) {
    if (!needed.contains(std::string(extension)) || needed.contains(std::string(kSpzExtension))) continue;
    warnings.push_back("/extensionsRequired: " + std::string(extension) +
                       " is listed: loaders that could show the rest refuse the file");
  }
}

}  // namespace tg
