// SPDX-License-Identifier: Apache-2.0
// Rules of glTF 2.0 that no reader of ours needs and every other one may.
#include "converter/gltf/core_rules.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include "converter/gltf/document_check.h"
#include "converter/gltf/json_members.h"

namespace tg {
namespace {

using nlohmann::json;

constexpr double kUnitTolerance = 0.00769;        // of a rotation's length, as Khronos' validator has it
constexpr double kOrthogonalTolerance = 0.00769;  // of a matrix's columns
constexpr std::uint64_t kScanRatio = 8;           // accessors' bytes to the buffers', before scanning ends
constexpr std::size_t kScanBlock = 1 << 20;       // [bytes]
constexpr std::uint64_t kFloatType = 5126, kUintType = 5125;
constexpr int kVertexTarget = 34962, kIndexTarget = 34963;  // of buffer views
constexpr std::array kLists = {"accessors", "animations", "bufferViews", "buffers", "cameras", "images",  "materials",
                               "meshes",    "nodes",      "samplers",    "scenes",  "skins",   "textures"};
constexpr std::size_t kNobody = std::numeric_limits<std::size_t>::max();

std::optional<double> number(const json& object, const char* key) {
  const json& value = member(object, key);
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}

// An attribute's name: one of the format's own, or an application's or an extension's.
bool isSemantic(std::string_view name) {
  if (name.starts_with('_') || name.find(':') != name.npos) return true;
  if (name == "POSITION" || name == "NORMAL" || name == "TANGENT") return true;
  for (const std::string_view set : {"TEXCOORD_", "COLOR_", "JOINTS_", "WEIGHTS_"}) {
    if (!name.starts_with(set)) continue;
    const std::string_view digits = name.substr(set.size());
    const bool all = !digits.empty() && std::ranges::all_of(digits, [](char c) { return c >= '0' && c <= '9'; });
    return all && (digits.size() == 1 || digits[0] != '0');
  }
  return false;
}

// "" for what is neither PNG, JPEG nor WebP.
std::string_view imageType(std::span<const unsigned char> bytes) {
  const std::string_view start(reinterpret_cast<const char*>(bytes.data()), std::min<std::size_t>(bytes.size(), 12));
  if (start.starts_with("\x89PNG\r\n\x1a\n")) return "image/png";
  if (start.starts_with("\xff\xd8\xff")) return "image/jpeg";
  return start.starts_with("RIFF") && start.ends_with("WEBP") ? "image/webp" : "";
}

std::string shown(const json& value) { return value.dump(-1, ' ', true, json::error_handler_t::replace); }

class CoreRules {
 public:
  CoreRules(const json& root, const GltfDocument& document, std::vector<std::string>& errors,
            std::vector<std::string>& warnings)
      : root_(root), document_(document), errors_(errors), warnings_(warnings) {}

  void run() {
    asset();
    lists();
    extensions();
    accessors();
    views();
    images();
    meshes();
    nodes();
    scenes();
    cameras();
    materials();
    textures();
    skins();
    animations();
  }

 private:
  void error(const std::string& pointer, const std::string& what) {
    errors_.push_back(printable(shortened(pointer) + ": " + shortened(what)));
  }

  template <typename Visit>
  void each(const json& values, const std::string& pointer, const Visit& visit) {
    for (std::size_t i = 0; i < values.size(); ++i) visit(values[i], pointer + "/" + std::to_string(i));
  }
  template <typename Visit>
  void eachOf(const char* key, const Visit& visit) {
    each(list(root_, key), std::string("/") + key, visit);
  }

  // An index, if there is one.
  void reference(const json& object, const char* key, const char* of, const std::string& pointer) {
    const json& value = member(object, key);
    if (value.is_null()) return;
    const std::size_t count = list(root_, of).size();
    if (value.is_number_unsigned() && value.get<std::uint64_t>() < count) return;
    error(pointer + "/" + key, "names none of \"" + std::string(of) + "\"" +
                                   expectedFound("an index below " + std::to_string(count), value.dump()));
  }

  // A number that must be there, or may; within limits, where there are any.
  void range(const json& object, const char* key, const std::string& pointer, bool required, double low, double high,
             bool open = false) {
    const json& value = member(object, key);
    if (value.is_null() && !required) return;
    const std::optional<double> found = number(object, key);
    if (found && (open ? *found > low : *found >= low) && *found <= high) return;
    error(pointer + "/" + key, value.is_null() ? "is missing" : "out of range (found " + value.dump() + ")");
  }

