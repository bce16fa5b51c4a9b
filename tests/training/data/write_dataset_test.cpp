// SPDX-License-Identifier: Apache-2.0
// A data set that is written is the one that was loaded.
#include "training/data/write_dataset.h"

#include <fstream>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace fs = std::filesystem;

namespace {

// Three views of 6 x 4, one of them held out, transparent and masked; names that collide, and that lead elsewhere.
tg::Dataset dataset() {
  tg::Dataset result;
  std::vector<tg::Photograph> photographs;
  const char* names[] = {"a/x.jpg", "a/x.png", "../../y.png"};
  for (int i = 0; i < 3; ++i) {
    tg::Camera camera;
    camera.name = names[i];
    camera.size = {6, 4};
    camera.focal = {7 + i, 8};
    camera.center = {2.5, 1.75};
    camera.test = i == 2;
    camera.translation = {0.1 * i, 0.2, 3};
    result.views.push_back(camera);
    tg::Photograph& photograph = photographs.emplace_back();
    photograph.pixels.width = 6;
    photograph.pixels.height = 4;
    for (int k = 0; k < 72; ++k) photograph.pixels.rgb.push_back(static_cast<std::uint8_t>(50 * i + k));
  }
  for (int k = 0; k < 24; ++k) photographs[1].alpha.push_back(static_cast<std::uint8_t>(100 + k));
  photographs[2].pixels.mask.assign(24, 255);
  photographs[2].pixels.mask[5] = 0;
  result.photographs = tg::storeInMemory(std::move(photographs));
  result.points.position = {{1, 2, 3}, {-1, 0.5f, 4}};
  result.points.color = {{1, 0, 0}, {0, 1, 0.2f}};
  return result;
}

}  // namespace

TEST_CASE("a written data set loads as it was", "[dataset]") {
  tg::TemporaryFolder folder;
  const tg::Dataset before = dataset();
  tg::writeDataset(folder / "out", before, false);
  CHECK(fs::exists(folder / "out/images/y.png"));  // not outside the folder
  CHECK(fs::exists(folder / "out/images/a/x_2.png"));
  tg::DatasetOptions options;
  options.random_background = true;  // keeps alpha
  const tg::Dataset after = tg::loadDataset(folder / "out", options);
  REQUIRE(after.views.size() == 3);
  CHECK(after.points.position == before.points.position);
  for (std::size_t i = 0; i < 3; ++i) {
    const tg::Camera& camera = after.views[i];
    const tg::Camera& original = before.views[i];
    CHECK(camera.test == original.test);
    CHECK(camera.focal.x == original.focal.x);
    CHECK(camera.focal.y == original.focal.y);
    CHECK(camera.center.x == original.center.x);
    CHECK(camera.center.y == original.center.y);
    CHECK(glm::length(camera.position() - original.position()) < 1e-12);
    const auto loaded = after.photographs->get(i);
    const auto stored = before.photographs->get(i);
    CHECK(loaded->pixels.rgb == stored->pixels.rgb);
    CHECK(loaded->alpha == stored->alpha);
    CHECK(loaded->pixels.mask == stored->pixels.mask);
  }
}

TEST_CASE("a written data set keeps the background, and views of one name apart", "[dataset]") {
  tg::TemporaryFolder folder;
  tg::Dataset before = dataset();
  before.background = {1, 0.5f, 0};
  before.views[0].name = "r_0.jpg";
  before.views[1].name = "r_1.jpg";
  before.views[2].name = "r_0.png";
  tg::writeDataset(folder.path, before, false);
  CHECK(fs::exists(folder / "images/train/r_0.png"));
  CHECK(fs::exists(folder / "images/train/r_1.png"));
  CHECK(fs::exists(folder / "images/test/r_0.png"));
  CHECK(fs::exists(folder / "masks/test/r_0.png"));
  const tg::Dataset after = tg::loadDataset(folder.path, {});
  CHECK(after.background == before.background);
  CHECK(after.photographs->get(2)->pixels.mask == before.photographs->get(2)->pixels.mask);
  tg::DatasetOptions options;
  options.background = glm::vec3(0.25f);
  CHECK(tg::loadDataset(folder.path, options).background == glm::vec3(0.25f));

  nlohmann::json json = nlohmann::json::parse(std::ifstream(folder / "transforms.json"));
  for (const nlohmann::json& broken : {nlohmann::json({1, 2, 0}), nlohmann::json({1, 1}), nlohmann::json("white")}) {
    json["background"] = broken;
    std::ofstream(folder / "transforms.json") << json;
    std::string said;
    try {
      tg::loadDataset(folder.path, {});
    } catch (const tg::Error& error) {
      said = error.what();
    }
    CHECK_THAT(said, Contains("transforms.json: 'background' is not three numbers from 0 to 1"));
  }
}

