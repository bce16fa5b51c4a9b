// SPDX-License-Identifier: Apache-2.0
// Checks a glTF file's JSON before a library that trusts its numbers gets it.
#include "converter/gltf/document_check.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string_view>

#include "converter/gltf/document.h"
#include "converter/gltf/gltf_json.h"
#include "converter/gltf/spz_extension.h"
#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {
namespace {

using nlohmann::json;

constexpr std::uint64_t kMaxCount = std::uint64_t{1} << 32;  // of accessor elements: keeps every product below 2^64
constexpr std::array<std::string_view, 6> kIgnoredExtensions = {"KHR_lights_punctual",   "EXT_lights_image_based",
                                                                "KHR_texture_transform", "KHR_xmp",
                                                                "KHR_xmp_json_ld",       "KHR_animation_pointer"};
constexpr std::string_view kIgnoredMaterials = "KHR_materials_";
constexpr std::array<std::string_view, 7> kSupportedExtensions = {
    kSplatExtension,           kTextureExtension,        kSpzExtension, kWebpExtension, "KHR_mesh_quantization",
    "EXT_meshopt_compression", "KHR_meshopt_compression"};

// The elements of a top-level array of objects; none when the key is absent.
std::vector<JsonNode> elements(const JsonNode& root, const char* key) {
  std::vector<JsonNode> nodes;
  if (!root.has(key)) return nodes;
  const JsonNode list = root.at(key).array();
  nodes.reserve(list.size());
  for (std::size_t i = 0; i < list.size(); ++i) nodes.push_back(list.element(i).object());
  return nodes;
}

std::size_t countOf(const JsonNode& root, const char* key) { return root.has(key) ? root.at(key).array().size() : 0; }

void checkExtensions(const JsonNode& root) {
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    if (!root.has(key)) continue;
    const JsonNode list = root.at(key).array();
    for (std::size_t i = 0; i < list.size(); ++i) {
      const std::string extension = list.element(i).string();
      if (key == std::string_view("extensionsRequired") && !isKnownExtension(extension)) {
        list.element(i).fail("the file requires " + extension + ", which this reader does not support");
      }
    }
  }
}

// Those that the library keeps whole.
bool isSize(std::string_view key) { return key == "byteLength" || key == "byteOffset" || key == "count"; }

// Members that are the file's own or read as decimals, for which no file has to be written anew.
constexpr std::array<std::string_view, 8> kNoIntegers = {"extras",      "min",      "max",   "matrix",
                                                         "translation", "rotation", "scale", "weights"};

// Whole numbers that are written as decimals become integers, within the limits of cutInteger(); whether there was one.
bool makeIntegers(json& value, std::string_view key) {
  bool made = false;
  if (value.is_number_float()) {
    const double number = value.get<double>();
    constexpr double kExact = 0x1p53, kLeast = std::numeric_limits<std::int32_t>::min(),
                     kMost = std::numeric_limits<std::int32_t>::max();
    made = number == std::floor(number) && number >= kLeast && (isSize(key) ? number < kExact : number <= kMost);
    if (made && number < 0.0) value = static_cast<std::int64_t>(number);
    if (made && number >= 0.0) value = static_cast<std::uint64_t>(number);
  } else if (value.is_array()) {
    for (json& element : value) made |= makeIntegers(element, {});
  } else if (value.is_object()) {
    for (auto member = value.begin(); member != value.end(); ++member) {
      if (std::ranges::count(kNoIntegers, member.key()) == 0) made |= makeIntegers(*member, member.key());
    }
  }
  return made;
}

// tinygltf cuts integers to 32 bits without a word: the first that it would cut, and its place below `value`; null:
// none. Sizes are exempt: it keeps them whole.
const json* cutInteger(const json& value, std::string& place) {
  const auto below = [&](const json& child, const auto& key) {
    const json* found = cutInteger(child, place);
    if (found != nullptr) place.insert(0, "/" + key());
    return found;
  };
  if (value.is_number_integer()) {
    const bool fits = value.is_number_unsigned()
                          ? value.get<std::uint64_t>() <= std::uint64_t{std::numeric_limits<std::int32_t>::max()}
                          : value.get<std::int64_t>() >= std::numeric_limits<std::int32_t>::min();
    return fits ? nullptr : &value;
  }
  if (value.is_array()) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      if (const json* found = below(value[i], [&] { return std::to_string(i); })) return found;
    }
  } else if (value.is_object()) {
    for (auto member = value.begin(); member != value.end(); ++member) {
      const std::string& key = member.key();
      if (key == "extras" || isSize(key)) continue;
      if (key == "extensions" && member->is_object()) {
        for (const std::string_view ours : {kSplatExtension, kTextureExtension}) {
          const auto extension = member->find(std::string(ours));
          if (extension == member->end()) continue;
          if (const json* found = below(*extension, [&] { return key + "/" + std::string(ours); })) return found;
        }
      } else if (const json* found = below(*member, [&] { return key; })) {
        return found;
      }
    }
  }
  return nullptr;
}

