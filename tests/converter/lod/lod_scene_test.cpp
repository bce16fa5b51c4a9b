// SPDX-License-Identifier: Apache-2.0
// lod-meta.json: what is read, what is refused, and which level of which leaf a picture gets.
#include "converter/lod/lod_scene.h"

#include <functional>
#include <limits>
#include <string>

#include "converter/lod/lod_scenes.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;

namespace {

using Json = nlohmann::ordered_json;

std::string refusal(const std::function<void(Json&)>& change) {
  Json meta = gridOfLeaves(2, 3, 64);
  change(meta);
  return test::messageOf([&] { sceneOf(meta); });
}

Json& firstLeaf(Json& meta) { return meta["tree"]["children"][0]; }

// Another program's file, as the format's own description shows it.
const char* const kForeign = R"({
  "version": 1, "asset": {"generator": "a test"}, "count": 1500, "counts": [1000, 500], "lodLevels": 2,
  "filenames": ["0_0/meta.json", "far/1_0/meta.json"],
  "tree": {"bound": {"min": [-10, 0, -10], "max": [10, 5, 10]}, "children": [
    {"bound": {"min": [-10, 0, -10], "max": [0.5, 5, 10]},
     "lods": {"0": {"file": 0, "offset": 0, "count": 600}, "1": {"file": 1, "offset": 0, "count": 500}}},
    {"bound": {"min": [0.5, 0, -10], "max": [10, 4.5, 10]}, "lods": {"0": {"file": 0, "offset": 600, "count": 400}}},
    {"bound": {"min": [0, 0, 0], "max": [0, 0, 0]}, "lods": {"0": {"file": 0, "offset": 0, "count": 0}}}
  ]}})";

}  // namespace

TEST_CASE("levels of detail: another program's lod-meta.json is read as its description says") {
  const LodScene scene = sceneOf(Json::parse(kForeign));
  CHECK(scene.levels == 2);
  CHECK(scene.files == std::vector<std::string>{"0_0/meta.json", "far/1_0/meta.json"});
  CHECK(scene.file_counts == std::vector<std::uint32_t>{1000, 500});
  REQUIRE(scene.leaves.size() == 2);  // one of nothing is none
  CHECK(scene.leaves[0].bound.low == glm::vec3(-10, 0, -10));
  CHECK(scene.leaves[1].bound.high == glm::vec3(10, 4.5, 10));
  CHECK(scene.leaves[1].means.high == glm::vec3(10, 4.5, 10));
  CHECK(scene.leaves[0].levels == std::vector<LodRange>{{0, 0, 600}, {1, 0, 500}});
  // A level that is not there is the next finer one: nothing of the scene is missing anywhere.
  CHECK(scene.leaves[1].levels == std::vector<LodRange>{{0, 600, 400}, {0, 600, 400}});
  CHECK(scene.counts == std::vector<std::uint64_t>{1000, 900});
  CHECK(scene.warnings.empty());
  CHECK(!scene.sh_degree);
  CHECK(scene.cameras.empty());
}

TEST_CASE("levels of detail: counts that are not the tree's are a warning") {
  Json meta = Json::parse(kForeign);
  const auto warnings = [&] { return sceneOf(meta).warnings; };
  meta["counts"][0] = 1001;
  CHECK(warnings() ==
        std::vector<std::string>{"\"counts\" is not what the tree holds (expected [1000,500], found [1001,500])"});
  meta["counts"] = {1000};
  CHECK(warnings().size() == 1);
  meta["counts"] = "1000";
  CHECK(warnings().size() == 1);
  meta.erase("counts");
  CHECK(warnings().empty());
}

TEST_CASE("levels of detail: a count that is not the tree's is a warning") {
  Json meta = Json::parse(kForeign);
  const auto warnings = [&] { return sceneOf(meta).warnings; };
  meta["count"] = 1501;
  CHECK(warnings() == std::vector<std::string>{"\"count\" is not what the tree holds (expected 1500, found 1501)"});
  meta["count"] = "1500";
  CHECK(warnings().size() == 1);
  meta["count"] = 1500.0;
  CHECK(warnings().empty());
  meta.erase("count");
  CHECK(warnings().empty());
}