  // A warning, since later versions may know more, where the type is right.
  void choice(const json& object, const char* key, const std::string& pointer, std::initializer_list<json> choices) {
    const auto given = object.is_object() ? object.find(key) : object.end();
    if (!object.is_object() || given == object.end()) return;
    const json& value = *given;
    if (std::ranges::find(choices, value) != choices.end()) return;
    const bool words = choices.begin()->is_string();
    if (words ? !value.is_string() : !value.is_number_integer()) {
      return error(pointer + "/" + key, "wrong type" + expectedFound(words ? "a string" : "an integer", shown(value)));
    }
    warnings_.push_back(printable(shortened(pointer) + "/" + key + ": is none of the format's (found " +
                                  shortened(value.dump()) + ")"));
  }

  void text(const json& object, const char* key, const std::string& pointer) {
    const json& value = member(object, key);
    if (!value.is_null() && !value.is_string()) error(pointer + "/" + key, "wrong type (expected a string)");
  }

  // Of objects' indices: at least one, each once.
  void uniqueNonEmpty(const json& object, const char* key, const std::string& pointer) {
    const json& values = member(object, key);
    if (!values.is_array()) return;
    if (values.empty()) error(pointer + "/" + key, "is empty (expected at least one element, or no such key)");
    std::vector<json> sorted(values.begin(), values.end());
    std::ranges::sort(sorted);
    if (std::ranges::adjacent_find(sorted) != sorted.end()) error(pointer + "/" + key, "names something twice");
  }

  void asset() {
    const json& asset = member(root_, "asset");
    for (const char* key : {"generator", "copyright", "minVersion"}) text(asset, key, "/asset");
    for (const char* key : {"version", "minVersion"}) {
      const json& stated = member(asset, key);
      if (!stated.is_string() || versionOf(stated.get_ref<const std::string&>())) continue;
      error(std::string("/asset/").append(key), "is no version (expected MAJOR.MINOR, found " + stated.dump() + ")");
    }
  }

  void extensions() {
    const auto object = [&](const json& parent, const std::string& pointer) {
      const json& value = member(parent, "extensions");
      if (!value.is_null() && !value.is_object()) error(pointer + "/extensions", "wrong type (expected an object)");
    };
    object(root_, "");
    for (const char* key : kLists) eachOf(key, object);
  }

  void lists() {
    for (const char* key : kLists) {
      const auto found = root_.find(key);
      if (found == root_.end()) continue;
      const std::string pointer = std::string("/").append(key);
      if (!found->is_array()) error(pointer, "wrong type (expected an array)");
      eachOf(key, [&](const json& value, const std::string& place) {
        if (!value.is_object()) error(place, "wrong type" + expectedFound("an object", shown(value)));
      });
    }
  }

  // ---- Accessors: what they say of their numbers, and the numbers.

