// SPDX-License-Identifier: Apache-2.0
// model.tgz: what goes in comes out, the same bytes every time, and the entries are what other tools expect.

#include "core/bundle/bundle.h"
#include "core/bundle/manifest.h"
#include "core/bundle/ply.h"
#include "core/bundle/training_json.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/tar_file.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using Bytes = std::vector<std::uint8_t>;

namespace {

tg::Bundle tinyBundle() {
  tg::Bundle bundle;
  bundle.model = tg::tinyTexturedModel(20);
  for (int i = 0; i < 3; ++i) {
    bundle.cameras.push_back(tg::lookAt({1.0 + i, 2.0, 3.3}, {0.1, 0.2, 0.3 * i}, {0, -1, 0}, 0.7, 640, 480));
    bundle.cameras.back().name = "view_" + std::to_string(i) + ".png";
    bundle.cameras.back().center.x += 1.25;
    bundle.cameras.back().test = i == 1;
  }
  bundle.training_json = "{ \"steps\": 30000 }\n";
  bundle.preview = tg::Image(6, 4, 3, 51.0f / 255.0f);
  bundle.background = {0.1f, 0.5f, 1.0f};
  return bundle;
}

Bytes read(const std::filesystem::path& path) { return tg::readFile(path, 1 << 26); }

}  // namespace

TEST_CASE("a bundle comes back as it went in") {
  const tg::TemporaryFolder folder;
  const tg::Bundle bundle = tinyBundle();
  tg::writeBundle(folder / "a.tgz", bundle);
  const tg::Bundle back = tg::readBundle(folder / "a.tgz");
  REQUIRE(back.warnings.empty());
  REQUIRE(back.model.sh_degree == 1);
  REQUIRE(back.model.texture_mode == tg::TextureMode::rgba);
  REQUIRE(back.model.intersection == tg::IntersectionModel::plane);
  REQUIRE(back.model == bundle.model);
  REQUIRE(back.background == bundle.background);
  REQUIRE(back.training_json == bundle.training_json);
  REQUIRE(back.preview.data == bundle.preview.data);
  REQUIRE(back.cameras.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    REQUIRE(back.cameras[i].name == bundle.cameras[i].name);
    REQUIRE(back.cameras[i].center.x == bundle.cameras[i].center.x);
    REQUIRE(back.cameras[i].focal.y == bundle.cameras[i].focal.y);
    REQUIRE(back.cameras[i].test == bundle.cameras[i].test);
    REQUIRE(back.cameras[i].rotation == bundle.cameras[i].rotation);
    REQUIRE(back.cameras[i].translation == bundle.cameras[i].translation);
  }
}

TEST_CASE("what lies beyond textures comes back from a bundle, and is the base where it does not say") {
  const tg::TemporaryFolder folder;
  tg::Bundle bundle = tinyBundle();
  for (const auto outside : tg::valuesOf<tg::TextureOutside>()) {
    bundle.model.outside = outside;
    tg::writeBundle(folder / "a.tgz", bundle);
    REQUIRE(tg::readBundle(folder / "a.tgz").model.outside == outside);
    REQUIRE(tg::withoutTextures(bundle.model).outside == outside);
  }
  tg::Manifest manifest;
  manifest.outside = tg::TextureOutside::edge;
  manifest.files.push_back({tg::kGaussiansName, 1, std::string(64, '0')});
  std::string json = tg::formatManifest(manifest);
  REQUIRE(tg::parseManifest(json, "m").outside == tg::TextureOutside::edge);
  const std::string key = "\"outside\": \"edge\",";
  const std::size_t at = json.find(key);
  REQUIRE(at != std::string::npos);
  json.erase(at, key.size());
  REQUIRE(tg::parseManifest(json, "m").outside == tg::TextureOutside::base);
}

