// SPDX-License-Identifier: Apache-2.0
// Scenes in levels of detail for tests: trees without files, and written ones.
#pragma once
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "converter/lod/lod_scene.h"

// Leaves of one unit on a grid of `side` x `side` in the plane z = 0, at every level a quarter of the Gaussians of the
// finer one, `finest` at level 0; a file a level.
inline nlohmann::ordered_json gridOfLeaves(int side, int levels, int finest) {
  nlohmann::ordered_json meta = {{"lodLevels", levels}, {"filenames", nlohmann::ordered_json::array()}};
  for (int k = 0; k < levels; ++k) meta["filenames"].push_back(std::to_string(k) + "_0/meta.json");
  nlohmann::ordered_json children = nlohmann::ordered_json::array();
  for (int i = 0; i < side * side; ++i) {
    const int x = i % side, y = i / side;
    nlohmann::ordered_json lods = nlohmann::ordered_json::object();
    for (int k = 0, count = finest; k < levels; ++k, count /= 4) {
      lods[std::to_string(k)] = {{"file", k}, {"offset", i * count}, {"count", count}};
    }
    children.push_back({{"bound", {{"min", {x, y, 0}}, {"max", {x + 1, y + 1, 0}}}}, {"lods", lods}});
  }
  meta["tree"] = {{"bound", {{"min", {0, 0, 0}}, {"max", {side, side, 0}}}}, {"children", children}};
  return meta;
}

inline tg::LodScene sceneOf(const nlohmann::ordered_json& meta) {
  const std::string text = meta.dump();
  return tg::parseLodScene({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "s/lod-meta.json");
}

// A camera `distance` in front of (x, y) in the plane of gridOfLeaves, looking at it.
inline tg::Camera cameraAbove(double x, double y, double distance, int width = 640, int height = 480) {
  tg::Camera camera = tg::lookAt({x, y, -distance}, {x, y, 0}, {0, -1, 0}, 0.9, width, height);
  return camera;
}

// The whole scene at one level.
inline tg::GaussianModel wholeLevel(const std::filesystem::path& path, int level) {
  const tg::LodScene scene = tg::readLodScene(path);
  const tg::LodReader reader = tg::lodFolderReader(path);
  const std::vector<std::uint8_t> levels = tg::sameLevel(scene, level);
  std::vector<tg::GaussianModel> files(scene.files.size());
  for (const std::uint32_t file : tg::filesOf(scene, levels)) files[file] = tg::readLodFile(scene, file, reader).model;
  return tg::assembleLod(scene, levels, [&](std::uint32_t file) -> const tg::GaussianModel& { return files[file]; });
}