TEST_CASE("levels of detail: levels beyond those of the scene are a warning") {
  Json meta = gridOfLeaves(2, 3, 64);
  for (Json& leaf : meta["tree"]["children"]) leaf["lods"]["3"] = leaf["lods"]["2"];
  firstLeaf(meta)["lods"]["extras"] = Json::object();  // no level at all
  const LodScene scene = sceneOf(meta);
  CHECK(scene.levels == 3);
  CHECK(scene.warnings == std::vector<std::string>{
                              "levels that \"lodLevels\" does not count are left out (expected 0 to 2, found \"3\")"});
}

TEST_CASE("levels of detail: a leaf without the finer levels has its finest one there") {
  Json meta = gridOfLeaves(1, 3, 64);
  firstLeaf(meta)["lods"].erase("0");
  const LodScene scene = sceneOf(meta);
  CHECK(scene.leaves[0].levels == std::vector<LodRange>{{1, 0, 16}, {1, 0, 16}, {2, 0, 4}});
}

TEST_CASE("levels of detail: a file's name may have spaces and letters beyond ASCII") {
  Json meta = gridOfLeaves(1, 3, 64);
  meta["filenames"][0] = "./a b (1)+2/m\u00e9ta \u96ea.json";
  CHECK(sceneOf(meta).files[0] == "a b (1)+2/m\u00e9ta \u96ea.json");
}

