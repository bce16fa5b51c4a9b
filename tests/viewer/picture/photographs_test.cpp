// SPDX-License-Identifier: Apache-2.0
// Photographs by the names of cameras.
#include "viewer/picture/photographs.h"

#include <fstream>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace tg;

TEST_CASE("photographs are found by the names of cameras, in the folders of the usual data sets") {
  const TemporaryFolder folder;
  const auto touch = [&](const std::string& name) {
    std::filesystem::create_directories((folder / name).parent_path());
    std::ofstream(folder / name) << "x";
  };
  for (const char* name : {"images/0001.jpg", "images_4/0001.jpg", "images/frame.02.PNG", "train/r_0.png",
                           "test/r_0.png", "sparse/0/points.bin", "notes.txt", "0001.png", "eval/frame.02.png",
                           "eval/r_0.png", "r_0.png", "images/b.png", "a/b.png"}) {
    touch(name);
  }
  std::filesystem::create_directory(folder / "views");
  std::filesystem::create_directory_symlink(folder.path, folder / "views/all");  // one that leads to itself, too
  CHECK(Photographs(folder / "views").size() > 0);
  std::filesystem::remove_all(folder / "views");
  const Photographs photographs(folder.path);
  CHECK(photographs.size() == 11);
  Camera camera;
  const auto found = [&](const std::string& name, bool test) {
    camera.name = name;
    camera.test = test;
    return photographs.find(camera).lexically_relative(folder.path);
  };
  CHECK(found("0001.jpg", false) == "images/0001.jpg");
  CHECK(found("images_4/0001.jpg", false) == "images_4/0001.jpg");
  CHECK(found("0001", false) == "images/0001.jpg");
  CHECK(found("frame.02.PNG", false) == "images/frame.02.PNG");
  CHECK(found("b.png", false) == "images/b.png");
  CHECK(found("frame.02", false) == "images/frame.02.PNG");
  CHECK(found("r_0", false) == "train/r_0.png");
  CHECK(found("r_0.png", true) == "test/r_0.png");
  camera.name = "other.png";
  CHECK(photographs.find(camera).empty());
  CHECK_THROWS_AS(Photographs(folder / "sparse"), Error);
  CHECK_THROWS_AS(Photographs(folder / "no such folder"), Error);
}
