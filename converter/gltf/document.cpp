// SPDX-License-Identifier: Apache-2.0
// A glTF or GLB file whose every index, offset and count has been checked.
#include "converter/gltf/document.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <nlohmann/json.hpp>
#include <set>

#include "converter/formats/little_endian.h"
#include "converter/gltf/container.h"
#include "converter/gltf/document_check.h"
#include "converter/gltf/gltf_json.h"
#include "converter/gltf/json_members.h"
#include "converter/gltf/resolve.h"
#include "converter/gltf/spz_extension.h"
#include "core/file/json.h"
#include "core/system/assert.h"

namespace tg {
namespace {

using nlohmann::json;

// The library would want the bytes of buffers and images; what follows says nothing of splats.
constexpr std::array<std::string_view, 5> kLeftOut = {"buffers", "images", "materials", "animations", "skins"};

// tinygltf hands over an image's encoded bytes; they are kept as they are.
bool keepEncoded(tinygltf::Image* image, int, std::string*, std::string*, int, int, const unsigned char* bytes,
                 int size, void*) {
  image->image.assign(bytes, bytes + size);
  return true;
}

// Nothing outside the file exists.
tinygltf::FsCallbacks noFiles() {
  tinygltf::FsCallbacks none{};
  none.FileExists = [](const std::string&, void*) { return false; };
  none.ExpandFilePath = [](const std::string& path, void*) { return path; };
  none.ReadWholeFile = [](std::vector<unsigned char>*, std::string*, const std::string&, void*) { return false; };
  none.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&, void*) {
    return false;
  };
  return none;
}

void parse(tinygltf::Model& model, const std::string& path, bool binary, std::span<const std::uint8_t> bytes) {
  tinygltf::TinyGLTF loader;
  loader.SetImageLoader(keepEncoded, nullptr);
  loader.SetFsCallbacks(noFiles());
  std::string error;
  std::string warning;
  const auto size = static_cast<unsigned>(bytes.size());
  bool ok = false;
  try {
    ok = binary ? loader.LoadBinaryFromMemory(&model, &error, &warning, bytes.data(), size)
                : loader.LoadASCIIFromString(&model, &error, &warning, reinterpret_cast<const char*>(bytes.data()),
                                             size, "");
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  constexpr std::size_t kLongestReason = 400;  // it may quote a data URI
  if (error.size() > kLongestReason) error = error.substr(0, kLongestReason) + " ...";
  if (!ok) throw Error(ErrorKind::badData, path, "no valid glTF: " + error);
}

// The same for a document's JSON, less `keys` at its top.
void parseWithout(tinygltf::Model& model, const std::string& path, json& root, std::span<const std::string_view> keys) {
  std::vector<std::pair<std::string, json>> kept;
  for (const std::string_view key : keys) {
    const auto found = root.find(std::string(key));
    if (found == root.end()) continue;
    kept.emplace_back(key, std::move(*found));
    root.erase(found);
  }
  const std::string text = root.dump(-1, ' ', false, json::error_handler_t::replace);
  for (auto& [key, value] : kept) root[key] = std::move(value);
  parse(model, path, false, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

// The start of a GLB up to the content of its BIN chunk, where that is its last chunk; else nothing.
std::vector<std::uint8_t> headOf(const FileReader& file) {
  constexpr std::uint64_t kHeaders = kGlbHeaderBytes + 2 * kChunkHeaderBytes;
  if (file.size() <= kHeaders) return {};
  std::vector<std::uint8_t> head(kGlbHeaderBytes + kChunkHeaderBytes);
  file.read(0, head);
  const std::uint64_t json_bytes = readU32(head, kGlbHeaderBytes);
  if (std::memcmp(head.data(), "glTF", 4) != 0 || json_bytes > kMaxJsonBytes || kHeaders + json_bytes > file.size()) {
    return {};
  }
  head.resize(static_cast<std::size_t>(kHeaders + json_bytes));
  file.read(0, head);
  if (head.size() + readU32(head, head.size() - kChunkHeaderBytes) != file.size()) return {};
  return head;
}

bool isGlb(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 4 && std::memcmp(bytes.data(), "glTF", 4) == 0;
}

GltfParts partsOf(std::span<const std::uint8_t> bytes, const std::string& path) {
  GltfParts parts;
  parts.json = bytes;
  return isGlb(bytes) ? splitGlb(bytes, bytes.size(), path) : parts;
}

GltfJson parseJsonOf(std::span<const std::uint8_t> bytes, const std::string& path) {
  return parseGltfJson(partsOf(bytes, path).json, path);
}

// A file of the same parts whose JSON is `root`.
std::vector<std::uint8_t> withJson(const json& root, std::span<const std::uint8_t> bytes, const std::string& path) {
  const std::string text = root.dump(-1, ' ', false, json::error_handler_t::replace);
  const GltfParts parts = partsOf(bytes, path);
  if (parts.bin_bytes.value_or(0) == 0) return {text.begin(), text.end()};
  return glbOf(text,
               bytes.subspan(static_cast<std::size_t>(parts.bin_offset), static_cast<std::size_t>(*parts.bin_bytes)),
               path);
}

// Resolves and checks what was parsed of `bytes`; where that is no longer their JSON, they are those of `made` then.
void check(GltfJson& parsed, std::span<const std::uint8_t>& bytes, std::vector<std::uint8_t>& made,
           const std::string& path, const std::optional<std::filesystem::path>& folder, bool splats_alone) {
  if (auto resolved = resolveGltf(parsed.root, bytes, partsOf(bytes, path), folder, path, splats_alone)) {
    bytes = made = std::move(*resolved);
  } else if (parsed.rewritten) {
    bytes = made = withJson(parsed.root, bytes, path);
  }
  checkGltfJson(parsed.root, partsOf(bytes, path), path);
}

// Where they stand in a checked document.
std::vector<std::string> hollowLayers(const json& root) {
  std::vector<std::string> found;
  const json none = json::array();
  const auto member = [&](const json& object, std::string_view key) -> const json& {
    const auto at = object.is_object() ? object.find(std::string(key)) : object.end();
    return at == object.end() ? none : *at;
  };
  std::size_t m = 0;
  for (const json& mesh : member(root, "meshes")) {
    std::size_t p = 0;
    for (const json& primitive : member(mesh, "primitives")) {
      const json& extensions = member(member(member(primitive, "extensions"), kSplatExtension), "extensions");
      const auto layer = extensions.is_object() ? extensions.find(std::string(kTextureExtension)) : extensions.end();
      if (layer != extensions.end() && (!layer->is_object() || layer->empty())) {
        found.push_back("/meshes/" + std::to_string(m) + "/primitives/" + std::to_string(p) + "/extensions/" +
                        std::string(kSplatExtension) + "/extensions/" + std::string(kTextureExtension));
      }
      ++p;
    }
    ++m;
  }
  return found;
}

// Notes wrong_types and spz_views of a checked document.
void noteExtensions(const json& root, GltfDocument& document) {
  const auto shown = [](const json& value) { return JsonNode{value, "", ""}.shown(); };
  const json& meshes = list(root, "meshes");
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    std::size_t p = 0;
    for (const json& primitive : list(meshes[m], "primitives")) {
      const std::string at = "/meshes/" + std::to_string(m) + "/primitives/" + std::to_string(p++);
      const std::string pointer = at + "/extensions/" + std::string(kSplatExtension);
      const json& extensions = member(primitive, "extensions");
      if (!extensions.is_object() || !extensions.contains(kSplatExtension)) continue;
      const json& splatting = extensions[std::string(kSplatExtension)];
      if (!splatting.is_object()) document.wrong_types.emplace(pointer, shown(splatting));
      for (const char* key : kKhronosNames) {
        if (!splatting.is_object() || !splatting.contains(key) || splatting[key].is_string()) continue;
        document.wrong_types.emplace(pointer + "/" + key, shown(splatting[key]));
      }
      const json& inner = member(splatting, "extensions");
      if (!inner.is_object() || !inner.contains(kSpzExtension)) continue;
      const json& spz = inner[std::string(kSpzExtension)];
      const bool named = spz.is_object() && spz.contains("bufferView");
      document.spz_views.emplace(at, named ? shown(spz["bufferView"]) : "none");
    }
  }
}

// What a checked document has that changes how its splats look and is not read.
std::vector<std::string> unreadOf(const json& root) {
  std::vector<std::string> found;
  const auto add = [&](const std::string& pointer, const std::string& what) {
    found.push_back(printable(shortened(pointer) + ": " + shortened(what)));
  };
  const json& used = list(root, "extensionsUsed");
  for (std::size_t i = 0; i < used.size(); ++i) {
    const std::string& name = used[i].get_ref<const std::string&>();
    if (!isKnownExtension(name)) {
      add("/extensionsUsed/" + std::to_string(i), name + " is not supported: what it says is left out");
    }
  }
  if (!list(root, "animations").empty()) add("/animations", "left out: the scene stands as at rest");
  std::set<std::size_t> of_splats;
  const json& meshes = list(root, "meshes");
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    std::size_t p = 0;
    for (const json& primitive : list(meshes[m], "primitives")) {
      const std::string pointer = "/meshes/" + std::to_string(m) + "/primitives/" + std::to_string(p++);
      if (!member(primitive, "extensions").contains(kSplatExtension)) continue;
      of_splats.insert(m);
      if (primitive.contains("targets")) add(pointer + "/targets", "morph targets are left out");
    }
  }
  std::size_t n = 0;
  for (const json& node : list(root, "nodes")) {
    const std::string pointer = "/nodes/" + std::to_string(n++);
    if (!node.contains("skin") || !node.contains("mesh") || !of_splats.contains(node["mesh"].get<std::size_t>())) {
      continue;
    }
    add(pointer + "/skin", "left out: the splats stand as at rest");
    break;  // others would say the same
  }
  return found;
}

// Of parsed.root, which has been parsed and nothing else.
GltfDocument load(GltfJson& parsed, std::span<const std::uint8_t> bytes, const std::string& path,
                  const std::optional<std::filesystem::path>& folder, bool splats_alone) {
  GltfDocument document;
  document.path = path;
  std::vector<std::uint8_t> made;
  if (needsResolving(parsed.root)) parsed.stored = parsed.root;
  check(parsed, bytes, made, path, folder, splats_alone);
  document.hollow_layers = hollowLayers(parsed.root);
  noteExtensions(parsed.root, document);
  document.unread = unreadOf(parsed.root);
  const GltfParts parts = partsOf(bytes, path);
  const bool binary = parts.bin_bytes.value_or(0) > 0;  // else the library wants no container
  parse(document.model, path, binary, binary ? bytes : parts.json);
  return document;
}

std::filesystem::path folderOf(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

// A data URI is the library's to decode.
bool holdsUris(const json& root) {
  const auto has_uri = [](const json& object) { return object.contains("uri"); };
  return std::ranges::any_of(std::array{"buffers", "images"}, [&](const char* list) {
    return root.contains(list) && std::ranges::any_of(root.at(list), has_uri);
  });
}

GltfDocument openDocument(const std::filesystem::path& path, GltfJson& parsed, bool splats_alone) {
  const auto whole = [&] {
    const std::vector<std::uint8_t> bytes = readFile(path, kMaxGltfBytes);
    parsed = parseJsonOf(bytes, path.string());
    return load(parsed, bytes, path.string(), folderOf(path), splats_alone);
  };
  if (!isFile(path)) return whole();  // a pipe, or nothing
  GltfDocument document;
  document.path = path.string();
  document.file = std::make_shared<const FileReader>(path, kMaxGltfBytes);
  std::vector<std::uint8_t> bytes = headOf(*document.file);
  if (bytes.empty()) return whole();
  const GltfParts parts = splitGlb(bytes, document.file->size(), document.path);
  parsed = parseGltfJson(parts.json, document.path);
  json& root = parsed.root;
  if (needsResolving(root) || holdsUris(root)) {
    const std::size_t head = bytes.size();
    bytes.resize(static_cast<std::size_t>(document.file->size()));
    document.file->read(head, std::span(bytes).subspan(head));
    return load(parsed, bytes, document.path, folderOf(path), splats_alone);
  }
  checkGltfJson(root, parts, document.path);
  document.hollow_layers = hollowLayers(root);
  noteExtensions(root, document);
  document.unread = unreadOf(root);
  parseWithout(document.model, document.path, root, kLeftOut);
  document.bin_offset = parts.bin_offset;
  for (const json& entry : list(root, "images")) {
    tinygltf::Image& image = document.model.images.emplace_back();
    image.bufferView = entry.at("bufferView").get<int>();
    if (const auto type = entry.find("mimeType"); type != entry.end() && type->is_string()) image.mimeType = *type;
    image.image.resize(document.model.bufferViews[static_cast<std::size_t>(image.bufferView)].byteLength);
    document.read(image.bufferView, 0, image.image);
  }
  return document;
}

}  // namespace

void GltfDocument::read(int view, std::uint64_t offset, std::span<std::uint8_t> out) const {
  TG_ASSERT(view >= 0 && static_cast<std::size_t>(view) < model.bufferViews.size(), "the document has this view");
  TG_ASSERT(offset + out.size() <= model.bufferViews[static_cast<std::size_t>(view)].byteLength,
            "the view holds as much");
  const tinygltf::BufferView& v = model.bufferViews[static_cast<std::size_t>(view)];
  if (file) return file->read(bin_offset + v.byteOffset + offset, out);
  const std::vector<unsigned char>& data = model.buffers[static_cast<std::size_t>(v.buffer)].data;
  if (!out.empty()) std::memcpy(out.data(), data.data() + v.byteOffset + offset, out.size());
}

std::vector<std::string> gltfFilesBeside(const std::filesystem::path& path) {
  const std::vector<std::uint8_t> bytes = readFile(path, kMaxGltfBytes);
  const json root = parseJsonOf(bytes, path.string()).root;
  std::set<std::string> names;
  for (const char* member : {"buffers", "images"}) {
    for (const json& entry : list(root, member)) {
      const auto uri = entry.find("uri");
      if (uri == entry.end() || !uri->is_string()) continue;
      const auto name = nameBeside(uri->get_ref<const std::string&>());
      if (name) names.insert(std::filesystem::path(*name).lexically_normal().string());  // of ./a.bin a.bin
    }
  }
  return {names.begin(), names.end()};
}

GltfDocument openGltf(const std::filesystem::path& path) {
  GltfJson unused;
  return openDocument(path, unused, true);
}

GltfDocument openGltf(const std::filesystem::path& path, GltfJson& parsed) { return openDocument(path, parsed, false); }

GltfDocument loadGltf(std::span<const std::uint8_t> bytes, const std::string& path,
                      const std::optional<std::filesystem::path>& folder) {
  GltfJson parsed = parseJsonOf(bytes, path);
  return load(parsed, bytes, path, folder, true);
}

}  // namespace tg