TEST_CASE("levels of detail: a hostile lod-meta.json is refused in words") {
  CHECK(refusal([](Json&) {}) == "accepted");
  for (const char* name :
       {"../../x", "/etc/passwd",       "a/../b",     "a//b", "",     ".",     "a/",     "https://a/b", "a\\b",
        "a:b",     ".hidden/meta.json", "%2e%2e/x",   "./",   ".//a", "././a", "./../a", " /../a",      "a?b",
        "a#b",     "a\x1b[m",           "a\xc2\x9b[m"}) {
    CAPTURE(name);
    const std::string said = refusal([&](Json& meta) { meta["filenames"][0] = name; });
    CHECK(said.starts_with("s/lod-meta.json: "));
    CHECK(said.find("a file's name leaves the folder") != std::string::npos);
    CHECK(said.find('\n') == std::string::npos);
  }
  CHECK(refusal([](Json& meta) { meta["filenames"][0] = std::string(5000, 'a'); }).find("a file's name leaves") !=
        std::string::npos);
  const auto says = [](const std::string& said, const std::string& what) {
    CAPTURE(said, what);
    CHECK(said.starts_with("s/lod-meta.json: "));
    CHECK(said.find(what) != std::string::npos);
  };
  says(refusal([](Json& meta) { meta["filenames"][1] = "far/1_0.SOG"; }),
       "filenames/1: is a bundled SOG (expected the meta.json of one that is not, found \"far/1_0.SOG\")");
  says(refusal([](Json& meta) { meta["filenames"][2] = "./" + meta["filenames"][0].get<std::string>(); }),
       "filenames/2: names a file a second time (expected each once, found \"");
  says(refusal([](Json& meta) { meta["version"] = 2; }), "version");
  says(refusal([](Json& meta) { meta.erase("tree"); }), "tree");
  says(refusal([](Json& meta) { meta.erase("lodLevels"); }), "lodLevels");
  says(refusal([](Json& meta) { meta["lodLevels"] = 1000000000; }), "lodLevels");
  says(refusal([](Json& meta) { meta["lodLevels"] = 0; }), "lodLevels");
  says(refusal([](Json& meta) { meta["filenames"] = Json::array(); }), "wrong number of files");
  says(refusal([](Json& meta) { meta["tree"].erase("children"); }), "the tree has no leaves");
  says(refusal([](Json& meta) { firstLeaf(meta)["lods"]["0"]["file"] = 3; }), "file");
  says(refusal([](Json& meta) { firstLeaf(meta)["lods"]["0"]["file"] = -1; }), "file");
  says(refusal([](Json& meta) { firstLeaf(meta)["lods"]["0"]["count"] = 4000000000u; }), "count");
  says(refusal([](Json& meta) { firstLeaf(meta)["lods"]["0"]["offset"] = 4294967295u; }), "offset");
  says(refusal([](Json& meta) { firstLeaf(meta)["lods"]["0"] = {{"file", 0}, {"offset", 63'999'999}, {"count", 2}}; }),
       "count");
  says(refusal([](Json& meta) { firstLeaf(meta)["lods"]["0"] = 7; }), "lods");
  says(refusal([](Json& meta) {
         for (int k = 0; k < 3; ++k) meta["tree"]["children"].push_back(firstLeaf(meta));
       }),
       "overlap");
  says(refusal([](Json& meta) {  // nor where one range, of a file that is not there, names more than all others
         for (int k = 0; k < 3; ++k) meta["tree"]["children"].push_back(firstLeaf(meta));
         meta["filenames"].push_back("none/meta.json");
         Json leaf = firstLeaf(meta);
         leaf["lods"] = {{"0", {{"file", meta["filenames"].size() - 1}, {"offset", 0}, {"count", 1'000'000}}}};
         meta["tree"]["children"].push_back(leaf);
       }),
       "overlap");
  says(refusal([](Json& meta) {  // of 64 Gaussians each, the second leaf's as the first's: a gap makes up for it
         meta["tree"]["children"][1]["lods"]["0"]["offset"] = 0;
       }),
       "overlap in 0_0/meta.json (expected one from 64 on, found 0)");
  says(refusal([](Json& meta) { firstLeaf(meta).erase("bound"); }), "bound");
  says(refusal([](Json& meta) { firstLeaf(meta)["bound"]["min"] = {0, 0}; }), "min");
  says(refusal([](Json& meta) { firstLeaf(meta)["bound"]["min"][1] = 9; }), "min is beyond max");
  says(refusal([](Json& meta) { firstLeaf(meta)["bound"]["max"][1] = 1e300; }), "max");
  says(refusal([](Json& meta) {
         Json node = firstLeaf(meta);
         for (int k = 0; k < 100; ++k) node = Json{{"children", Json::array({node})}};
         meta["tree"] = node;
       }),
       "nests too deep");
}

