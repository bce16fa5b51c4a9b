// SPDX-License-Identifier: Apache-2.0
// Makes one GLB of a glTF file in several files or with packed attributes.
#include "converter/gltf/resolve.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <nlohmann/json.hpp>
#include <set>

#include "converter/gltf/document.h"
#include "converter/gltf/document_check.h"
#include "converter/gltf/json_members.h"
#include "converter/gltf/meshopt.h"
#include "converter/gltf/spz_extension.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {
namespace {

using nlohmann::json;

constexpr std::array<const char*, 2> kCodecs = {"EXT_meshopt_compression", "KHR_meshopt_compression"};
constexpr std::uint64_t kMaxResolvedBytes = 0xFFFFFFFFull;  // of the GLB that is made
constexpr std::uint64_t kMaxUnpackRatio = 64;               // 2 bits of a packed stream stand for 16 bytes at most
constexpr std::uint64_t kMaxUnpackExtra = 1 << 16;          // [bytes] header and tail of a stream

const json& none() {
  static const json value = json::object();
  return value;
}

// What stands under a key, or an empty object.
const json& child(const json& parent, const char* key) {
  return parent.is_object() && parent.contains(key) ? parent.at(key) : none();
}

bool isDataUri(const json& uri) { return uri.is_string() && uri.get_ref<const std::string&>().rfind("data:", 0) == 0; }
bool isExternal(const json& object) {
  return object.is_object() && object.contains("uri") && !isDataUri(object.at("uri"));
}

// Those that neither splats nor their textures need: of other meshes, of colours for viewers of plain points, of what
// nothing names.
std::set<std::size_t> viewsBesideSplats(const json& root) {
  std::set<std::size_t> read, rest;
  const auto add = [&](const json& object) {
    if (const json& view = member(object, "bufferView"); view.is_number_unsigned()) {
      read.insert(view.get<std::size_t>());
    }
  };
  const json& accessors = list(root, "accessors");
  bool layered = false;
  for (const json& mesh : list(root, "meshes")) {
    for (const json& primitive : list(mesh, "primitives")) {
      const json& attributes = member(primitive, "attributes");
      const json& extensions = child(primitive, "extensions");
      if (!attributes.is_object() || !extensions.contains(kSplatExtension)) continue;
      const json& inner = child(extensions.at(std::string(kSplatExtension)), "extensions");
      layered = layered || (inner.is_object() && inner.contains(kTextureExtension));
      add(child(inner, std::string(kSpzExtension).c_str()));
      for (const auto& [name, index] : attributes.items()) {
        const bool of_splats = name == "POSITION" || name.starts_with("_TG_") || name.find(':') != name.npos;
        if (!of_splats || !index.is_number_unsigned() || index.get<std::size_t>() >= accessors.size()) continue;
        const json& accessor = accessors[index.get<std::size_t>()];
        const json& sparse = member(accessor, "sparse");
        for (const json* part : {&accessor, &member(sparse, "indices"), &member(sparse, "values")}) add(*part);
      }
    }
  }
  if (layered) {
    for (const json& image : list(root, "images")) add(image);
  }
  for (std::size_t view = 0; view < list(root, "bufferViews").size(); ++view) {
    if (!read.contains(view)) rest.insert(view);
  }
  return rest;
}

class Resolver {
 public:
  Resolver(std::span<const std::uint8_t> bytes, const GltfParts& parts,
           const std::optional<std::filesystem::path>& folder, const std::string& path, json& root, bool splats_alone)
      : parts_(parts), folder_(folder), path_(path), root_(root) {
    if (splats_alone) unread_ = viewsBesideSplats(root);
    if (parts.bin_bytes) file_bin_ = bytes.subspan(static_cast<std::size_t>(parts.bin_offset), *parts.bin_bytes);
  }

  std::optional<std::vector<std::uint8_t>> run() {
    if (!root_.is_object() || !needsResolving(root_)) return std::nullopt;
    for (const char* list : {"buffers", "bufferViews", "images", "extensionsRequired"}) {
      if (root_.contains(list) && !root_[list].is_array()) {
        fail(std::string("/").append(list), "wrong type (expected an array)");
      }
    }
    buffers();
    views();
    images();
    return finish();
  }

