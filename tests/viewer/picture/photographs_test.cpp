// SPDX-License-Identifier: Apache-2.0
// Photographs by the names of cameras.
#include "viewer/picture/photographs.h"

#include <cstdint>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/bundle/blocks.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace tg;

namespace {

void touch(const std::filesystem::path& file) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << "x";
}

// The photograph of a camera, below the folder.
std::filesystem::path foundIn(const TemporaryFolder& folder, const std::string& name, bool test = false) {
  Camera camera;
  camera.name = name;
  camera.test = test;
  return Photographs(folder.path).find(camera).lexically_relative(folder.path);
}

}  // namespace

TEST_CASE("photographs are found by the names of cameras, in the folders of the usual data sets") {
  const TemporaryFolder folder;
  for (const char* name : {"images/0001.jpg", "images_4/0001.jpg", "images/frame.02.PNG", "train/r_0.png",
                           "test/r_0.png", "sparse/0/points.bin", "notes.txt", "0001.png", "eval/frame.02.png",
                           "eval/r_0.png", "r_0.png", "images/b.png", "a/b.png", "images/w.WebP", "images/e.exr"}) {
    touch(folder / name);
  }
  std::filesystem::create_directory(folder / "views");
  std::filesystem::create_directory_symlink(folder.path, folder / "views/all");  // one that leads to itself, too
  CHECK(Photographs(folder / "views").size() > 0);
  std::filesystem::remove_all(folder / "views");
  const Photographs photographs(folder.path);
  CHECK(photographs.size() == 13);
  const auto found = [&](const std::string& name, bool test) { return foundIn(folder, name, test); };
  CHECK(found("0001.jpg", false) == "images/0001.jpg");
  CHECK(found("images_4/0001.jpg", false) == "images_4/0001.jpg");
  CHECK(found("0001", false) == "images/0001.jpg");
  CHECK(found("w.WebP", false) == "images/w.WebP");
  CHECK(found("e", false) == "images/e.exr");
  CHECK(found("frame.02.PNG", false) == "images/frame.02.PNG");
  CHECK(found("b.png", false) == "images/b.png");
  CHECK(found("frame.02", false) == "images/frame.02.PNG");
  CHECK(found("r_0", false) == "train/r_0.png");
  CHECK(found("r_0.png", true) == "test/r_0.png");
  CHECK(found("other.png", false).empty());
  CHECK_THROWS_AS(Photographs(folder / "sparse"), Error);
  CHECK_THROWS_AS(Photographs(folder / "no such folder"), Error);
}

TEST_CASE("masks are no photographs though they are named for them") {
  const TemporaryFolder folder;
  for (const char* name :
       {"images/a.jpg", "masks/a.jpg.png", "masks_2/a.jpg.png", "cam/masks/b.jpg.png", "masks_of/c.png"}) {
    touch(folder / name);
  }
  CHECK(Photographs(folder.path).size() == 2);
  CHECK(foundIn(folder, "a.jpg") == "images/a.jpg");
  CHECK(foundIn(folder, "b.jpg").empty());
  CHECK(foundIn(folder, "c.png") == "masks_of/c.png");
  CHECK(Photographs(folder / "masks").size() == 1);
}

TEST_CASE("a photograph in the folder of its camera goes before one with its extension") {
  const TemporaryFolder folder;
  for (const char* name : {"images/cam0/a.png", "images/cam1/a.png", "set/images/cam0/b.jpg", "set/images/cam1/b.png",
                           "set/images/xcam1/b.png", "images/cam0/frame.1.png", "images/cam1/frame.1.png"}) {
    touch(folder / name);
  }
  CHECK(foundIn(folder, "cam0/a.jpg") == "images/cam0/a.png");
  CHECK(foundIn(folder, "cam1/a.jpg") == "images/cam1/a.png");
  CHECK(foundIn(folder, "cam1/a") == "images/cam1/a.png");
  CHECK(foundIn(folder, "./cam1/b.jpg") == "set/images/cam1/b.png");
  CHECK(foundIn(folder, "cam1/frame.1") == "images/cam1/frame.1.png");
}

TEST_CASE("a folder that is none is named as such") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(Photographs(folder / "nix"), Contains("nix: no such folder"));
}

TEST_CASE("photographs may be EXR whose numbers are display colours from 0 to 1") {
  const TemporaryFolder folder;
  Image image(2, 1, 3, 0.5f);
  image.data[0] = -1;
  image.data[1] = 7;
  image.data[2] = std::numeric_limits<float>::quiet_NaN();
  writeImage(folder / "a.exr", image);
  CHECK(foundIn(folder, "a.exr") == "a.exr");
  CHECK(readForComparison(folder / "a.exr").data == std::vector<float>{0, 1, 0, 0.5f, 0.5f, 0.5f});
}

