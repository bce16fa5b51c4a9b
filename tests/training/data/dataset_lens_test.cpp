// SPDX-License-Identifier: Apache-2.0
// Lenses that data sets name: every model's parameters, photographs and masks without them.
#include <array>
#include <cmath>
#include <tuple>

#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/data/dataset.h"
#include "training/dataset_files.h"

namespace fs = std::filesystem;
using Json = nlohmann::json;
using tg::DatasetOptions;
using tg::loadDataset;
using namespace tg::test;

namespace {

// A binary camera of one of COLMAP's models: focal lengths and principal point 10, 11, ..., then 0.001, 0.002, ...
std::string colmapCamera(std::int32_t model, int lengths, int parameters) {
  Bytes bytes;
  bytes.add<std::uint64_t>(1).add<std::uint32_t>(1).add(model).add<std::uint64_t>(16).add<std::uint64_t>(12);
  for (int i = 0; i < parameters; ++i) bytes.add(i < lengths ? 10.0 + i : 0.001 * (i - lengths + 1));
  return bytes.data();
}

}  // namespace

TEST_CASE("reads COLMAP's lenses, every model's parameters in their order", "[dataset]") {
  using Four = std::array<double, 4>;
  using Three = std::array<double, 3>;
  using Two = std::array<double, 2>;
  struct Case {
    std::int32_t id;
    const char* name;
    int lengths, parameters;
    bool fisheye;
    Four radial;
    Three divisor;
    Two tangential, prism;
    double fov;
  };
  const auto cases = {
      Case{2, "SIMPLE_RADIAL", 3, 4, false, {0.001}, {}, {}, {}, 0},
      Case{3, "RADIAL", 3, 5, false, {0.001, 0.002}, {}, {}, {}, 0},
      Case{4, "OPENCV", 4, 8, false, {0.001, 0.002}, {}, {0.003, 0.004}, {}, 0},
      Case{5, "OPENCV_FISHEYE", 4, 8, true, {0.001, 0.002, 0.003, 0.004}, {}, {}, {}, 0},
      Case{6, "FULL_OPENCV", 4, 12, false, {0.001, 0.002, 0.005}, {0.006, 0.007, 0.008}, {0.003, 0.004}, {}, 0},
      Case{7, "FOV", 4, 5, false, {}, {}, {}, {}, 0.001},
      Case{8, "SIMPLE_RADIAL_FISHEYE", 3, 4, true, {0.001}, {}, {}, {}, 0},
      Case{9, "RADIAL_FISHEYE", 3, 5, true, {0.001, 0.002}, {}, {}, {}, 0},
      Case{10, "THIN_PRISM_FISHEYE", 4, 12, true, {0.001, 0.002, 0.005, 0.006}, {}, {0.003, 0.004}, {0.007, 0.008}, 0},
      Case{14, "SIMPLE_FISHEYE", 3, 3, true, {}, {}, {}, {}, 0},
      Case{15, "FISHEYE", 4, 4, true, {}, {}, {}, {}, 0},
  };
  tg::TemporaryFolder folder;
  ColmapBinary().write(folder.path);
  for (const Case& expected : cases) {
    INFO(expected.name);
    writeText(folder / "sparse/0/cameras.bin", colmapCamera(expected.id, expected.lengths, expected.parameters));
    const tg::DatasetIndex::Entry entry = tg::readColmap(folder.path).entries.at(0);
    CHECK(entry.lens.model == expected.name);
    CHECK(entry.lens.fisheye == expected.fisheye);
    CHECK(entry.lens.fov == Approx(expected.fov));
    for (std::size_t i = 0; i < 4; ++i) CHECK(entry.lens.radial[i] == Approx(expected.radial[i]));
    for (std::size_t i = 0; i < 3; ++i) CHECK(entry.lens.radial_divisor[i] == Approx(expected.divisor[i]));
    for (std::size_t i = 0; i < 2; ++i) {
      CHECK(entry.lens.tangential[i] == Approx(expected.tangential[i]));
      CHECK(entry.lens.thin_prism[i] == Approx(expected.prism[i]));
    }
    const bool one_focal = expected.lengths == 3;
    CHECK(entry.camera.focal.x == 10);
    CHECK(entry.camera.focal.y == (one_focal ? 10 : 11));
    CHECK(entry.camera.center.x == (one_focal ? 11 : 12));
    CHECK(entry.camera.center.y == (one_focal ? 12 : 13));
  }
  writeText(folder / "sparse/0/cameras.bin", colmapCamera(11, 4, 16));
  CHECK_THAT(refusal(folder.path),
             Contains("3 ") && Contains("camera model RAD_TAN_THIN_PRISM_FISHEYE is not supported (expected one of "
                                        "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, "));
  for (const auto& [id, parameters, name, advice] :
       {std::tuple(12, 4, "SIMPLE_DIVISION", "): run `colmap image_undistorter` first"),
        std::tuple(13, 5, "DIVISION", "): run `colmap image_undistorter` first"),
        std::tuple(16, 6, "EUCM", "): run `colmap image_undistorter` first"),
        std::tuple(17, 2, "EQUIRECTANGULAR", "): cut it into pictures of pinhole cameras")}) {
    writeText(folder / "sparse/0/cameras.bin", colmapCamera(id, 2, parameters));
    CHECK_THAT(refusal(folder.path),
               Contains(": camera model " + std::string(name) + " is not supported (expected one of ") &&
                   Contains("SIMPLE_FISHEYE, FISHEYE" + std::string(advice)));
  }
  writeText(folder / "sparse/0/cameras.bin", ColmapBinary(99).cameras);
  CHECK_THAT(refusal(folder.path), Contains("unknown camera model 99"));
  Bytes endless;
  endless.add<std::uint64_t>(1).add<std::uint32_t>(1).add<std::int32_t>(2).add<std::uint64_t>(16).add<std::uint64_t>(
      12);
  for (double value : {20.0, 8.0, 6.0, std::nan("")}) endless.add(value);
  writeText(folder / "sparse/0/cameras.bin", endless.data());
  CHECK_THAT(refusal(folder.path), Contains("camera 1: a parameter is not finite"));

  tg::TemporaryFolder text_folder;
  ColmapText text;
  text.cameras = "1 OPENCV 16 12 20 21 7.5 6.5 0.1 0.2 0.3 0.4\n";
  text.write(text_folder.path);
  CHECK(tg::readColmap(text_folder.path).entries.at(0).lens.tangential[1] == 0.4);
  writeText(text_folder / "sparse/0/cameras.txt", "1 WIDE 16 12 20 21 7.5 6.5\n");
  CHECK_THAT(refusal(text_folder.path), Contains("cameras.txt: camera 1: unknown camera model WIDE"));
}

