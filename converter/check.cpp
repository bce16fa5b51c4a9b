// SPDX-License-Identifier: Apache-2.0
// Says what is wrong with a file, and where.
#include "converter/check.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "converter/gltf/document.h"
#include "converter/gltf/document_check.h"
#include "converter/gltf/read_gltf.h"
#include "converter/gltf/resolve.h"
#include "converter/registry/file_format.h"
#include "converter/registry/read_model.h"
#include "core/file/file.h"
#include "core/system/error.h"

namespace tg {
namespace {

using JsonNode = nlohmann::json;

constexpr std::uint64_t kMaxFileBytes = 0xFFFFFFFF;  // what a GLB header can say

// "path: /a/b: what" and "/a/b: what" taken apart.
Finding findingOf(std::string text, const std::string& path) {
  if (text.rfind(path + ": ", 0) == 0) text.erase(0, path.size() + 2);
  const std::size_t end = text.find(": ");
  if (text.empty() || text[0] != '/' || end == std::string::npos) return {"", text};
  return {text.substr(0, end), text.substr(end + 2)};
}

void addOnce(std::vector<Finding>& findings, Finding finding) {
  const bool known = std::any_of(findings.begin(), findings.end(), [&](const Finding& f) {
    return f.pointer == finding.pointer && f.message == finding.message;
  });
  if (!known) findings.push_back(std::move(finding));
}

// Reads the file; false when it was refused.
bool tryRead(const std::filesystem::path& path, bool base_only, CheckReport& report) {
  std::vector<std::string> errors;  // of a glTF file, more than one
  const auto note = [&] {
    for (const std::string& error : errors) addOnce(report.errors, findingOf(error, report.file));
  };
  try {
    ReadOptions options;
    options.base_only = base_only;
    const FileFormat format = detectFormat(path);
    const bool is_gltf = format == FileFormat::glb || format == FileFormat::gltf;
    Bundle loaded = is_gltf ? readGltf(path, options, &errors) : readModel(path, options);
    loaded.format = name(format);
    report.format = loaded.format;
    report.gaussians = loaded.model.size();
    for (const std::string& warning : loaded.warnings) addOnce(report.warnings, findingOf(warning, report.file));
    return true;
  } catch (const Error& error) {
    if (error.kind != ErrorKind::badData) throw;
    note();
    if (errors.empty()) addOnce(report.errors, findingOf(error.what(), report.file));
    return false;
  }
}

bool lists(const JsonNode& root, const char* key, std::string_view extension) {
  const JsonNode list = root.value(key, JsonNode::array());
  return std::find(list.begin(), list.end(), JsonNode(std::string(extension))) != list.end();
}

// glTF: elements of attributes start at multiples of 4 bytes.
void checkAlignment(const JsonNode& root, std::size_t index, CheckReport& report) {
  const JsonNode& accessor = root["accessors"][index];
  if (!accessor.contains("bufferView")) return;
  const JsonNode& view = root["bufferViews"][accessor["bufferView"].get<std::size_t>()];
  constexpr std::uint64_t bytes[] = {1, 1, 2, 2, 0, 4, 4};
  const std::string type = accessor["type"].get<std::string>();
  if (type.rfind("MAT", 0) == 0) return;  // no splat attribute
  const std::uint64_t components = type == "SCALAR" ? 1 : static_cast<std::uint64_t>(type.back() - '0');
  const std::uint64_t element = bytes[accessor["componentType"].get<std::size_t>() - 5120] * components;
  const std::uint64_t stride = view.value("byteStride", element);
  const std::uint64_t offset =
      accessor.value("byteOffset", std::uint64_t{0}) + view.value("byteOffset", std::uint64_t{0});
  if (offset % 4 == 0 && stride % 4 == 0) return;
  addOnce(report.errors, {"/accessors/" + std::to_string(index),
                          "elements of an attribute do not start at multiples of 4 bytes (found offset " +
                              std::to_string(offset) + ", stride " + std::to_string(stride) + ")"});
}

// What reading gets by without. The document has passed checkGltfJson.
void checkOverlooked(const JsonNode& root, CheckReport& report) {
  const std::string khr(kSplatExtension), ours(kTextureExtension);
  bool textured = false;
  for (const JsonNode& mesh : root["meshes"]) {
    for (const JsonNode& primitive : mesh["primitives"]) {
      const JsonNode extensions = primitive.value("extensions", JsonNode::object());
      if (!extensions.contains(khr)) continue;
      const JsonNode nested = extensions[khr].value("extensions", JsonNode::object());
      textured = textured || nested.contains(ours);
      for (const auto& [semantic, accessor] : primitive["attributes"].items()) {
        checkAlignment(root, accessor.get<std::size_t>(), report);
      }
    }
  }
  for (const std::string& extension : {khr, ours}) {
    if ((extension == khr || textured) && !lists(root, "extensionsUsed", extension)) {
      addOnce(report.errors, {"/extensionsUsed", extension + " is used and not listed"});
    }
    if (lists(root, "extensionsRequired", extension)) {
      addOnce(report.warnings,
              {"/extensionsRequired", extension + " is listed: loaders that could show the rest refuse the file"});
    }
  }
}

// The JSON of a file whose structure is sound, in one piece.
JsonNode readStructure(const std::filesystem::path& path, const CheckReport& report) {
  std::vector<std::uint8_t> bytes = readFile(path, kMaxFileBytes);
  const auto split = [&] {
    GltfParts parts;
    parts.json = bytes;
    return report.format == "glb" || (bytes.size() > 4 && std::memcmp(bytes.data(), "glTF", 4) == 0)
               ? splitGlb(bytes, bytes.size(), report.file)
               : parts;
  };
  GltfParts parts = split();
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  if (std::optional<std::vector<std::uint8_t>> resolved = resolveGltf(bytes, parts, folder, report.file)) {
    bytes = std::move(*resolved);
    parts = split();
  }
  JsonNode root = parseGltfJson(parts.json, report.file);
  checkGltfJson(root, parts, report.file);
  return root;
}

using OrderedJson = nlohmann::ordered_json;

OrderedJson toJson(const std::vector<Finding>& findings) {
  OrderedJson list = OrderedJson::array();
  for (const Finding& finding : findings) {
    OrderedJson entry;
    entry["pointer"] = finding.pointer;
    entry["message"] = finding.message;
    list.push_back(std::move(entry));
  }
  return list;
}

}  // namespace

CheckReport checkFile(const std::filesystem::path& path) {
  CheckReport report;
  report.file = path.string();
  bool is_gltf = false;
  try {
    const FileFormat format = detectFormat(path);
    is_gltf = format == FileFormat::glb || format == FileFormat::gltf;
    report.format = name(format);
  } catch (const Error& error) {
    if (error.kind != ErrorKind::badData) throw;
    addOnce(report.errors, findingOf(error.what(), report.file));
    return report;
  }
  tryRead(path, true, report);
  if (!is_gltf) return report;
  tryRead(path, false, report);
  try {
    checkOverlooked(readStructure(path, report), report);
  } catch (const Error& error) {
    addOnce(report.errors, findingOf(error.what(), report.file));
  }
  return report;
}

std::string describe(const CheckReport& report) {
  std::string text;
  const auto add = [&](const char* severity, const Finding& finding) {
    text +=
        std::string(severity) + ": " + (finding.pointer.empty() ? "" : finding.pointer + ": ") + finding.message + "\n";
  };
  for (const Finding& finding : report.errors) add("error", finding);
  for (const Finding& finding : report.warnings) add("warning", finding);
  text += report.file + ": " + (report.errors.empty() ? "valid" : "not valid") + ", " +
          std::to_string(report.errors.size()) + " errors, " + std::to_string(report.warnings.size()) + " warnings\n";
  return text;
}

std::string describeJson(const CheckReport& report) {
  OrderedJson json;
  json["file"] = report.file;
  json["format"] = report.format;
  json["valid"] = report.errors.empty();
  json["gaussians"] = report.gaussians;
  json["errors"] = toJson(report.errors);
  json["warnings"] = toJson(report.warnings);
  return json.dump(2, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

}  // namespace tg