TEST_CASE("reading and writing again gives the same bytes, for any thread count") {
  const tg::TemporaryFolder folder;
  tg::Bundle bundle = tinyBundle();
  bundle.model.atlas.texels[3].r = 0.1f;  // no half float: rounded once, then stable
  tg::writeBundle(folder / "a.tgz", bundle);
  for (int threads : {1, 2, 5}) {
    tg::setThreadCount(threads);
    tg::writeBundle(folder / "b.tgz", tg::readBundle(folder / "a.tgz"));
    REQUIRE(read(folder / "a.tgz") == read(folder / "b.tgz"));
  }
  tg::setThreadCount(0);
}

TEST_CASE("the gzip header holds no time and no name") {
  const tg::TemporaryFolder folder;
  tg::writeBundle(folder / "a.tgz", tinyBundle());
  const Bytes bytes = read(folder / "a.tgz");
  REQUIRE(Bytes(bytes.begin(), bytes.begin() + 10) == Bytes{0x1f, 0x8b, 8, 0, 0, 0, 0, 0, bytes[8], 3});
}

TEST_CASE("a model without textures, cameras, training and preview is a bundle of two entries") {
  const tg::TemporaryFolder folder;
  tg::Bundle bundle;
  bundle.model = tg::tinyModel(3, 3);
  tg::writeBundle(folder / "a.tgz", bundle);
  std::vector<std::string> names;
  for (const tg::TarEntry& entry : tg::readTar(folder / "a.tgz")) names.push_back(entry.name);
  REQUIRE(names == std::vector<std::string>{"manifest.json", "gaussians.ply"});
  const tg::Bundle back = tg::readBundle(folder / "a.tgz");
  REQUIRE(back.model.atlas.rects.empty());
  REQUIRE(back.cameras.empty());
  REQUIRE(back.training_json.empty());
  REQUIRE(back.preview.width == 0);
}

TEST_CASE("an empty model and a model whose textures are all empty survive") {
  const tg::TemporaryFolder folder;
  tg::writeBundle(folder / "a.tgz", {});
  REQUIRE(tg::readBundle(folder / "a.tgz").model.size() == 0);
  tg::Bundle bundle;
  bundle.model = tg::tinyModel(4, 0);
  bundle.model.atlas.rects.resize(4);
  tg::writeBundle(folder / "b.tgz", bundle);
  REQUIRE(tg::readBundle(folder / "b.tgz").model.atlas.rects == bundle.model.atlas.rects);
}

TEST_CASE("gaussians.ply inside is a strict splat PLY, entries are plain files without owner and time") {
  const tg::TemporaryFolder folder;
  const tg::Bundle bundle = tinyBundle();
  tg::writeBundle(folder / "a.tgz", bundle);
  const std::vector<tg::TarEntry> entries = tg::readTar(folder / "a.tgz");
  REQUIRE(entries.size() == 8);
  REQUIRE(entries[0].name == "manifest.json");
  REQUIRE(entries[1].name == "gaussians.ply");
  REQUIRE(entries[1].bytes == tg::formatSplatPly(bundle.model));
  for (const tg::TarEntry& entry : entries) {
    REQUIRE(entry.type == '0');
    REQUIRE(entry.mode == 0644);
    REQUIRE(entry.uid == 0);
    REQUIRE(entry.mtime == 0);
  }
}

TEST_CASE("cameras that no reader would take are not written") {
  const tg::TemporaryFolder folder;
  tg::Bundle bundle;
  bundle.model = tg::tinyTexturedModel(3);
  bundle.cameras.resize(1);
  bundle.cameras[0].rotation = glm::dmat3(0.6, 0.8, 0, -0.8, 0.6, 0, 0, 0, 1);
  bundle.cameras[0].translation = glm::dvec3(1.7e308);
  bundle.cameras[0].name = "far";
  CHECK_THROWS_WITH(tg::writeBundle(folder / "a.tgz", bundle), Contains("camera \"far\" lies beyond"));
  bundle.cameras[0].translation = glm::dvec3(1.0 / 3);
  CHECK_THROWS_WITH(tg::writeBundle(folder / "a.tgz", bundle), Contains("cameras.json: camera 0: \"width\": expected"));
  bundle.cameras.resize(150000, bundle.cameras[0]);
  CHECK_THROWS_WITH(
      tg::writeBundle(folder / "a.tgz", bundle),
      Contains("150000 cameras make a cameras.json that is too large (expected at most 33554432 bytes, found "));
  CHECK(std::filesystem::is_empty(folder.path));
}

