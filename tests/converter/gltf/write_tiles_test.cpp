// SPDX-License-Identifier: Apache-2.0
// 3D Tiles: what is written, and what is read.
#include "converter/gltf/write_tiles.h"

#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "converter/check.h"
#include "converter/convert.h"
#include "converter/formats/spz.h"
#include "converter/glb.h"
#include "converter/gltf/read_tiles.h"
#include "converter/gltf/write_gltf.h"
#include "converter/registry/file_format.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "core/bundle/bundle.h"
#include "core/model/verbs.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;
using tg::test::SceneKind;

namespace {

namespace fs = std::filesystem;

GaussianModel splats(int degree) {
  GaussianModel model = withoutTextures(test::makeScene(SceneKind::ordinary, 8, 40).model);
  setShDegree(model, degree);
  return model;
}

std::size_t filesIn(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

}  // namespace

TEST_CASE("a tileset names a GLB that is valid and holds the numbers of an SPZ of version 3") {
  for (const int degree : {0, 1, 2, 3}) {
    CAPTURE(degree);
    const Scratch scratch;
    const GaussianModel model = splats(degree);
    const fs::path path = scratch.folder() / "new/tileset.json";
    const TilesReport report = writeTiles(path, model);
    const fs::path content = scratch.folder() / "new/content.glb";
    CHECK(report.bytes == fs::file_size(path) + fs::file_size(content));
    const CheckReport checked = checkFile(content);
    CHECK(checked.errors.empty());
    CHECK(checked.warnings.empty());
    writeSpz(scratch.folder() / "direct.spz", model, 3);
    const GaussianModel direct = readModel(scratch.folder() / "direct.spz").model;
    const GaussianModel back = readModel(content).model;
    CHECK(back.sh_degree == degree);
    REQUIRE(back.size() == direct.size());
    CHECK(back.mean == direct.mean);
    CHECK(back.log_scale == direct.log_scale);
    for (std::size_t i = 0; i < back.size(); ++i) {  // glTF's reader takes opacities, not logits
      CHECK(back.opacity_logit[i] == Approx(direct.opacity_logit[i]).margin(1e-5));
    }
    CHECK(back.sh == direct.sh);
    const Glb glb = Glb::read(content);
    CHECK(glb.bin.starts_with("\x1f\x8b"));  // gzip: version 4 has none
    // CesiumJS counts these attributes to know the degree.
    const auto& attributes = glb.json["meshes"][0]["primitives"][0]["attributes"];
    CHECK(attributes.size() == 4 + static_cast<std::size_t>((degree + 1) * (degree + 1) - 1));
    const auto tileset = nlohmann::json::parse(Glb::slurp(path));
    const auto& extensions = glb.json["extensionsRequired"];
    CHECK(extensions.size() == 2);
    auto expected = nlohmann::json::parse(R"({
      "asset": {"version": "1.1"}, "extensionsUsed": ["3DTILES_content_gltf"],
      "root": {"geometricError": 0.0, "refine": "ADD", "content": {"uri": "content.glb"}}
    })");
    expected["extensions"]["3DTILES_content_gltf"] = {{"extensionsUsed", extensions},
                                                      {"extensionsRequired", extensions}};
    expected["geometricError"] = tileset["geometricError"];
    expected["root"]["boundingVolume"] = tileset["root"]["boundingVolume"];
    CHECK(tileset == expected);
    const auto box = tileset["root"]["boundingVolume"]["box"].get<std::vector<double>>();
    REQUIRE(box.size() == 12);
    CHECK(tileset["geometricError"].get<double>() == Approx(2 * std::hypot(box[3], box[7], box[11])));
    const GaussianModel named = readModel(path).model;
    CHECK(named.mean == back.mean);
    CHECK(named.rotation == back.rotation);
    CHECK(named.sh == back.sh);
    CHECK(storedBytes(detectFormat(path), path) == report.bytes);
  }
}