 private:
  struct Source {
    std::size_t buffer = 0;    // of the new document
    std::uint64_t offset = 0;  // in it
    std::uint64_t bytes = 0;
    bool there = false;  // not a mere stand-in for packed views
    bool packed_in_bin = false;
  };

  [[noreturn]] void fail(const std::string& pointer, const std::string& what) const {
    throw Error(ErrorKind::badData, path_, shortened(pointer) + ": " + shortened(what));
  }

  std::uint64_t number(const json& object, const char* key, std::optional<std::uint64_t> otherwise,
                       const std::string& pointer) const {
    if (!object.is_object()) fail(pointer, "wrong type (expected an object)");
    if (!object.contains(key)) {
      if (otherwise) return *otherwise;
      fail(pointer, "\"" + std::string(key) + "\" is missing");
    }
    const json& value = object.at(key);
    if (!value.is_number_unsigned()) fail(pointer + "/" + key, "wrong value (expected an integer >= 0)");
    return value.get<std::uint64_t>();
  }

  // Appends to the new binary part; where it starts.
  std::uint64_t append(std::span<const std::uint8_t> bytes) {
    bin_.resize((bin_.size() + 3) / 4 * 4);
    const std::uint64_t offset = bin_.size();
    if (offset + bytes.size() > kMaxResolvedBytes) {
      throw Error(ErrorKind::badData, path_, "the parts are too large (expected at most 4 GiB in all)");
    }
    bin_.insert(bin_.end(), bytes.begin(), bytes.end());
    return offset;
  }

  // At least `least` bytes, or all of an image.
  std::vector<std::uint8_t> readExternal(const json& uri, const std::string& pointer,
                                         std::optional<std::uint64_t> least) const {
    if (!uri.is_string()) fail(pointer, "wrong type (expected a string)");
    if (!folder_) fail(pointer, "external files are not read here (expected a GLB or a base64 data URI)");
    const std::optional<std::string> name = nameBeside(uri.get_ref<const std::string&>());
    if (!name) fail(pointer, "no name of a file beside this one (expected a relative path without \"..\")");
    std::uint64_t size = 0;
    try {
      const FileReader file(*folder_ / *name, kMaxResolvedBytes);  // of a regular file, whose size is known
      size = file.size();
      if (size >= least.value_or(0)) {
        std::vector<std::uint8_t> bytes(static_cast<std::size_t>(least.value_or(size)));
        file.read(0, bytes);
        return bytes;
      }
    } catch (const Error& error) {
      fail(pointer, std::string("external file: ") + error.what());
    }
    fail(pointer, "the file is too short" + expectedFound(*least, size));
  }

  void buffers() {
    json kept = json::array({json::object()});  // the new binary part
    const json old = child(root_, "buffers");
    for (std::size_t b = 0; b < old.size(); ++b) {
      const json& buffer = old[b];
      const std::string pointer = "/buffers/" + std::to_string(b);
      Source source;
      source.bytes = number(buffer, "byteLength", std::nullopt, pointer);
      if (isExternal(buffer)) {
        source.offset = append(readExternal(buffer.at("uri"), pointer + "/uri", source.bytes));
        source.there = source.packed_in_bin = true;
      } else if (buffer.contains("uri")) {
        const json& uri = buffer["uri"];  // of which other words are for checkGltfJson()
        const std::uint64_t most = uri.is_string() ? dataUriBytes(uri.get_ref<const std::string&>()) : 0;
        if (most > 0 && source.bytes > most) {  // behind this it has another number
          fail(pointer + "/byteLength", "more than the data URI holds" + atMost(most, source.bytes));
        }
        source.buffer = kept.size();
        source.there = true;
        kept.push_back(buffer);
      } else if (b == 0 && parts_.bin_bytes) {
        if (source.bytes > file_bin_.size()) {
          fail(pointer + "/byteLength", "leaves the BIN chunk" + atMost(file_bin_.size(), source.bytes));
        }
        source.offset = append(file_bin_.first(static_cast<std::size_t>(source.bytes)));
        source.there = source.packed_in_bin = true;
      } else if (codecOf(buffer) == nullptr) {
        fail(pointer, "has neither a uri nor a BIN chunk");
      }
      sources_.push_back(source);
    }
    root_["buffers"] = std::move(kept);
  }