TEST_CASE("reads the lenses of transforms.json, a frame's before the file's", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "a.png", 16, 12);
  const auto lens = [&](Json json) {
    writeText(folder / "transforms.json", json.dump());
    return tg::readTransforms(folder.path).entries.at(0).lens;
  };
  Json json = pinhole({frame("a.png")});
  CHECK(lens(json).isPinhole());
  json.update({{"k1", -0.1}, {"k2", 0.02}, {"k3", 0.003}, {"k4", 0}, {"p1", 0.004}, {"p2", -0.005}});
  const tg::Lens opencv = lens(json);
  CHECK(opencv.model == "OPENCV");
  CHECK(opencv.radial == std::array{-0.1, 0.02, 0.003, 0.0});
  CHECK(opencv.tangential == std::array{0.004, -0.005});
  json["frames"][0]["k1"] = 0.25;
  CHECK(lens(json).radial[0] == 0.25);

  Json fisheye = pinhole({frame("a.png")});
  fisheye.update({{"k1", 0.1}, {"k2", 0.2}, {"k3", 0.3}, {"k4", 0.4}});
  for (const Json& name : {Json{{"camera_model", "OPENCV_FISHEYE"}}, Json{{"is_fisheye", true}}}) {
    fisheye.erase("camera_model");
    fisheye.update(name);
    CHECK(lens(fisheye).fisheye);
    CHECK(lens(fisheye).radial == std::array{0.1, 0.2, 0.3, 0.4});
  }
  fisheye["frames"][0]["is_fisheye"] = nullptr;
  CHECK(lens(fisheye).fisheye);
  fisheye["frames"][0]["is_fisheye"] = false;
  fisheye.erase("k4");
  CHECK_FALSE(lens(fisheye).fisheye);
  fisheye["frames"][0]["is_fisheye"] = 1;
  CHECK_THAT(refusal([&] { lens(fisheye); }), Contains("\"is_fisheye\": expected true or false, found number"));

  // Photograph and camera become the pinhole's, larger here; downscaling comes after.
  json["k1"] = json["frames"][0]["k1"] = -0.8;
  writeText(folder / "transforms.json", json.dump());
  const tg::Dataset dataset = loadDataset(folder.path);
  const tg::Camera& camera = dataset.views.at(0);
  CHECK(camera.size.x > 16);
  CHECK(camera.focal.x == 20);
  CHECK(camera.center.x - 7.5 == std::floor(camera.center.x - 7.5));
  CHECK(dataset.pixels(0)->width == camera.size.x);
  CHECK(dataset.pixels(0)->height == camera.size.y);
  REQUIRE(dataset.notes.size() == 1);
  CHECK_THAT(dataset.notes[0], Contains("1 of 1 photographs are undistorted as they are read (the first: OPENCV, to "));
  DatasetOptions half;
  half.downscale = 2;
  const tg::Dataset reduced = loadDataset(folder.path, half);
  CHECK(reduced.views[0].size.x == camera.size.x / 2);
  CHECK(reduced.views[0].center.x == camera.center.x / 2);
  CHECK(reduced.pixels(0)->width == camera.size.x / 2);
}