TEST_CASE("a tile is bounded by all that its splats reach with z up on either side of that axis") {
  const Scratch scratch;
  GaussianModel model = select(splats(0), std::vector<std::uint32_t>{0, 1});
  model.mean = {{5.0f, -7.0f, 1.0f}, {0.0f, 1.0f, 0.0f}};  // 7 above the middle and 1 below it
  model.log_scale.assign(2, glm::vec3(0.0f));
  model.log_scale[0].y = 100.0f;  // SPZ ends at e^5.94
  writeTiles(scratch.folder() / "tileset.json", model);
  const auto boxIn = [](const fs::path& path) {
    return nlohmann::json::parse(Glb::slurp(path))["root"]["boundingVolume"]["box"].get<std::vector<double>>();
  };
  const double wide = 3 * std::exp(5.9375);
  std::vector<double> box = boxIn(scratch.folder() / "tileset.json");
  REQUIRE(box.size() == 12);
  CHECK(box[3] == Approx(5 + wide));
  CHECK(box[7] == Approx(1 + wide));
  CHECK(box[2] + box[11] == Approx(7 + wide));
  model.log_scale[0].y = 0.0f;
  writeTiles(scratch.folder() / "tileset.json", model);
  box = boxIn(scratch.folder() / "tileset.json");
  CHECK(box == std::vector<double>{0, 0, 3, 8, 0, 0, 0, 4, 0, 0, 0, 7});
}

TEST_CASE("content of a tile stands where the transforms of the tiles above it put it") {
  const Scratch scratch;
  const std::vector<Camera> cameras = {test::makeScene(SceneKind::ordinary, 8, 1).camera};
  writeGlb(scratch.folder() / "content.glb", {splats(1), cameras, glm::vec3(0.0f), {}, cameras});
  const GaussianModel content = readModel(scratch.folder() / "content.glb").model;
  const auto read = [&](const std::string& outer, const std::string& inner) {
    scratch.write("moved.json", R"({"asset": {"version": "1.1"}, "geometricError": 1, "root": {"transform": )" + outer +
                                    R"(, "children": [{"transform": )" + inner +
                                    R"(, "content": {"uri": "content.glb"}}]}})");
    return readModel(scratch.folder() / "moved.json");
  };
  // Twice as large, then 10 along the tile's x and 4 up; that, a quarter turn about up, and 1 along its y.
  const Bundle moved =
      read("[0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1]", "[2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 10, 0, 4, 1]");
  CHECK(moved.warnings.empty());
  REQUIRE(moved.model.size() == content.size());
  for (std::size_t i = 0; i < content.size(); ++i) {
    // A tile's x, y and z are the model's -x, -z and -y.
    const glm::vec3 m = content.mean[i];
    const glm::vec3 tile(-2 * m.x + 10, -2 * m.z, -2 * m.y + 4), turned(-tile.y, tile.x + 1, tile.z);
    CHECK(glm::length(moved.model.mean[i] - glm::vec3(-turned.x, -turned.z, -turned.y)) < 1e-4f);
    CHECK(moved.model.log_scale[i].x == Approx(content.log_scale[i].x + std::log(2.0)).margin(1e-5));
  }
  REQUIRE(moved.cameras.size() == 1);
  REQUIRE(moved.views.size() == 1);
  for (const Camera& camera : {moved.cameras[0], moved.views[0]}) {
    const glm::dvec3 m = cameras[0].position();
    CHECK(glm::length(camera.position() - glm::dvec3(-2 * m.z, 2 * m.y - 4, 2 * m.x - 11)) < 1e-5);
    for (int row = 0; row < 3; ++row) {  // axes of the camera in the world
      const glm::dvec3 axis = glm::transpose(cameras[0].rotation)[row], turned = glm::transpose(camera.rotation)[row];
      CHECK(glm::length(turned - glm::dvec3(-axis.z, axis.y, axis.x)) < 1e-6);
    }
  }
  const std::string none = "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]";
  const Bundle on_globe = read("[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4e6, 0, 4e6, 1]", none);
  CHECK(on_globe.model.mean == content.mean);
  REQUIRE(on_globe.warnings.size() == 1);
  CHECK_THAT(on_globe.warnings[0], Contains("the place on the globe is left out"));
  const std::string file = (scratch.folder() / "moved.json").string();
  const auto refused = [&](const std::string& transform, const std::string& what) {
    const std::string expected =
        "transform: the transform " + what + " (expected a uniform scale, a rotation and a translation)";
    CHECK(test::messageOf([&] { read(transform, none); }) == file + ": /root/" + expected);
    CHECK(test::messageOf([&] { read(none, transform); }) == file + ": /root/children/0/" + expected);
  };
  // So small that the product of its three lengths is no number.
  CHECK(read("[1e-120, 0, 0, 0, 0, 1e-120, 0, 0, 0, 0, 1e-120, 0, 0, 0, 4, 1]", none).model.mean ==
        std::vector<glm::vec3>(content.size(), glm::vec3(0, -4, 0)));
  refused("[1e-120, 0, 0, 0, 0, 1e-120, 0, 0, 0, 0, -1e-120, 0, 0, 0, 0, 1]", "mirrors or flattens");
  refused("[1e-120, 0, 0, 0, 0, 1e-120, 0, 0, 0, 0, 1e-121, 0, 0, 0, 0, 1]", "shears or stretches");
  refused("[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]", "mirrors or flattens");
  refused("[1, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]", "shears or stretches");
  refused("[1e200, 0, 0, 0, 0, 1e200, 0, 0, 0, 0, 1e200, 0, 0, 0, 0, 1]", "is not finite");
  refused("[1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]", "is projective");
  refused("[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]", "mirrors or flattens");
}