TEST_CASE("a failed write leaves the older file as it was and nothing beside it") {
  const tg::TemporaryFolder folder;
  tg::writeBundle(folder / "a.tgz", tinyBundle());
  const Bytes before = read(folder / "a.tgz");
  tg::Bundle broken = tinyBundle();
  broken.model.atlas.texels[0].r = 1e6f;  // beyond half floats
  REQUIRE_THROWS_WITH(tg::writeBundle(folder / "a.tgz", broken), Contains("a.tgz: ") && Contains("half float"));
  broken = tinyBundle();
  broken.model.mean[2].x = NAN;
  REQUIRE_THROWS_WITH(tg::writeBundle(folder / "a.tgz", broken), Contains("Gaussian 2: mean is not finite"));
  broken = tinyBundle();
  broken.training_json = "[1]";
  REQUIRE_THROWS_AS(tg::writeBundle(folder / "a.tgz", broken), tg::Error);
  broken.training_json = "{";
  REQUIRE_THROWS_AS(tg::writeBundle(folder / "a.tgz", broken), tg::Error);
  broken = tinyBundle();
  broken.preview = tg::Image(513, 1, 3);
  REQUIRE_THROWS_AS(tg::writeBundle(folder / "a.tgz", broken), tg::Error);
  REQUIRE(read(folder / "a.tgz") == before);
  std::size_t files = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder.path)) files += file.exists();
  REQUIRE(files == 1);
  REQUIRE_THROWS_AS(tg::writeBundle(folder / "missing" / "a.tgz", tinyBundle()), tg::Error);
  const std::filesystem::path there = folder / "\x1bx" / "a.tgz";
  REQUIRE_THROWS_WITH(tg::writeBundle(there, tinyBundle()),
                      Contains("?x/a.tgz: ") && !Contains("?x/a.tgz: " + folder.path.string()));
}

TEST_CASE("training.json says which world a model is of, or it is not known") {
  using tg::normalizationOf;
  const auto of = [](const std::string& normalized) {
    return normalizationOf(R"({"dataset": {"normalized": )" + normalized + "}}");
  };
  const std::string moved = R"({"scale": 0.5, "origin": [1, -2, 500000.25]})";
  REQUIRE((of(moved) && *of(moved)));
  CHECK(**of(moved) == tg::Normalization{0.5, {1, -2, 500000.25}});
  REQUIRE(of("null"));
  CHECK_FALSE(of("null")->has_value());
  for (const char* other : {"true", "3", "{}", R"({"scale": 1})", R"({"scale": 0, "origin": [0, 0, 0]})",
                            R"({"scale": -1, "origin": [0, 0, 0]})", R"({"scale": "1", "origin": [0, 0, 0]})",
                            R"({"scale": 1, "origin": [0, 0]})", R"({"scale": 1, "origin": {"x": 0, "y": 0, "z": 0}})",
                            R"({"scale": 1, "origin": [0, null, 0]})"}) {
    INFO(other);
    CHECK_FALSE(of(other).has_value());
  }
  for (const char* other : {"", "{}", "[]", "{", R"({"dataset": 1})", R"({"dataset": {}})"}) {
    INFO(other);
    CHECK_FALSE(normalizationOf(other).has_value());
  }
  std::string edited = R"({"dataset": {"normalized": null}})";
  tg::noteEdited(edited);
  CHECK_FALSE(normalizationOf(edited).has_value());
}

TEST_CASE("training.json says whether the 3D filter was on") {
  CHECK(tg::wasFiltered(R"({"settings": {"filter-3d": "on"}})"));
  for (const char* other : {"", "{}", "{", R"({"settings": {"filter-3d": "off"}})", R"({"settings": "filter-3d"})",
                            R"({"settings": {}, "filter-3d": "on"})", R"({"settings": {"filter-3d": true}})"}) {
    INFO(other);
    CHECK_FALSE(tg::wasFiltered(other));
  }
}