TEST_CASE("a folder that holds a data set is not written over without being asked", "[dataset]") {
  tg::TemporaryFolder folder;
  tg::writeDataset(folder.path, dataset(), false);
  const auto write = [&](bool overwrite) {
    try {
      tg::writeDataset(folder.path, dataset(), overwrite);
    } catch (const tg::Error& error) {
      return std::to_string(tg::exitCode(error)) + " " + error.what();
    }
    return std::string("written");
  };
  CHECK_THAT(write(false), Contains("4 ") && Contains("holds transforms.json already (add --overwrite"));
  CHECK(write(true) == "written");
}

TEST_CASE("a data set that could not be replaced whole is none", "[dataset]") {
  tg::TemporaryFolder folder;
  tg::writeDataset(folder.path, dataset(), false);
  fs::remove(folder / "points3d.ply");
  fs::create_directory(folder / "points3d.ply");  // nothing can be written there, once photographs are
  std::ofstream(folder / "points3d.ply/file") << "";
  CHECK_THROWS(tg::writeDataset(folder.path, dataset(), true));
  CHECK_FALSE(tg::hasCameras(folder.path));
}

TEST_CASE("what could not be written takes nothing along that another wrote", "[dataset]") {
  tg::TemporaryFolder folder;
  fs::create_directory(folder / "out");
  fs::create_symlink("/none", folder / "out/images");
  fs::create_symlink("/none/below", folder / "link");
  CHECK_THROWS_AS(tg::writeDataset(folder / "out", dataset(), false), tg::Error);
  CHECK_THROWS_AS(tg::writeDataset(folder / "link", dataset(), false), tg::Error);
  CHECK(fs::is_symlink(folder / "out/images"));
  CHECK(fs::is_symlink(folder / "link"));

  const fs::path both = folder / "both";
  const auto writeHalf = [&] {
    fs::create_directories(both / "images/a");
    fs::create_directories(both / "masks/a");
    for (const char* file : {"images/a/own.png", "masks/a/own.png", "images/other.png"})
      std::ofstream(both / file) << "";
    CHECK_THROWS_WITH(tg::writeAllOrNone(both, {"images/other.png"}, [] {}),
                      Contains("both: another tgtrain is at work in this folder"));
    throw tg::Error(tg::ErrorKind::cannotWrite, "full");
  };
  CHECK_THROWS_WITH(tg::writeAllOrNone(both, {"images/a/own.png", "masks/a/own.png"}, writeHalf), "full");
  CHECK(fs::exists(both / "images/other.png"));
  CHECK_FALSE(fs::exists(both / "images/a"));
  CHECK_FALSE(fs::exists(both / "masks"));
}

TEST_CASE("names that JSON does not hold are refused before anything is written", "[dataset]") {
  tg::TemporaryFolder folder;
  tg::Dataset latin = dataset();
  latin.views[1].name = "f\xe9.png";
  CHECK_THROWS_WITH(tg::writeDataset(folder / "out", latin, false),
                    Contains("is no UTF-8, which transforms.json is written in"));
  CHECK_FALSE(fs::exists(folder / "out"));
}

TEST_CASE("photographs that a data set reads are not written over, wherever they lie", "[dataset]") {
  tg::TemporaryFolder folder;
  tg::writeDataset(folder / "first", dataset(), false);
  fs::create_directory(folder / "other");
  fs::rename(folder / "first/images", folder / "images");
  std::ifstream file(folder / "first/transforms.json");
  nlohmann::json json = nlohmann::json::parse(file);
  for (nlohmann::json& frame : json["frames"]) frame["file_path"] = "../" + frame["file_path"].get<std::string>();
  json.erase("train_filenames");
  json.erase("test_filenames");
  std::ofstream(folder / "first/transforms.json") << json;
  const tg::Dataset loaded = tg::loadDataset(folder / "first");
  CHECK_THROWS_WITH(tg::writeDataset(folder.path, loaded, true), Contains("holds what the data set reads: "));
  CHECK_NOTHROW(tg::writeDataset(folder / "other", loaded, true));
}

TEST_CASE("of a data set that is replaced no masks and no points stay", "[dataset]") {
  tg::TemporaryFolder folder;
  tg::writeDataset(folder / "out", dataset(), false);
  CHECK(fs::exists(folder / "out/masks/y.png"));
  fs::copy_file(folder / "out/masks/y.png", folder / "out/masks/y_mask.png");
  tg::Dataset bare = dataset();
  bare.points = {};
  std::vector<tg::Photograph> photographs;
  for (std::size_t i = 0; i < 3; ++i) {
    photographs.push_back(*bare.photographs->get(i));
    photographs.back().pixels.mask.clear();
  }
  bare.photographs = tg::storeInMemory(std::move(photographs));
  tg::writeDataset(folder / "out", bare, true);
  CHECK_FALSE(fs::exists(folder / "out/masks/y.png"));
  CHECK_FALSE(fs::exists(folder / "out/masks/y_mask.png"));
  CHECK_FALSE(fs::exists(folder / "out/points3d.ply"));
  for (const char* name : {"masks", "points3d.ply"}) {
    tg::TemporaryFolder other;
    fs::create_directories(other / name);
    CHECK_THROWS_WITH(tg::writeDataset(other.path, bare, false), Contains(std::string("holds ") + name));
  }
}