  const Source& sourceOf(const json& object, const std::string& pointer) const {
    const std::uint64_t buffer = number(object, "buffer", std::nullopt, pointer);
    if (buffer >= sources_.size()) {
      fail(pointer + "/buffer", "no such buffer (expected an index below " + std::to_string(sources_.size()) +
                                    ", found " + std::to_string(buffer) + ")");
    }
    return sources_[static_cast<std::size_t>(buffer)];
  }

  void views() {
    if (!root_.contains("bufferViews")) return;
    std::vector<json*> unread;
    for (std::size_t v = 0; v < root_["bufferViews"].size(); ++v) {
      json& view = root_["bufferViews"][v];
      const std::string pointer = "/bufferViews/" + std::to_string(v);
      if (const char* codec = codecOf(view)) {
        unpack(view, codec, pointer, unread_.contains(v));
        if (unread_.contains(v)) unread.push_back(&view);
        continue;
      }
      const Source& source = sourceOf(view, pointer);
      const std::uint64_t offset = number(view, "byteOffset", 0, pointer);
      const std::uint64_t bytes = number(view, "byteLength", std::nullopt, pointer);
      if (!source.there || offset > source.bytes || bytes > source.bytes - offset) {
        fail(pointer, "leaves its buffer (expected at most " + std::to_string(source.there ? source.bytes : 0) +
                          " bytes, found " + std::to_string(offset) + " + " + std::to_string(bytes) + ")");
      }
      view["buffer"] = source.buffer;
      view["byteOffset"] = source.offset + offset;
    }
    if (unread.empty()) return;
    const std::uint64_t zeros_at = append(std::vector<std::uint8_t>(static_cast<std::size_t>(longest_unread_)));
    for (json* view : unread) (*view)["byteOffset"] = zeros_at;
  }

  void unpack(json& view, const char* codec, const std::string& pointer, bool unread) {
    const std::string place = pointer + "/extensions/" + codec;
    const json packed = view["extensions"][codec];
    const Source& source = sourceOf(packed, place);
    const std::uint64_t offset = number(packed, "byteOffset", 0, place);
    const std::uint64_t bytes = number(packed, "byteLength", std::nullopt, place);
    const std::uint64_t stride = number(packed, "byteStride", std::nullopt, place);
    const std::uint64_t count = number(packed, "count", std::nullopt, place);
    if (!source.packed_in_bin) fail(place, "the packed bytes are in no file (expected the BIN chunk or a file)");
    if (offset > source.bytes || bytes > source.bytes - offset) {
      fail(place, "leaves its buffer (expected at most " + std::to_string(source.bytes) + " bytes, found " +
                      std::to_string(offset) + " + " + std::to_string(bytes) + ")");
    }
    if (stride > 256 || count > kMaxResolvedBytes || count * stride > bytes * kMaxUnpackRatio + kMaxUnpackExtra) {
      fail(place, "more than the stream can hold (found " + std::to_string(count) + " elements of " +
                      std::to_string(stride) + " bytes in " + std::to_string(bytes) + ")");
    }
    const auto text = [&](const char* key, std::optional<std::string> otherwise) -> std::string {
      if (!packed.contains(key) && otherwise) return *otherwise;
      const JsonNode node{packed, path_, place};
      return node.at(key).string();
    };
    const std::uint64_t length = number(view, "byteLength", std::nullopt, pointer);
    if (length != count * stride) {
      fail(pointer + "/byteLength", "differs from what is packed (expected " + std::to_string(count * stride) +
                                        ", found " + std::to_string(length) + ")");
    }
    view["buffer"] = 0u;  // unsigned, as parsing it would make it
    if (unread) {
      longest_unread_ = std::max(longest_unread_, length);
    } else {
      const std::vector<std::uint8_t> from(bin_.begin() + static_cast<std::ptrdiff_t>(source.offset + offset),
                                           bin_.begin() + static_cast<std::ptrdiff_t>(source.offset + offset + bytes));
      view["byteOffset"] = append(unpackMeshopt(from, static_cast<std::size_t>(count), static_cast<std::size_t>(stride),
                                                text("mode", {}), text("filter", "NONE"), path_ + ": " + place));
    }
    view["extensions"].erase(codec);
  }