TEST_CASE("masks go through the lens with their photographs", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "images/a.png", 16, 12);
  tg::Image mask(32, 24, 1, 1.0f);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 16; ++x) mask.at(x, y, 0) = 0.0f;
  }
  fs::create_directories(folder / "masks");
  tg::writeImage(folder / "masks/a.png", mask);
  Json json = pinhole({frame("images/a.png")});
  json["k1"] = -0.1;
  json["cx"] = 8;
  json["cy"] = 6;
  writeText(folder / "transforms.json", json.dump());
  for (const int downscale : {1, 2}) {
    DatasetOptions options;
    options.downscale = downscale;
    const tg::Dataset dataset = loadDataset(folder.path, options);
    const auto pixels = dataset.pixels(0);
    const auto counts = [&](int x, int y) {
      return pixels->mask.at(static_cast<std::size_t>(y) * pixels->width + x) != 0;
    };
    CHECK_FALSE(counts(1, pixels->height / 2));
    CHECK(counts(pixels->width - 2, pixels->height / 2));
  }
}

TEST_CASE("photographs of which a mask hides every pixel are left out", "[dataset]") {
  tg::TemporaryFolder folder;
  Json frames = Json::array();
  for (const char* name : {"a", "b", "c"}) {
    const std::string image = std::string("images/") + name + ".png";
    writePicture(folder / image, 16, 12);
    frames.push_back(frame(image));
  }
  writeText(folder / "transforms.json", pinhole(frames).dump());
  fs::create_directories(folder / "masks");
  tg::writeImage(folder / "masks/b.png", tg::Image(16, 12, 1));
  const tg::Dataset dataset = loadDataset(folder.path);
  REQUIRE(dataset.views.size() == 2);
  CHECK(dataset.views[0].name == "c.png");
  CHECK(dataset.views[1].name == "a.png");
  CHECK(dataset.views[1].test);
  CHECK_THAT(dataset.notes.back(), Contains("1 of 3 photographs, 0 of them held out, are left out: their masks hide "
                                            "every pixel (the first: b.png)"));
  DatasetOptions object;
  object.masks = tg::MaskMeaning::background;
  CHECK(loadDataset(folder.path, object).views.size() == 3);

  // A pixel that no box of the reduced picture is full of is none; a.png is held out at any size.
  tg::Image dot(16, 12, 1);
  dot.at(5, 5, 0) = 1.0f;
  tg::writeImage(folder / "masks/a.png", dot);
  CHECK(loadDataset(folder.path).views.size() == 2);
  DatasetOptions half;
  half.downscale = 2;
  const tg::Dataset alone = loadDataset(folder.path, half);
  REQUIRE(alone.views.size() == 1);
  CHECK(alone.views[0].name == "c.png");
  CHECK_FALSE(alone.views[0].test);
  CHECK_THAT(alone.notes.back(), Contains("2 of 3 photographs, 1 of them held out, are left out"));
  half.only_test = true;
  CHECK_THAT(refusal(folder.path, half), Contains("masks hide every pixel of the test photographs"));
  tg::writeImage(folder / "masks/c.png", tg::Image(16, 12, 1));
  CHECK_THAT(refusal(folder.path), Contains("masks hide every pixel of the training photographs"));
}

TEST_CASE("photographs whose mask shows a sliver that gets lost are left out", "[dataset]") {
  tg::TemporaryFolder folder;
  for (const char* name : {"a", "b", "c"}) writePicture(folder / "images" / (std::string(name) + ".png"), 16, 12);
  Json json = pinhole({frame("images/a.png"), frame("images/b.png"), frame("images/c.png")});
  json["cx"] = 8;
  json["cy"] = 6;
  fs::create_directories(folder / "masks");
  const auto viewsOf = [&](const tg::Image& mask) {
    tg::writeImage(folder / "masks/b.png", mask);
    writeText(folder / "transforms.json", json.dump());
    return loadDataset(folder.path).views.size();
  };
  // Of a mask twice as large, a pixel that fills no pixel of the photograph.
  tg::Image large(32, 24, 1);
  large.at(11, 11, 0) = 1.0f;
  CHECK(viewsOf(large) == 2);
  for (const int x : {10, 11}) large.at(x, 10, 0) = large.at(x, 11, 0) = 1.0f;
  CHECK(viewsOf(large) == 3);
  // A pixel that the lens moves between others.
  tg::Image dot(16, 12, 1);
  dot.at(3, 3, 0) = 1.0f;
  CHECK(viewsOf(dot) == 3);
  json["k1"] = -0.1;
  CHECK(viewsOf(dot) == 2);
}