void checkIntegers(const JsonNode& root) {
  std::string place;
  if (const json* found = cutInteger(root.value, place)) {
    const JsonNode node{*found, root.path, place};
    node.fail("integer out of range" + expectedFound("at most 32 bits", node.shown()));
  }
}

struct View {
  std::uint64_t bytes = 0;
  std::uint64_t stride = 0;  // 0: tightly packed
};

std::vector<std::uint64_t> checkBuffers(const JsonNode& root, const GltfParts& parts) {
  std::vector<std::uint64_t> sizes;
  for (const JsonNode& buffer : elements(root, "buffers")) {
    const std::uint64_t bytes = buffer.at("byteLength").size64();
    if (buffer.has("uri")) {
      const std::string uri = buffer.at("uri").string();
      if (!tinygltf::IsDataURI(uri)) {
        buffer.at("uri").fail("external buffers are not read" +
                              expectedFound("a GLB or a base64 data URI", buffer.at("uri").shown()));
      }
      if (const std::uint64_t most = dataUriBytes(uri); bytes > most) {
        buffer.at("byteLength")
            .fail("more than the data URI holds" +
                  expectedFound("at most " + std::to_string(most), std::to_string(bytes)));
      }
    } else {
      if (!parts.binary || !sizes.empty() || !parts.bin_bytes) buffer.fail("has neither a uri nor a BIN chunk");
      if (bytes > *parts.bin_bytes) {
        buffer.at("byteLength")
            .fail("leaves the BIN chunk" +
                  expectedFound("at most " + std::to_string(*parts.bin_bytes), std::to_string(bytes)));
      }
    }
    sizes.push_back(bytes);
  }
  return sizes;
}

std::vector<View> checkViews(const JsonNode& root, const std::vector<std::uint64_t>& buffers) {
  std::vector<View> views;
  for (const JsonNode& view : elements(root, "bufferViews")) {
    const std::uint64_t buffer = view.at("buffer").index(buffers.size(), "buffer");
    const std::uint64_t offset = view.size64("byteOffset", 0);
    const std::uint64_t bytes = view.at("byteLength").size64();
    const std::uint64_t stride = view.size64("byteStride", 0);
    if (bytes == 0) view.at("byteLength").fail("the view is empty" + expectedFound("at least 1", "0"));
    if (offset > buffers[buffer] || bytes > buffers[buffer] - offset) {
      view.fail("leaves buffer " + std::to_string(buffer) +
                expectedFound("at most " + std::to_string(buffers[buffer]) + " bytes",
                              std::to_string(offset) + " + " + std::to_string(bytes)));
    }
    if (view.has("byteStride") && (stride < 4 || stride > 252 || stride % 4 != 0)) {
      view.at("byteStride").fail("wrong stride" + expectedFound("a multiple of 4 in [4, 252]", std::to_string(stride)));
    }
    views.push_back({bytes, stride});
  }
  return views;
}

void checkRange(const JsonNode& where, const View& view, std::uint64_t offset, std::uint64_t count,
                std::uint64_t element, std::uint64_t stride) {
  const std::uint64_t bytes = (count - 1) * stride + element;  // count < 2^32, stride < 2^8: no overflow
  if (offset > view.bytes || bytes > view.bytes - offset) {
    where.fail("leaves its bufferView" + expectedFound("at most " + std::to_string(view.bytes) + " bytes",
                                                       std::to_string(offset) + " + " + std::to_string(bytes)));
  }
}

void checkSparse(const JsonNode& sparse, const std::vector<View>& views, std::uint64_t count, std::uint64_t element) {
  const std::uint64_t substitutes = sparse.at("count").size64();
  if (substitutes == 0 || substitutes > count) {
    sparse.at("count").fail("wrong count" +
                            expectedFound("1 to " + std::to_string(count), std::to_string(substitutes)));
  }
  const JsonNode indices = sparse.at("indices").object();
  const std::uint64_t type = indices.at("componentType").size64();
  if (type != 5121 && type != 5123 && type != 5125) {
    indices.at("componentType").fail("wrong type" + expectedFound("5121, 5123 or 5125", std::to_string(type)));
  }
  for (const auto& [part, bytes] :
       {std::pair{indices, std::uint64_t(componentBytes(type))}, std::pair{sparse.at("values").object(), element}}) {
    const std::uint64_t offset = part.size64("byteOffset", 0);
    if (offset > std::uint64_t{std::numeric_limits<std::int32_t>::max()}) part.at("byteOffset").fail("too large");
    checkRange(part, views[part.at("bufferView").index(views.size(), "bufferView")], offset, substitutes, bytes, bytes);
  }
}