  void images() {
    if (!root_.contains("images")) return;
    for (std::size_t i = 0; i < root_["images"].size(); ++i) {
      json& image = root_["images"][i];
      if (!isExternal(image)) continue;
      const std::string pointer = "/images/" + std::to_string(i);
      if (image.contains("bufferView")) fail(pointer, "needs either a uri or a bufferView");
      const std::vector<std::uint8_t> bytes = readExternal(image["uri"], pointer + "/uri", {});
      if (!root_.contains("bufferViews")) root_["bufferViews"] = json::array();
      const std::uint64_t offset = append(bytes);
      image["bufferView"] = root_["bufferViews"].size();
      root_["bufferViews"].push_back({{"buffer", 0u}, {"byteOffset", offset}, {"byteLength", bytes.size()}});
      image.erase("uri");
    }
  }

  std::vector<std::uint8_t> finish() {
    bin_.resize((std::max<std::size_t>(bin_.size(), 4) + 3) / 4 * 4);
    root_["buffers"][0]["byteLength"] = bin_.size();
    for (const char* list : {"extensionsRequired", "extensionsUsed"}) {
      if (!root_.contains(list) || !root_[list].is_array()) continue;
      json rest = json::array();
      for (const json& name : root_[list]) {
        if (name != json(kCodecs[0]) && name != json(kCodecs[1])) rest.push_back(name);
      }
      if (rest.empty()) {
        root_.erase(list);
      } else {
        root_[list] = std::move(rest);
      }
    }
    return glbOf(root_.dump(-1, ' ', false, json::error_handler_t::replace), bin_, path_);
  }

  const GltfParts& parts_;
  const std::optional<std::filesystem::path>& folder_;
  const std::string& path_;
  json& root_;
  std::span<const std::uint8_t> file_bin_;
  std::vector<std::uint8_t> bin_;
  std::vector<Source> sources_;
  std::set<std::size_t> unread_;  // views, which share zeros where they are packed
  std::uint64_t longest_unread_ = 0;
};

}  // namespace

const char* codecOf(const json& object) {
  for (const char* codec : kCodecs) {
    if (child(object, "extensions").is_object() && child(object, "extensions").contains(codec)) return codec;
  }
  return nullptr;
}

bool needsResolving(const json& root) {
  for (const char* list : {"buffers", "images"}) {
    for (const json& object : child(root, list)) {
      if (isExternal(object)) return true;
    }
  }
  for (const json& view : child(root, "bufferViews")) {
    if (codecOf(view) != nullptr) return true;
  }
  return false;
}

std::optional<std::string> nameBeside(std::string_view uri) {
  // Of a scheme, and what some take for a slash; escaped they are letters of a name.
  if (uri.find_first_of(":\\") != uri.npos) return std::nullopt;
  std::string name;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    unsigned char code = 0;
    if (uri[i] == '%' && i + 2 < uri.size() &&
        std::from_chars(uri.data() + i + 1, uri.data() + i + 3, code, 16).ptr == uri.data() + i + 3) {
      name += static_cast<char>(code);
      i += 2;
    } else {
      name += uri[i];
    }
  }
  if (name.empty() || name[0] == '/' || name.find('\0') != name.npos) return std::nullopt;
  for (const std::filesystem::path& part : std::filesystem::path(name)) {
    if (part == "..") return std::nullopt;
  }
  return name;
}

std::optional<std::vector<std::uint8_t>> resolveGltf(json& root, std::span<const std::uint8_t> bytes,
                                                     const GltfParts& parts,
                                                     const std::optional<std::filesystem::path>& folder,
                                                     const std::string& path, bool splats_alone) {
  return Resolver(bytes, parts, folder, path, root, splats_alone).run();
}

}  // namespace tg