TEST_CASE("tilesets that are not read say why") {
  const auto told = [](const std::string& root) {
    const std::string text = R"({"asset": {"version": "1.1"}, "geometricError": 1, "root": )" + root + "}";
    const std::span bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    return test::messageOf([&] { (void)parseTileset(bytes, "a/tileset.json"); });
  };
  CHECK(told("7") == "a/tileset.json: /root: wrong type (expected an object, found 7)");
  CHECK(told("{}") == "a/tileset.json: /root: holds 0 files of content (expected one; each can be read by itself)");
  CHECK_THAT(told(R"({"content": {"uri": "a.glb"}, "children": [{"contents": [{"uri": "b.glb"}, {"uri": "c.glb"}]}]})"),
             Contains("holds 3 files of content"));
  for (const char* uri : {"../a.glb", "/a.glb", "https://example.com/a.glb", ""}) {
    CHECK_THAT(told(R"({"content": {"uri": ")" + std::string(uri) + R"("}})"),
               Contains("/root/content/uri: is no file beside the tileset"));
  }
  for (const char* uri : {"tileset.json", "sub/Tileset.JSON"}) {
    CHECK(told(R"({"content": {"uri": ")" + std::string(uri) + R"("}})") ==
          "a/tileset.json: /root/content/uri: is another tileset (expected a .glb or .gltf, found \"" +
              std::string(uri) + "\")");
  }
  CHECK_THAT(told(R"({"content": {"uri": 1}})"), Contains("uri"));
  CHECK_THAT(told(R"({"content": []})"), Contains("/root/content: wrong type"));
  CHECK_THAT(told(R"({"children": {}})"), Contains("/root/children: wrong type"));
  CHECK_THAT(told(R"({"children": [null]})"), Contains("/root/children/0: wrong type"));
  CHECK_THAT(told(R"({"implicitTiling": {}, "content": {"uri": "a.glb"}})"), Contains("has implicit tiles"));
  CHECK_THAT(told(R"({"transform": [1, 2], "content": {"uri": "a.glb"}})"), Contains("transform"));
}

TEST_CASE("tilesets of versions 1.0 and 1.1 are read and of what they require the extension for glTF") {
  const auto told = [](const std::string& start) {
    const std::string text = "{" + start + R"("geometricError": 1, "root": {"content": {"uri": "a.glb"}}})";
    const std::span bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    return test::messageOf([&] { (void)parseTileset(bytes, "a/tileset.json"); });
  };
  const std::string asset = R"("asset": {"version": "1.1"}, )";
  CHECK(told(asset) == "accepted");
  CHECK(told(R"("asset": {"version": "1.0"}, )") == "accepted");
  CHECK(told("") == "a/tileset.json: /: \"asset\" is missing");
  CHECK(told(R"("asset": {}, )") == "a/tileset.json: /asset: \"version\" is missing");
  CHECK(told(R"("asset": {"version": "2.0"}, )") ==
        "a/tileset.json: /asset/version: another version of 3D Tiles (expected 1.0 or 1.1, found \"2.0\")");
  CHECK_THAT(told(R"("asset": {"version": 1.1}, )"), Contains("/asset/version: wrong type (expected a string"));
  CHECK(told(asset + R"("extensionsUsed": ["EXT_a"], "extensionsRequired": [], )") == "accepted");
  CHECK(told(asset + R"("extensionsRequired": ["3DTILES_content_gltf"], )") == "accepted");
  CHECK(told(asset + R"("extensionsRequired": ["3DTILES_content_gltf", "EXT_a"], )") ==
        "a/tileset.json: /extensionsRequired/1: an extension that is not supported "
        "(expected 3DTILES_content_gltf, found \"EXT_a\")");
  CHECK_THAT(told(asset + R"("extensionsRequired": {}, )"), Contains("/extensionsRequired: wrong type"));
}