void checkAccessors(const JsonNode& root, const std::vector<View>& views) {
  for (const JsonNode& accessor : elements(root, "accessors")) {
    const std::uint64_t component_type = accessor.at("componentType").size64();
    const int component = componentBytes(component_type);
    if (component == 0) {
      accessor.at("componentType")
          .fail("no component type of glTF" + expectedFound("5120 to 5126", std::to_string(component_type)));
    }
    const int components = componentCount(accessor.at("type").string());
    if (components == 0) {
      accessor.at("type").fail("no accessor type of glTF" +
                               expectedFound("SCALAR, VEC2, VEC3, VEC4 or MAT2 to MAT4", accessor.at("type").shown()));
    }
    const std::uint64_t count = accessor.at("count").size64();
    if (count == 0 || count >= kMaxCount) {
      accessor.at("count").fail("wrong count" +
                                expectedFound("1 to " + std::to_string(kMaxCount - 1), std::to_string(count)));
    }
    const std::uint64_t element = static_cast<std::uint64_t>(component) * components;
    if (accessor.has("bufferView")) {
      const View& view = views[accessor.at("bufferView").index(views.size(), "bufferView")];
      const std::uint64_t offset = accessor.size64("byteOffset", 0);
      const std::uint64_t stride = view.stride != 0 ? view.stride : element;
      if (stride < element) {
        accessor.fail("elements overlap" +
                      expectedFound("a byteStride of at least " + std::to_string(element), std::to_string(stride)));
      }
      if (offset % component != 0) {
        accessor.at("byteOffset")
            .fail("not aligned" + expectedFound("a multiple of " + std::to_string(component), std::to_string(offset)));
      }
      checkRange(accessor, view, offset, count, element, stride);
    }
    if (accessor.has("sparse")) checkSparse(accessor.at("sparse").object(), views, count, element);
  }
}

// Each image's bytes are copied, wherever they lie. `stored`: bytes of all buffers.
void checkImages(const JsonNode& root, const std::vector<View>& views, std::uint64_t stored) {
  const std::uint64_t most = std::max(std::uint64_t{64} << 20, 4 * stored);
  std::uint64_t total = 0;
  for (const JsonNode& image : elements(root, "images")) {
    if (image.has("uri") == image.has("bufferView")) image.fail("needs either a uri or a bufferView");
    if (image.has("bufferView")) {
      const View& view = views[image.at("bufferView").index(views.size(), "bufferView")];
      if (view.bytes > std::uint64_t{std::numeric_limits<std::int32_t>::max()}) image.fail("is larger than 2 GiB");
      total += view.bytes;
      if (total > most) image.fail("the images take more than the buffers hold" + atMost(most, total));
    } else if (!tinygltf::IsDataURI(image.at("uri").string())) {
      image.at("uri").fail("external images are not read" +
                           expectedFound("a bufferView or a base64 data URI", image.at("uri").shown()));
    }
  }
  const std::size_t images = countOf(root, "images");
  for (const JsonNode& texture : elements(root, "textures")) {
    if (texture.has("source")) texture.at("source").index(images, "image");
    const std::string webp(kWebpExtension);
    if (!texture.has("extensions") || !texture.at("extensions").object().has(webp.c_str())) continue;
    texture.at("extensions").at(webp).object().at("source").index(images, "image");
  }
}

void checkMeshes(const JsonNode& root) {
  const std::size_t accessors = countOf(root, "accessors");
  for (const JsonNode& mesh : elements(root, "meshes")) {
    const JsonNode primitives = mesh.at("primitives").array();
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      const JsonNode primitive = primitives.element(p).object();
      const JsonNode attributes = primitive.at("attributes").object();
      for (const auto& [name, unused] : attributes.value.items()) {
        attributes.at(name).index(accessors, "accessor");
      }
      if (primitive.has("indices")) primitive.at("indices").index(accessors, "accessor");
      if (primitive.has("mode")) primitive.at("mode").size64();
      if (primitive.has("extensions")) primitive.at("extensions").object();
    }
  }
}