  template <typename T>
  void scan(const json& accessor, const std::string& pointer, std::size_t components) {
    const json& view = root_["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    const std::size_t element = components * sizeof(T);
    const std::size_t stride = view.value("byteStride", std::uint64_t{element});
    const auto count = accessor["count"].get<std::size_t>();
    const std::uint64_t offset = accessor.value("byteOffset", std::uint64_t{0});
    std::vector<double> low(components, std::numeric_limits<double>::infinity()), high(components, -low[0]);
    std::size_t broken = 0;
    const std::size_t rows = std::max<std::size_t>(1, kScanBlock / stride);
    std::vector<std::uint8_t> bytes;
    for (std::size_t first = 0; first < count; first += rows) {
      const std::size_t here = std::min(rows, count - first);
      bytes.resize((here - 1) * stride + element);
      document_.read(accessor["bufferView"].get<int>(), offset + first * stride, bytes);
      for (std::size_t i = 0; i < here; ++i) {
        for (std::size_t c = 0; c < components; ++c) {
          T value;
          std::memcpy(&value, bytes.data() + i * stride + c * sizeof(T), sizeof(T));
          const double number = static_cast<double>(value);
          broken += !std::isfinite(number);
          low[c] = std::min(low[c], number);
          high[c] = std::max(high[c], number);
        }
      }
    }
    if (broken != 0) return error(pointer, std::to_string(broken) + " values are not finite");
    bounds<T>(accessor, pointer, "min", low);
    bounds<T>(accessor, pointer, "max", high);
    const bool clamped = colors_.contains(pointer) && sizeof(T) == 4;
    for (std::size_t c = 0; c < components && clamped; ++c) {
      if (low[c] < 0.0 || high[c] > 1.0) return error(pointer, "colours leave [0, 1]");
    }
  }

  // Whether a number of the JSON is the one that an accessor holds: integers as they are, floats as rounded to theirs.
  template <typename T>
  static bool same(double stated, double found) {
    if constexpr (std::is_integral_v<T>) return stated == found;
    return std::abs(stated) <= std::numeric_limits<float>::max() && double{static_cast<float>(stated)} == found;
  }

  template <typename T>
  void bounds(const json& accessor, const std::string& pointer, const char* key, const std::vector<double>& found) {
    const json& stated = member(accessor, key);
    if (!stated.is_array() || stated.size() != found.size()) return;  // said already
    for (std::size_t c = 0; c < found.size(); ++c) {
      if (!stated[c].is_number()) return;
      if (same<T>(stated[c].get<double>(), found[c])) continue;
      return error(pointer + "/" + key, "is not the numbers' own" +
                                            expectedFound(json(found[c]).dump(), stated[c].dump()) + " at " +
                                            std::to_string(c));
    }
  }

  void scan(const json& accessor, const std::string& pointer) {
    const json& sparse = member(accessor, "sparse");
    const auto components = static_cast<std::size_t>(componentCount(accessor["type"].get<std::string>()));
    const std::uint64_t type = accessor["componentType"].get<std::uint64_t>();
    const auto bytes = components * static_cast<std::size_t>(componentBytes(type));
    if (!accessor.contains("bufferView") || !sparse.is_null() || accessor["type"].get<std::string>()[0] == 'M') return;
    if (bytes * accessor["count"].get<std::uint64_t>() > scan_left_) {
      if (scan_left_ != 0)
        warnings_.push_back(pointer + ": this accessor's numbers and those of others are not checked");
      scan_left_ = 0;
      return;
    }
    scan_left_ -= bytes * accessor["count"].get<std::uint64_t>();
    if (type == 5120) scan<std::int8_t>(accessor, pointer, components);
    if (type == 5121) scan<std::uint8_t>(accessor, pointer, components);
    if (type == 5122) scan<std::int16_t>(accessor, pointer, components);
    if (type == 5123) scan<std::uint16_t>(accessor, pointer, components);
    if (type == kUintType) scan<std::uint32_t>(accessor, pointer, components);
    if (type == kFloatType) scan<float>(accessor, pointer, components);
  }

  void accessors() {
    for (const json& buffer : list(root_, "buffers")) {
      scan_left_ += kScanRatio * buffer["byteLength"].get<std::uint64_t>();
    }
    for (const json& mesh : list(root_, "meshes")) {
      for (const json& primitive : mesh["primitives"]) {
        for (const auto& [name, index] : primitive["attributes"].items()) {
          if (name == "COLOR_0") colors_.insert("/accessors/" + index.dump());
        }
      }
    }
    eachOf("accessors", [&](const json& accessor, const std::string& pointer) {
      const auto components = static_cast<std::size_t>(componentCount(accessor["type"].get<std::string>()));
      for (const char* key : {"min", "max"}) {
        const json& stated = member(accessor, key);
        if (stated.is_null()) continue;
        const bool numbers =
            stated.is_array() && std::ranges::all_of(stated, [](const json& v) { return v.is_number(); });
        if (!numbers || stated.size() != components) {
          error(pointer + "/" + key, "wrong value (expected " + std::to_string(components) + " numbers)");
        }
      }
      const json& normalized = member(accessor, "normalized");
      const std::uint64_t type = accessor["componentType"].get<std::uint64_t>();
      if (!normalized.is_null() && !normalized.is_boolean()) {
        error(pointer + "/normalized", "wrong type (expected true or false)");
      } else if (normalized == json(true) && (type == kFloatType || type == kUintType)) {
        error(pointer + "/normalized", "only 8 and 16 bits are normalised");
      }
      if (accessor.contains("byteOffset") && !accessor.contains("bufferView")) {
        error(pointer + "/byteOffset", "stands without a bufferView");
      }
      scan(accessor, pointer);
    });
  }

  // ---- Buffer views: each is of one use.

  enum Use : std::uint8_t { unused, image, vertices, indices };

  void use(std::size_t view, Use use, const std::string& pointer) {
    uses_.resize(list(root_, "bufferViews").size(), unused);
    if (uses_[view] != unused && uses_[view] != use) {
      error(pointer, "the buffer view " + std::to_string(view) + " serves something else, too");
    }
    uses_[view] = use;
    const json& target = member(list(root_, "bufferViews")[view], "target");
    if ((use == vertices && target == kIndexTarget) || (use == indices && target == kVertexTarget)) {
      error(pointer, "the buffer view " + std::to_string(view) + " has the target of something else (found " +
                         target.dump() + ")");
    }
  }

  void views() {
    eachOf("bufferViews", [&](const json& view, const std::string& pointer) {
      choice(view, "target", pointer, {kVertexTarget, kIndexTarget});
    });
  }

  void images() {
    std::size_t index = 0;
    eachOf("images", [&](const json& image_object, const std::string& pointer) {
      text(image_object, "mimeType", pointer);
      const std::string_view type = imageType(document_.model.images[index++].image);
      const json& stated = member(image_object, "mimeType");
      if (!type.empty() && stated.is_string() && stated != type) {
        error(pointer + "/mimeType", "is not the image's own" + expectedFound(std::string(type), shown(stated)));
      }
      if (!image_object.contains("bufferView")) return;
      const auto view = image_object["bufferView"].get<std::size_t>();
      if (!image_object.contains("mimeType")) error(pointer, "has a bufferView and no mimeType");
      if (root_["bufferViews"][view].contains("byteStride")) error(pointer + "/bufferView", "has a byteStride");
      use(view, image, pointer + "/bufferView");
    });
  }

  void meshes() {
    eachOf("meshes", [&](const json& mesh, const std::string& pointer) {
      each(mesh["primitives"], pointer + "/primitives", [&](const json& primitive, const std::string& place) {
        attributes(primitive, place);
        if (primitive.contains("indices")) {
          const json& accessor = root_["accessors"][primitive["indices"].get<std::size_t>()];
          const std::uint64_t type = accessor["componentType"].get<std::uint64_t>();
          const bool index = type == 5121 || type == 5123 || type == kUintType;
          if (accessor["type"] != "SCALAR" || !index) {
            error(place + "/indices", "wrong type (expected SCALAR of ubyte / ushort / uint)");
          }
          if (accessor.contains("bufferView"))
            use(accessor["bufferView"].get<std::size_t>(), indices, place + "/indices");
        }
        reference(primitive, "material", "materials", place);
        const json& targets = member(primitive, "targets");
        if (targets.is_array() && targets.empty()) error(place + "/targets", "is empty");
      });
    });
  }

  void attributes(const json& primitive, const std::string& place) {
    const json& all = primitive["attributes"];
    std::optional<std::uint64_t> splats;
    if (all.contains("POSITION")) {
      splats = root_["accessors"][all["POSITION"].get<std::size_t>()]["count"].get<std::uint64_t>();
    }
    for (const auto& [name, index] : all.items()) {
      const json& accessor = root_["accessors"][index.get<std::size_t>()];
      const std::string pointer = place + "/attributes/" + name;
      if (!isSemantic(name)) error(pointer, "no attribute of glTF (expected a name that begins with \"_\")");
      if (accessor.contains("bufferView")) {
        const auto view = accessor["bufferView"].get<std::size_t>();
        use(view, vertices, pointer);
        const bool strided = root_["bufferViews"][view].contains("byteStride");
        const std::size_t other = attribute_in_.try_emplace(view, index.get<std::size_t>()).first->second;
        if (!strided && other != index.get<std::size_t>()) {
          error("/bufferViews/" + std::to_string(view), "holds several attributes and has no byteStride");
        }
      }
      const std::uint64_t count = accessor["count"].get<std::uint64_t>();
      if (splats && count != *splats)
        error(pointer, "the count differs from POSITION's" + expectedFound(*splats, count));
      const std::uint64_t type = accessor["componentType"].get<std::uint64_t>();
      if (name == "POSITION" && (!accessor.contains("min") || !accessor.contains("max"))) {
        error(pointer, "has no min and max");
      }
      if (!name.starts_with("COLOR_")) continue;
      const bool normalized = (type == 5121 || type == 5123) && member(accessor, "normalized") == json(true);
      if ((accessor["type"] != "VEC3" && accessor["type"] != "VEC4") || !(type == kFloatType || normalized)) {
        error(pointer, "wrong type (expected VEC3 or VEC4 of float / normalised ubyte / normalised ushort)");
      }
    }
  }

  // ---- Nodes

  void nodes() {
    const json& all = list(root_, "nodes");
    std::vector<std::size_t>& parent = parent_;
    parent.assign(all.size(), kNobody);
    eachOf("nodes", [&](const json& node, const std::string& pointer) {
      reference(node, "skin", "skins", pointer);
      if (!node.contains("mesh")) {
        for (const char* key : {"skin", "weights"}) {
          if (node.contains(key)) error(pointer + "/" + key, "stands without a mesh");
        }
      } else if (node.contains("skin")) {
        const json& primitives = list(root_, "meshes")[node["mesh"].get<std::size_t>()]["primitives"];
        const auto jointed = [](const json& primitive) { return primitive["attributes"].contains("JOINTS_0"); };
        if (std::ranges::none_of(primitives, jointed)) error(pointer + "/skin", "is of a mesh without JOINTS_0");
      }
      pose(node, pointer);
      uniqueNonEmpty(node, "children", pointer);
      const std::size_t index = static_cast<std::size_t>(&node - &all[0]);
      for (const json& child : list(node, "children")) {
        std::size_t& known = parent[child.get<std::size_t>()];
        if (known != kNobody && known != index) error("/nodes/" + child.dump(), "has two parents");
        known = index;
      }
    });
    // A walk up from every node ends where an earlier one has been.
    std::vector<std::size_t> walk(all.size(), kNobody);
    for (std::size_t start = 0; start < all.size(); ++start) {
      std::size_t at = start;
      while (at != kNobody && walk[at] == kNobody) {
        walk[at] = start;
        at = parent[at];
      }
      if (at != kNobody && walk[at] == start) error("/nodes/" + std::to_string(at), "is its own ancestor");
    }
  }

  void pose(const json& node, const std::string& pointer) {
    if (node.contains("matrix")) {
      for (const char* key : {"translation", "rotation", "scale"}) {
        if (node.contains(key)) error(pointer + "/" + key, "stands beside a matrix");
      }
      std::array<std::array<double, 3>, 3> column{};
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t r = 0; r < 3; ++r) column[c][r] = node["matrix"][4 * c + r].get<double>();
      }
      const auto dot = [](const auto& a, const auto& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
      for (std::size_t c = 0; c < 3; ++c) {
        const auto &a = column[c], &b = column[(c + 1) % 3];
        if (std::abs(dot(a, b)) <= kOrthogonalTolerance * std::sqrt(dot(a, a) * dot(b, b))) continue;
        error(pointer + "/matrix", "shears (expected a translation, a rotation and a scale)");
        break;
      }
    }
    if (!node.contains("rotation")) return;
    double length = 0.0;
    for (const json& component : node["rotation"]) length += component.get<double>() * component.get<double>();
    if (std::abs(std::sqrt(length) - 1.0) > kUnitTolerance) {
      error(pointer + "/rotation", "is not of unit length" + expectedFound("1", json(std::sqrt(length)).dump()));
    }
  }

