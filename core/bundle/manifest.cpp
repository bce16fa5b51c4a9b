// SPDX-License-Identifier: Apache-2.0
// Writing and checking manifest.json.
#include "core/bundle/manifest.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <unordered_set>

#include "core/file/json.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr const char* kFormat = "textured-gaussians";
constexpr const char* kFormatVersion = "1.0";
constexpr std::size_t kMaxFiles = 4096;

// What a version 1 model means and every renderer here does. Another value would show a wrong picture: refused.
struct FixedValue {
  const char* key;
  const char* value;
};
constexpr FixedValue kFixedSampling[] = {
    {"filter", "bilinear"},  // four taps
    {"sampling", "corner"},  // texel 0 on -extent, the last texel on +extent
};
constexpr FixedValue kFixedSpace[] = {
    {"uvOrder", "axisIndex"},               // u, v: the axes other than the shortest, lower index first
    {"axes", "rdf"},                        // x right, y down, z forward
    {"colorSpace", "srgb_rec709_display"},  // of the blended numbers: as displayed
    {"antialias", "none"},                  // no low-pass at render time
};

const std::array<const char*, 4> kAtlasChannels = {"R", "G", "B", "alpha"};

std::string roleOf(const std::string& name) {
  if (name == kGaussiansName) return "gaussians";
  if (name == kRectsName) return "rectangles";
  if (name == kAtlasIdName) return "pages";
  if (name == kCamerasName) return "cameras";
  if (name == kTrainingName) return "training";
  if (name == kPreviewName) return "preview";
  return "atlas";
}

void parseFixed(const JsonNode& root, std::span<const FixedValue> values) {
  for (const FixedValue& fixed : values) {
    const std::string found = root.string(fixed.key);
    if (found != fixed.value) {
      root.fail(std::string("\"") + fixed.key + "\": not supported (expected \"" + fixed.value + "\", found \"" +
                found + "\")");
    }
  }
}

void parseExtent(const JsonNode& root) {
  const double extent = root.number("extent");
  if (extent != double{kTextureExtent}) {
    root.fail("\"extent\": not supported (expected " + std::to_string(kTextureExtent) + ", found " +
              std::to_string(extent) + ")");
  }
}

template <Named E>
E parseName(const JsonNode& root, const char* key) {
  const std::string text = root.string(key);
  const std::optional<E> value = parse<E>(text);
  if (!value) root.fail("\"" + std::string(key) + "\": expected " + allNames<E>() + ", found \"" + text + "\"");
  return *value;
}

void parseVersion(const JsonNode& root) {
  if (!root.value.is_object() || !root.has("format") || root.value["format"] != kFormat) {
    root.fail(std::string("not a bundle (expected \"format\": \"") + kFormat + "\")");
  }
  const std::string version = root.string("formatVersion");
  if (version.substr(0, version.find('.')) != "1") {
    root.fail("unknown format version (expected 1.x, found " + version.substr(0, 20) + ")");
  }
}

void parseAtlas(const JsonNode& root, Manifest& manifest) {
  const JsonNode counts{root.member("counts"), root.path, "counts"};
  manifest.atlas_pages = static_cast<int>(counts.integer("atlasPages", 0, kMaxAtlasPages));
  if (manifest.atlas_pages == 0) return;
  const JsonNode atlas{root.member("atlas"), root.path, "atlas"};
  manifest.atlas_width = static_cast<int>(atlas.integer("width", 1, kMaxAtlasPageSide));
  manifest.atlas_height = static_cast<int>(atlas.integer("height", 1, kMaxAtlasPageSide));
  const nlohmann::json channels = kAtlasChannels;
  if (atlas.has("channels") && atlas.value["channels"] != channels) {
    atlas.fail("\"channels\": not supported" + expectedFound(channels.dump(), atlas.at("channels").shown()));
  }
  if (atlas.has("associatedAlpha") && atlas.boolean("associatedAlpha")) {
    atlas.fail("\"associatedAlpha\": not supported" + expectedFound("false", "true"));
  }
}

void parseFiles(const JsonNode& root, Manifest& manifest) {
  const nlohmann::json& files = root.list("files", kMaxFiles);
  std::unordered_set<std::string> names;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const JsonNode file{files[i], root.path, "file " + std::to_string(i)};
    ManifestFile entry{file.string("name"), 0, file.string("sha256")};
    entry.bytes = static_cast<std::uint64_t>(file.integer("bytes", 0, std::int64_t{1} << 53));
    const auto isHex = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
    if (entry.sha256.size() != 64 || !std::all_of(entry.sha256.begin(), entry.sha256.end(), isHex)) {
      file.fail("\"sha256\": expected 64 lower-case hexadecimal digits");
    }
    if (!names.insert(entry.name).second) file.fail("is listed twice");
    manifest.files.push_back(std::move(entry));
  }
}