void checkNodes(const JsonNode& root) {
  const std::size_t nodes = countOf(root, "nodes");
  const std::size_t meshes = countOf(root, "meshes");
  const std::size_t cameras = countOf(root, "cameras");
  for (const JsonNode& node : elements(root, "nodes")) {
    if (node.has("mesh")) node.at("mesh").index(meshes, "mesh");
    if (node.has("camera")) node.at("camera").index(cameras, "camera");
    if (node.has("matrix")) node.at("matrix").expectNumbers(16);
    if (node.has("translation")) node.at("translation").expectNumbers(3);
    if (node.has("rotation")) node.at("rotation").expectNumbers(4);
    if (node.has("scale")) node.at("scale").expectNumbers(3);
    if (!node.has("children")) continue;
    const JsonNode children = node.at("children").array();
    for (std::size_t i = 0; i < children.size(); ++i) children.element(i).index(nodes, "node");
  }
  for (const JsonNode& scene : elements(root, "scenes")) {
    if (!scene.has("nodes")) continue;
    const JsonNode roots = scene.at("nodes").array();
    for (std::size_t i = 0; i < roots.size(); ++i) roots.element(i).index(nodes, "node");
  }
  if (root.has("scene")) root.at("scene").index(countOf(root, "scenes"), "scene");
}

void checkVersion(const JsonNode& root) {
  const JsonNode version = root.at("asset").object().at("version");
  if (version.string().substr(0, 2) != "2.") {
    version.fail("another version of glTF" + expectedFound("2.x", version.shown()));
  }
  if (!root.at("asset").has("minVersion")) return;
  const JsonNode needed = root.at("asset").at("minVersion");
  if (needed.value.is_string() && versionOf(needed.string()) > std::pair{2u, 0u}) {
    needed.fail("another version of glTF is needed" + expectedFound("at most 2.0", needed.shown()));
  }
}

}  // namespace

std::optional<std::pair<std::uint32_t, std::uint32_t>> versionOf(std::string_view text) {
  std::pair<std::uint32_t, std::uint32_t> version;
  const char *at = text.data(), *end = at + text.size();
  const auto number = [&](std::uint32_t& to) {
    const auto [next, problem] = std::from_chars(at, end, to);
    at = next;
    return problem == std::errc();
  };
  if (!number(version.first) || at == end || *at++ != '.' || !number(version.second) || at != end) return std::nullopt;
  return version;
}

bool isKnownExtension(std::string_view name) {
  return std::ranges::count(kSupportedExtensions, name) + std::ranges::count(kIgnoredExtensions, name) > 0 ||
         name.starts_with(kIgnoredMaterials);
}

int componentBytes(std::uint64_t component_type) {
  constexpr std::array<int, 7> bytes = {1, 1, 2, 2, 0, 4, 4};  // from 5120 on
  return component_type >= 5120 && component_type - 5120 < bytes.size() ? bytes[component_type - 5120] : 0;
}

int componentCount(std::string_view type) {
  constexpr std::array<std::pair<std::string_view, int>, 7> types = {
      {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}}};
  for (const auto& [name, count] : types) {
    if (type == name) return count;
  }
  return 0;
}

std::uint64_t dataUriBytes(std::string_view uri) {
  constexpr std::string_view kBase64 = ";base64,";
  const std::size_t at = uri.find(kBase64);
  if (!uri.starts_with("data:") || at == std::string_view::npos) return 0;
  uri.remove_prefix(at + kBase64.size());
  for (int padding = 0; padding < 2 && uri.ends_with('='); ++padding) uri.remove_suffix(1);
  return uri.size() * 3 / 4;  // 4 characters for 3 bytes
}

GltfJson parseGltfJson(std::span<const std::uint8_t> text, const std::string& path) {
  if (text.size() > kMaxJsonBytes) {
    throw Error(ErrorKind::badData, path,
                "the JSON text is too long" +
                    expectedFound("at most " + std::to_string(kMaxJsonBytes) + " bytes", std::to_string(text.size())));
  }
  GltfJson parsed;
  parsed.root = parseJson(
      text, path,
      {"the JSON text is broken: ",
       "the JSON text nests too deep" + expectedFound("at most " + std::to_string(kMaxJsonDepth) + " levels", "more")});
  parsed.rewritten = makeIntegers(parsed.root, {});
  return parsed;
}

void checkGltfJson(const json& value, const GltfParts& parts, const std::string& path) {
  const JsonNode root = JsonNode{value, path, "/"}.object();
  checkVersion(root);
  checkExtensions(root);
  checkIntegers(root);
  const std::vector<std::uint64_t> buffers = checkBuffers(root, parts);
  const std::vector<View> views = checkViews(root, buffers);
  checkAccessors(root, views);
  checkImages(root, views, std::accumulate(buffers.begin(), buffers.end(), std::uint64_t{0}));
  checkMeshes(root);
  checkNodes(root);
  elements(root, "cameras");
}

}  // namespace tg