  void scenes() {
    eachOf("scenes", [&](const json& scene, const std::string& pointer) {
      uniqueNonEmpty(scene, "nodes", pointer);
      each(list(scene, "nodes"), pointer + "/nodes", [&](const json& node, const std::string& place) {
        if (parent_[node.get<std::size_t>()] != kNobody) error(place, "names a node that is another one's child");
      });
    });
  }

  void cameras() {
    constexpr double kAny = std::numeric_limits<double>::max();
    eachOf("cameras", [&](const json& camera, const std::string& pointer) {
      choice(camera, "type", pointer, {"perspective", "orthographic"});
      const bool perspective = member(camera, "type") == "perspective";
      if (!member(camera, "type").is_string()) error(pointer + "/type", "is missing");
      const char* key = perspective ? "perspective" : "orthographic";
      if (camera.contains("perspective") && camera.contains("orthographic")) error(pointer, "is of two kinds");
      const json& lens = member(camera, key);
      const std::string place = pointer + "/" + key;
      if (!lens.is_object()) return error(place, "is missing");
      if (perspective) {
        range(lens, "yfov", place, true, 0.0, kAny, true);
        range(lens, "aspectRatio", place, false, 0.0, kAny, true);
      } else {
        for (const char* side : {"xmag", "ymag"}) {
          range(lens, side, place, true, -kAny, kAny);
          if (number(lens, side) == 0.0) error(place + "/" + side, "is 0");
        }
      }
      range(lens, "znear", place, true, 0.0, kAny, perspective);
      range(lens, "zfar", place, !perspective, 0.0, kAny, true);
      const std::optional<double> near = number(lens, "znear"), far = number(lens, "zfar");
      if (near && far && *far <= *near) error(place + "/zfar", "is not beyond znear");
    });
  }