TEST_CASE("a tileset whose content is a pipe is refused, not waited for") {
  const Scratch scratch;
  const fs::path tileset = scratch.write(
      "tileset.json", R"({"asset": {"version": "1.1"}, "geometricError": 1, "root": {"content": {"uri": "a.glb"}}})");
  REQUIRE(::mkfifo((scratch.folder() / "a.glb").c_str(), 0600) == 0);
  CHECK(test::messageOf([&] { (void)readTiles(tileset, {}); }, ErrorKind::cannotRead) ==
        (scratch.folder() / "a.glb").string() + ": is no regular file");
}

TEST_CASE("a tileset that cannot be written leaves nothing behind") {
  const Scratch scratch;
  const GaussianModel model = splats(0);
  const auto failed = [&](const fs::path& path, ErrorKind kind, const GaussianModel& what, bool replace = true) {
    return test::messageOf([&] { writeTiles(path, what, replace); }, kind);
  };
  const fs::path folder = scratch.folder() / "out";
  GaussianModel far = model;
  far.mean[0].x = 1e30f;
  CHECK(!failed(folder / "tileset.json", ErrorKind::badData, far).empty());
  CHECK(!failed(folder / "tileset.json", ErrorKind::badData, GaussianModel()).empty());
  CHECK(!fs::exists(folder));
  // Its own folder is made, not those above; a file is none.
  CHECK(!failed(folder / "deeper/tileset.json", ErrorKind::cannotWrite, model).empty());
  CHECK(!fs::exists(folder));
  const fs::path file = scratch.write("file", "mine");
  CHECK(!failed(file / "tileset.json", ErrorKind::cannotWrite, model).empty());
  CHECK(Glb::slurp(file) == "mine");
  // What stands in the way of one of the two.
  fs::create_directories(folder / "content.glb/full");
  CHECK(!failed(folder / "tileset.json", ErrorKind::cannotWrite, model).empty());
  CHECK(filesIn(folder) == 1);
  fs::remove_all(folder);
  fs::create_directories(folder / "tileset.json/full");
  CHECK(!failed(folder / "tileset.json", ErrorKind::cannotWrite, model).empty());
  CHECK(filesIn(folder) == 1);
  fs::remove_all(folder);
  fs::create_directory(folder);
  scratch.write("out/content.glb", "mine");
  CHECK_THAT(failed(folder / "tileset.json", ErrorKind::cannotWrite, model, false),
             Contains("content.glb: exists already (--overwrite replaces it)"));
  CHECK(Glb::slurp(folder / "content.glb") == "mine");
  CHECK(filesIn(folder) == 1);
}

TEST_CASE("what 3D Tiles do not hold is told and a name is no address") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::ordinary, 8, 40);
  Bundle source;
  source.model = scene.model;
  source.cameras = {scene.camera};
  writeBundle(scratch.folder() / "in.tgz", source);
  const ConvertReport report = convert(scratch.folder() / "in.tgz", scratch.folder() / "a #b.tileset.json");
  CHECK(report.output_format == "tileset.json");
  CHECK(report.warnings.size() >= 2);
  CHECK(std::ranges::count(report.warnings, "3D Tiles holds no cameras: they are left out") == 1);
  CHECK(readModel(scratch.folder() / "a #b.content.glb").model.size() == 40);
  const auto tileset = nlohmann::json::parse(Glb::slurp(scratch.folder() / "a #b.tileset.json"));
  CHECK(tileset["root"]["content"]["uri"] == "a%20%23b.content.glb");
}
