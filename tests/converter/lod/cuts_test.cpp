// SPDX-License-Identifier: Apache-2.0
// Levels are chosen here as web/src/lod.js chooses them, which made the cases: `node tests/web/lod_test.mjs
// tests/goldens/lod_cuts.json --make`.
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "converter/lod/lod_scene.h"
#include "core/file/file.h"
#include "support/catch.h"

using namespace tg;

namespace {

constexpr const char* kCases = "tests/goldens/lod_cuts.json";

Pinhole cameraOf(const nlohmann::json& json) {
  Pinhole camera;
  const char* rows[] = {"right", "down", "forward"};
  for (int k = 0; k < 3; ++k) {
    for (int c = 0; c < 3; ++c) camera.rotation[c][k] = json[rows[k]][static_cast<std::size_t>(c)];
    camera.translation[k] = json["translation"][static_cast<std::size_t>(k)];
  }
  camera.focal = {json["fx"], json["fy"]};
  camera.center = {json["cx"], json["cy"]};
  camera.size = {json["width"], json["height"]};
  return camera;
}

}  // namespace

TEST_CASE("levels are those that the web package chooses, whatever the camera and the budget") {
  const std::vector<std::uint8_t> bytes = readFile(kCases, 1u << 20);
  const nlohmann::json scenes = nlohmann::json::parse(bytes);
  REQUIRE(scenes.size() > 2);
  std::set<std::vector<std::uint8_t>> choices;
  for (const nlohmann::json& entry : scenes) {
    const std::string meta = entry["meta"].dump();
    const LodScene scene = parseLodScene({reinterpret_cast<const std::uint8_t*>(meta.data()), meta.size()}, kCases);
    for (const nlohmann::json& cut : entry["cuts"]) {
      INFO(cut.dump());
      const std::vector<std::uint8_t> levels = chooseLevels(scene, cameraOf(cut["camera"]), cut["budget"]);
      CHECK(levels == cut["levels"].get<std::vector<std::uint8_t>>());
      choices.insert(levels);
    }
  }
  CHECK(choices.size() > 10);
}