TEST_CASE("the photographs of a block are those of its data set") {
  const TemporaryFolder folder;
  touch(folder / "city/images/a.jpg");
  std::filesystem::create_directories(folder / "blocks/block_0_0");
  BlockFile block{{}, "../../city", "colmap", {"images/a.jpg"}};
  block.block.name = "block_0_0";
  block.block.cell.low = glm::dvec2(-1);
  block.block.cell.high = glm::dvec2(1);
  writeBlock(folder / "blocks/block_0_0", block);
  const Photographs photographs(folder / "blocks/block_0_0");
  CHECK(photographs.folder() == (folder / "city"));
  CHECK(photographs.size() == 1);
}

TEST_CASE("a data set whose cameras have a lens is told by their files") {
  const TemporaryFolder folder;
  touch(folder / "images/a.jpg");
  const auto haveLens = [&] { return Photographs(folder.path).haveLens(); };
  const auto write = [&](const std::string& name, const std::string& text) {
    std::filesystem::create_directories((folder / name).parent_path());
    std::ofstream(folder / name) << text;
  };
  CHECK_FALSE(haveLens());
  for (const auto& [text, lens] : std::initializer_list<std::pair<const char*, bool>>{
           {R"({"k1": 0.2, "frames": [{}]})", true},
           {R"({"k1": 0, "p1": 0.0, "camera_model": "OPENCV", "frames": [{"k1": null}]})", false},
           {R"({"k1": 0.2, "frames": [{"k1": 0}]})", false},
           {R"({"frames": [{}, {"p2": -0.001}]})", true},
           {R"({"camera_model": "OPENCV_FISHEYE", "frames": [{}]})", true},
           {R"({"camera_model": "OPENCV_FISHEYE", "frames": [{"camera_model": "PINHOLE"}]})", false},
           {R"({"is_fisheye": true, "frames": [{}]})", true},
           {R"({"is_fisheye": true, "camera_model": "OPENCV", "frames": [{}]})", false},
           {R"({"k1": 0.2, "frames": [1, []]})", false},
           {R"({"k1": 0.2, "frames": 3})", false},
           {"[1]", false},
           {"{", false}}) {
    CAPTURE(text);
    write("transforms.json", text);
    CHECK(haveLens() == lens);
  }
  write("colmap/sparse/0/cameras.txt", "1 SIMPLE_RADIAL 640 480 500 320 240 0.05\n");
  CHECK_FALSE(haveLens());  // nerfstudio made the transforms.json of it
  std::filesystem::remove(folder / "transforms.json");
  CHECK(haveLens());
  write("transforms.json", R"({"frames": [{}]})");
  write("transforms_train.json", R"({"k1": 0.2, "frames": [{}]})");
  CHECK(haveLens());
  for (const auto& [text, lens] : std::initializer_list<std::pair<const char*, bool>>{
           {"# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 SIMPLE_PINHOLE 640 480 500 320 240\n", false},
           {"1 PINHOLE 640 480 500 500 320 240\n2 SIMPLE_RADIAL 640 480 500 320 240 0.05\n", true},
           {"1 SIMPLE_RADIAL 640 480 500 320 240 0\n", false},
           {"1 RADIAL_FISHEYE 640 480 500 320 240 0 0\n", true},
           {"1 EUCM 640 480 500 500 320 240 0.5 1\n", true},
           {"1 OPENCV 640 480 500 500 320 240 0 0 0 1e-3\n", true}}) {
    CAPTURE(text);
    write("sparse/0/cameras.txt", text);
    CHECK(haveLens() == lens);
  }
  touch(folder / "sparse/0/images.bin");
  // Of cameras.bin: a SIMPLE_PINHOLE before one of another model.
  for (const double coefficient : {0.0, 0.05}) {
    std::string bytes;
    const auto add = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
    const auto camera = [&](std::uint32_t id, std::int32_t model, std::initializer_list<double> parameters) {
      add(id);
      add(model);
      add(std::uint64_t{640});
      add(std::uint64_t{480});
      for (const double parameter : parameters) add(parameter);
    };
    add(std::uint64_t{2});
    camera(1, 0, {500, 320, 240});
    camera(2, 2, {500, 320, 240, coefficient});
    write("sparse/0/cameras.bin", bytes);
    CHECK(haveLens() == (coefficient != 0));
    write("sparse/0/cameras.bin", bytes.substr(0, bytes.size() - 1));
    CHECK_FALSE(haveLens());
  }
  std::filesystem::remove(folder / "sparse/0/images.bin");
  CHECK(haveLens());  // by the text: training reads that beside a stray cameras.bin
}