TEST_CASE("levels of detail: every leaf has one level, within the budget, and more budget never shows less") {
  const LodScene scene = sceneOf(gridOfLeaves(8, 4, 4096));  // 64 leaves: 262,144, 65,536, 16,384 and 4,096
  const Camera camera = cameraAbove(3.3, 4.1, 3.0);
  CHECK(chooseLevels(scene, camera, 0) == sameLevel(scene, 3));
  CHECK(chooseLevels(scene, camera, 4096) == sameLevel(scene, 3));
  std::vector<std::uint8_t> last = sameLevel(scene, 3);
  for (const std::uint64_t budget : {4096u, 6000u, 10'000u, 11'000u, 30'000u, 100'000u, 262'144u}) {
    const std::vector<std::uint8_t> levels = chooseLevels(scene, camera, budget, 0.0);
    CAPTURE(budget);
    REQUIRE(levels.size() == scene.leaves.size());
    for (std::size_t i = 0; i < levels.size(); ++i) CHECK(levels[i] <= last[i]);
    CHECK(countOf(scene, levels) <= budget);
    CHECK(chooseLevels(scene, camera, budget, 0.0) == levels);
    last = levels;
  }
  const Camera far = cameraAbove(4, 4, 30.0);  // sees all leaves
  CHECK(chooseLevels(scene, far, 262'144, 0.0) == sameLevel(scene, 0));
}

TEST_CASE("levels of detail: what is nearer is finer, and what is out of view stays coarse") {
  const LodScene scene = sceneOf(gridOfLeaves(16, 4, 4096));
  Camera camera = lookAt({8, -2, -1}, {8, 8, 0}, {0, 0, -1}, 0.9, 640, 480);  // along the plane
  const std::vector<std::uint8_t> levels = chooseLevels(scene, camera, 200'000);
  for (int x = 4; x < 12; ++x) {
    for (int y = 1; y < 16; ++y) {
      CAPTURE(x, y);
      if (levels[16 * (y - 1) + x] == 3 && levels[16 * y + x] < 3) CHECK(y < 4);  // only at the picture's rim
      if (y >= 4) CHECK(levels[16 * (y - 1) + x] <= levels[16 * y + x]);
    }
  }
  CHECK(levels[16 * 4 + 8] < levels[16 * 15 + 8]);
  camera = lookAt({8, -2, -1}, {8, -12, 0}, {0, 0, -1}, 0.9, 640, 480);  // the other way
  CHECK(chooseLevels(scene, camera, 200'000) == sameLevel(scene, 3));
}

TEST_CASE("levels of detail: no leaf is finer than a pixel can show") {
  const LodScene scene = sceneOf(gridOfLeaves(4, 4, 4096));
  const std::uint64_t all = std::numeric_limits<std::uint64_t>::max();
  // From so far that a leaf of one unit is 4 pixels wide: 16 Gaussians are enough, of which level 3 has 64.
  const Camera far = cameraAbove(2, 2, 496.8 / 4);
  CHECK(chooseLevels(scene, far, all) == sameLevel(scene, 3));
  CHECK(chooseLevels(scene, far, all, 0.01) == sameLevel(scene, 0));
  CHECK(chooseLevels(scene, cameraAbove(2, 2, 5.0), all) == sameLevel(scene, 0));
}

TEST_CASE("levels of detail: among equal leaves the first one in the tree is refined first") {
  const LodScene scene = sceneOf(gridOfLeaves(2, 2, 64));  // 4 leaves of 64 or 16
  const std::vector<std::uint8_t> levels = chooseLevels(scene, cameraAbove(1, 1, 5.0), 64 + 48 + 48, 0.0);
  CHECK(levels == std::vector<std::uint8_t>{0, 0, 1, 1});
}

TEST_CASE("levels of detail: how fine a leaf is goes by its Gaussians' means, whether it is in view by all they show") {
  Json meta = gridOfLeaves(2, 3, 64);
  for (Json& leaf : meta["tree"]["children"]) {
    leaf["TG_means"] = leaf["bound"];
    leaf["bound"] = {{"min", {-100, -100, -100}}, {"max", {100, 100, 100}}};
  }
  const LodScene scene = sceneOf(meta);
  CHECK(scene.leaves[3].means.low == glm::vec3(1, 1, 0));
  CHECK(scene.leaves[3].bound.low == glm::vec3(-100));
  // Seen from the side of (0, 0): the nearest leaf comes first, also with the picture beside all means.
  const Camera beside = lookAt({-1, -1, -0.5}, {-1, -1, 5}, {0, -1, 0}, 0.9, 640, 480);
  CHECK(chooseLevels(scene, beside, 4 * 4 + 12, 0.0) == std::vector<std::uint8_t>{1, 2, 2, 2});
  CHECK(chooseLevels(sceneOf(gridOfLeaves(2, 3, 64)), beside, 4 * 4 + 12, 0.0) == sameLevel(scene, 2));
}

TEST_CASE("levels of detail: the files of a choice are each named once, in order") {
  const LodScene scene = sceneOf(gridOfLeaves(2, 3, 64));
  CHECK(filesOf(scene, sameLevel(scene, 1)) == std::vector<std::uint32_t>{1});
  CHECK(filesOf(scene, std::vector<std::uint8_t>{2, 0, 0, 2}) == std::vector<std::uint32_t>{0, 2});
  CHECK(countOf(scene, std::vector<std::uint8_t>{2, 0, 0, 2}) == 4 + 64 + 64 + 4);
}