  // ---- What splats have no use for, and other readers may.

  void factors(const json& object, const char* key, std::size_t count, const std::string& pointer) {
    const json& values = member(object, key);
    if (values.is_null()) return;
    const auto good = [](const json& v) { return v.is_number() && v.get<double>() >= 0.0 && v.get<double>() <= 1.0; };
    if (values.is_array() && values.size() == count && std::ranges::all_of(values, good)) return;
    error(pointer + "/" + key, "wrong value (expected " + std::to_string(count) + " numbers from 0 to 1)");
  }

  void materials() {
    eachOf("materials", [&](const json& material, const std::string& pointer) {
      const json& pbr = member(material, "pbrMetallicRoughness");
      const std::string place = pointer + "/pbrMetallicRoughness";
      factors(pbr, "baseColorFactor", 4, place);
      factors(material, "emissiveFactor", 3, pointer);
      for (const char* key : {"metallicFactor", "roughnessFactor"}) range(pbr, key, place, false, 0.0, 1.0);
      range(material, "alphaCutoff", pointer, false, 0.0, std::numeric_limits<double>::max());
      choice(material, "alphaMode", pointer, {"OPAQUE", "MASK", "BLEND"});
      for (const char* key : {"normalTexture", "occlusionTexture", "emissiveTexture"}) {
        reference(member(material, key), "index", "textures", pointer + "/" + key);
      }
      for (const char* key : {"baseColorTexture", "metallicRoughnessTexture"}) {
        reference(member(pbr, key), "index", "textures", place + "/" + key);
      }
    });
  }

