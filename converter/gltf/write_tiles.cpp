// SPDX-License-Identifier: Apache-2.0
// 3D Tiles 1.1 (OGC 22-025r4) of one tile, and glTF around an SPZ.
#include "converter/gltf/write_tiles.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "converter/gltf/axes.h"
#include "converter/gltf/builder.h"
#include "converter/gltf/container.h"
#include "converter/gltf/document.h"
#include "converter/gltf/spz_extension.h"
#include "core/file/atomic_files.h"
#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;

constexpr float kReach = 3.0f;               // [sigma] viewers cut at sqrt(8)
constexpr float kLargestLogScale = 5.9375f;  // of SPZ's byte

const std::vector<std::string> kExtensions = {std::string(kSplatExtension), std::string(kSpzExtension)};

// Accessors without views: the SPZ has the numbers, readers ask here for their count and for the SH degree.
Json contentOf(const GaussianModel& model, std::size_t spz_bytes) {
  Json accessors = Json::array(), attributes = Json::object();
  const auto add = [&](const std::string& name, int component_type, const char* type) -> Json& {
    attributes[name] = accessors.size();
    accessors.push_back({{"componentType", component_type}, {"count", model.size()}, {"type", type}});
    return accessors.back();
  };
  glm::vec3 least = turnAxes(model.mean.front()), most = least;
  for (const glm::vec3& mean : model.mean) {
    least = glm::min(least, turnAxes(mean));
    most = glm::max(most, turnAxes(mean));
  }
  Json& position = add("POSITION", 5126, "VEC3");
  position["min"] = {least.x, least.y, least.z};
  position["max"] = {most.x, most.y, most.z};
  const std::string prefix = std::string(kSplatExtension) + ":";
  add(prefix + "ROTATION", 5126, "VEC4");
  add(prefix + "SCALE", 5126, "VEC3");
  add("COLOR_0", 5121, "VEC4")["normalized"] = true;
  for (int degree = 1; degree <= model.sh_degree; ++degree) {
    for (int k = 0; k <= 2 * degree; ++k) {
      add(prefix + "SH_DEGREE_" + std::to_string(degree) + "_COEF_" + std::to_string(k), 5126, "VEC3");
    }
  }
  Json splatting = {{"kernel", "ellipse"}, {"colorSpace", "srgb_rec709_display"}};
  splatting["extensions"][std::string(kSpzExtension)] = {{"bufferView", 0}};
  Json primitive = {{"mode", 0}, {"attributes", std::move(attributes)}};
  primitive["extensions"][std::string(kSplatExtension)] = std::move(splatting);
  Json root = {{"asset", {{"version", "2.0"}, {"generator", "Textured Gaussians tgconvert"}}},
               {"extensionsUsed", kExtensions},
               {"extensionsRequired", kExtensions},
               {"scene", 0}};
  root["scenes"] = Json::array({{{"nodes", {0}}}});
  root["nodes"] = Json::array({{{"name", "gaussians"}, {"mesh", 0}}});
  root["meshes"] = Json::array({{{"primitives", Json::array({std::move(primitive)})}}});
  root["accessors"] = std::move(accessors);
  root["bufferViews"] = Json::array({{{"buffer", 0}, {"byteLength", spz_bytes}}});
  root["buffers"] = Json::array({{{"byteLength", spz_bytes}}});
  return root;
}

std::vector<std::uint8_t> glbOf(const GaussianModel& model, const std::vector<std::uint8_t>& spz) {
  std::string text = dumpJson(contentOf(model, spz.size()));
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::size_t padded = (spz.size() + 3) / 4 * 4;
  std::vector<std::uint8_t> glb = glbHead(text, padded);
  glb.insert(glb.end(), spz.begin(), spz.end());
  glb.resize(glb.size() + padded - spz.size());
  return glb;
}

// A tile's z is up: glTF's y, the model's -y. The draft turns an SPZ half around that axis and CesiumJS does not, so
// the box lies alike on both sides of it.
Json tilesetOf(const GaussianModel& model, const std::string& content) {
  double right = 0, ahead = 0, least = INFINITY, most = -INFINITY;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const glm::dvec3 mean = model.mean[i];
    const glm::vec3& s = model.log_scale[i];
    const double reach = kReach * std::exp(double{std::min(std::max({s.x, s.y, s.z}), kLargestLogScale)});
    right = std::max(right, std::abs(mean.x) + reach);
    ahead = std::max(ahead, std::abs(mean.z) + reach);
    least = std::min(least, -mean.y - reach);
    most = std::max(most, -mean.y + reach);
  }
  const double middle = (least + most) / 2, half = (most - least) / 2;
  Json tile = {{"boundingVolume", {{"box", {0.0, 0.0, middle, right, 0.0, 0.0, 0.0, ahead, 0.0, 0.0, 0.0, half}}}},
               {"geometricError", 0.0},
               {"refine", "ADD"},
               {"content", {{"uri", content}}}};
  Json tileset = {{"asset", {{"version", "1.1"}}}, {"extensionsUsed", {"3DTILES_content_gltf"}}};
  tileset["extensions"]["3DTILES_content_gltf"] = {{"extensionsUsed", kExtensions},
                                                   {"extensionsRequired", kExtensions}};
  // [world units] what is missing where the tile is not drawn: all of it.
  tileset["geometricError"] = 2 * std::hypot(right, ahead, half);
  tileset["root"] = std::move(tile);
  return tileset;
}

std::span<const std::uint8_t> bytesOf(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

TilesReport writeTiles(const std::filesystem::path& path, const GaussianModel& model, bool replace) {
  if (model.size() == 0) throw Error(ErrorKind::badData, path.string(), "the model has no Gaussians");
  TilesReport report;
  const std::string name = path.filename().string();
  const std::string content = name.substr(0, name.size() - kTilesetName.size()) + "content.glb";
  const std::vector<std::uint8_t> glb = glbOf(model, formatSpz(model, path.string(), report.spz, kOldestSpz));
  const std::string tileset = dumpJson(tilesetOf(model, uriOf(content)), 2) + "\n";
  const std::filesystem::path folder = path.parent_path();
  FolderToFill filled(folder.empty() ? "." : folder);
  AtomicFiles files(replace);
  files.add(folder / content, glb);
  files.add(path, bytesOf(tileset));
  files.commit();
  filled.keep();
  report.bytes = glb.size() + tileset.size();
  return report;
}

}  // namespace tg