void checkFiles(const JsonNode& root, const Manifest& manifest) {
  const auto requireListed = [&](const std::string& name) {
    if (!manifest.find(name)) root.fail("\"files\": lacks " + name);
  };
  requireListed(kGaussiansName);
  if ((manifest.find(kRectsName) != nullptr) != (manifest.find(kAtlasIdName) != nullptr)) {
    root.fail(std::string("\"files\": ") + kRectsName + " and " + kAtlasIdName + " belong together");
  }
  if (manifest.atlas_pages > 0) requireListed(kRectsName);
  int pages = 0;
  for (const ManifestFile& file : manifest.files) pages += atlasPageNumber(file.name).has_value();
  for (int page = 0; page < manifest.atlas_pages; ++page) requireListed(atlasPageName(page));
  if (pages != manifest.atlas_pages) {
    root.fail("\"files\": wrong number of atlas pages" + expectedFound(manifest.atlas_pages, pages));
  }
  if (manifest.cameras > 0) requireListed(kCamerasName);
}

}  // namespace

std::string atlasPageName(int page) {
  TG_ASSERT(page >= 0 && page < kMaxAtlasPages, "a page from 0 to 254");
  char name[32];
  std::snprintf(name, sizeof(name), "atlas_%03d.exr", page);
  return name;
}

std::optional<int> atlasPageNumber(const std::string& name) {
  for (int page = 0; page < kMaxAtlasPages; ++page) {
    if (name == atlasPageName(page)) return page;
  }
  return std::nullopt;
}

const ManifestFile* Manifest::find(const std::string& name) const {
  const auto found = std::find_if(files.begin(), files.end(), [&](const ManifestFile& f) { return f.name == name; });
  return found == files.end() ? nullptr : &*found;
}

std::string formatManifest(const Manifest& manifest) {
  nlohmann::ordered_json root;
  root["format"] = kFormat;
  root["formatVersion"] = kFormatVersion;
  root["generator"] = "textured-gaussians " TG_VERSION;
  root["counts"] = {
      {"gaussians", manifest.gaussians}, {"atlasPages", manifest.atlas_pages}, {"cameras", manifest.cameras}};
  root["shDegree"] = manifest.sh_degree;
  root["mode"] = name(manifest.mode);
  root["intersection"] = name(manifest.intersection);
  root["extent"] = double{kTextureExtent};
  for (const FixedValue& fixed : kFixedSampling) root[fixed.key] = fixed.value;
  root["outside"] = name(manifest.outside);
  for (const FixedValue& fixed : kFixedSpace) root[fixed.key] = fixed.value;
  root["units"] = "dataset";
  root["background"] = {manifest.background.r, manifest.background.g, manifest.background.b};
  if (manifest.atlas_pages > 0) {
    root["atlas"] = {{"width", manifest.atlas_width},
                     {"height", manifest.atlas_height},
                     {"channels", kAtlasChannels},
                     {"associatedAlpha", false}};
  }
  root["files"] = nlohmann::ordered_json::array();
  for (const ManifestFile& file : manifest.files) {
    root["files"].push_back(
        {{"name", file.name}, {"role", roleOf(file.name)}, {"bytes", file.bytes}, {"sha256", file.sha256}});
  }
  return dumpJson(root, 1) + "\n";
}

Manifest parseManifest(const std::string& json, const std::string& path) {
  const nlohmann::json value = parseJson(json, path);
  const JsonNode root{value, path, ""};
  parseVersion(root);
  parseFixed(root, kFixedSampling);
  parseFixed(root, kFixedSpace);
  parseExtent(root);
  Manifest manifest;
  const JsonNode counts{root.member("counts"), path, "counts"};
  manifest.gaussians = static_cast<std::uint64_t>(counts.integer("gaussians", 0, kMaxGaussians));
  manifest.cameras = static_cast<std::uint64_t>(counts.integer("cameras", 0, 1 << 24));
  manifest.sh_degree = static_cast<int>(root.integer("shDegree", 0, 3));
  manifest.mode = parseName<TextureMode>(root, "mode");
  manifest.intersection = parseName<IntersectionModel>(root, "intersection");
  if (root.has("outside")) manifest.outside = parseName<TextureOutside>(root, "outside");
  const std::array<double, 3> background = root.numbers<3>("background");
  manifest.background = {background[0], background[1], background[2]};
  for (int c = 0; c < 3; ++c) {
    if (!std::isfinite(manifest.background[c])) root.fail("\"background\": expected a float");
  }
  parseAtlas(root, manifest);
  parseFiles(root, manifest);
  checkFiles(root, manifest);
  return manifest;
}

}  // namespace tg