  void textures() {
    eachOf("textures", [&](const json& texture, const std::string& pointer) {
      reference(texture, "sampler", "samplers", pointer);
    });
    eachOf("samplers", [&](const json& sampler, const std::string& pointer) {
      for (const char* key : {"wrapS", "wrapT"}) choice(sampler, key, pointer, {10497, 33071, 33648});
      choice(sampler, "magFilter", pointer, {9728, 9729});
      choice(sampler, "minFilter", pointer, {9728, 9729, 9984, 9985, 9986, 9987});
    });
  }

  void skins() {
    const std::size_t nodes = list(root_, "nodes").size();
    eachOf("skins", [&](const json& skin, const std::string& pointer) {
      reference(skin, "inverseBindMatrices", "accessors", pointer);
      reference(skin, "skeleton", "nodes", pointer);
      if (!member(skin, "joints").is_array()) error(pointer + "/joints", "is missing");
      uniqueNonEmpty(skin, "joints", pointer);
      each(list(skin, "joints"), pointer + "/joints", [&](const json& joint, const std::string& place) {
        if (!joint.is_number_unsigned() || joint.get<std::uint64_t>() >= nodes) error(place, "names no node");
      });
    });
  }

  void animations() {
    eachOf("animations", [&](const json& animation, const std::string& pointer) {
      for (const char* key : {"channels", "samplers"}) {
        if (list(animation, key).empty()) error(pointer + "/" + key, "is empty or missing");
      }
      each(list(animation, "samplers"), pointer + "/samplers", [&](const json& sampler, const std::string& place) {
        for (const char* key : {"input", "output"}) reference(sampler, key, "accessors", place);
      });
      const std::size_t samplers = list(animation, "samplers").size();
      each(list(animation, "channels"), pointer + "/channels", [&](const json& channel, const std::string& place) {
        const json& sampler = member(channel, "sampler");
        if (!sampler.is_number_unsigned() || sampler.get<std::uint64_t>() >= samplers) {
          error(place + "/sampler", "names no sampler of the animation");
        }
        reference(member(channel, "target"), "node", "nodes", place + "/target");
      });
    });
  }

  const json& root_;
  const GltfDocument& document_;
  std::vector<std::string>& errors_;
  std::vector<std::string>& warnings_;
  std::vector<Use> uses_;                            // of each buffer view
  std::map<std::size_t, std::size_t> attribute_in_;  // of a buffer view without a stride, the accessor
  std::vector<std::size_t> parent_;                  // of each node, or kNobody
  std::set<std::string> colors_;                     // pointers of accessors that are the first colours
  std::uint64_t scan_left_ = 0;                      // [bytes]
};

}  // namespace

void checkCoreRules(const json& root, const GltfDocument& document, std::vector<std::string>& errors,
                    std::vector<std::string>& warnings) {
  CoreRules(root, document, errors, warnings).run();
}

}  // namespace tg
