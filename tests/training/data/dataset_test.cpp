// SPDX-License-Identifier: Apache-2.0
// Data set loaders on tiny sets made here: every layout, every refusal with its message.
#include "training/data/dataset.h"

#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/image/webp.h"
#include "core/system/shortened.h"
#include "support/address_space.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/shared_files.h"
#include "support/temporary_folder.h"
#include "training/dataset_files.h"

namespace fs = std::filesystem;
using Json = nlohmann::json;
using tg::DatasetOptions;
using tg::loadDataset;
using namespace tg::test;

namespace {

void checkColmap(const tg::Dataset& dataset) {
  CHECK(dataset.layout == tg::DatasetLayout::colmap);
  REQUIRE(dataset.views.size() == 10);
  // image0 and image8 are held out; the rest follow in order of their names.
  CHECK(dataset.indices(true) == std::vector<std::size_t>{8, 9});
  CHECK(dataset.views[0].name == "image1.png");
  CHECK(dataset.views[8].name == "image0.png");
  CHECK(dataset.views[9].name == "image8.png");
  const tg::Camera& camera = dataset.views[0];  // image1 is entry 8
  CHECK(camera.focal.x == 20);
  CHECK(camera.focal.y == 21);
  CHECK(camera.center.x == 7.5);
  CHECK(camera.center.y == 6.5);
  CHECK(camera.translation == glm::dvec3(8, 0, 5));
  // Quarter turn about y: world z comes out as camera x, world x as -z.
  CHECK(glm::length(camera.rotation * glm::dvec3(0, 0, 1) - glm::dvec3(1, 0, 0)) < 1e-15);
  CHECK(glm::length(camera.rotation * glm::dvec3(1, 0, 0) - glm::dvec3(0, 0, -1)) < 1e-15);
  REQUIRE(dataset.points.position.size() == 2);
  CHECK(dataset.points.position[0] == glm::vec3(0.5f, -1, 4));
  CHECK(dataset.points.color[0] == glm::vec3(1, 0, 0.2f));
  CHECK(dataset.background == glm::vec3(0.0f));
}

}  // namespace

TEST_CASE("reads the NeRF-synthetic layout: camera angle, straight alpha over white, split files", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "train/r_0.png", 16, 12, 4);
  writePicture(folder / "test/r_0.png", 16, 12, 4);
  // A camera at (1, 2, 3) that looks along -x: OpenGL columns are right, up, backward.
  const Json matrix = {{0, 0, 1, 1}, {1, 0, 0, 2}, {0, 1, 0, 3}, {0, 0, 0, 1}};
  const double angle = 2 * std::atan(0.5);
  writeText(folder / "transforms_train.json",
            Json{{"camera_angle_x", angle}, {"frames", {frame("./train/r_0", matrix)}}}.dump());
  writeText(folder / "transforms_test.json", Json{{"camera_angle_x", angle}, {"frames", {frame("./test/r_0")}}}.dump());
  const tg::Dataset dataset = loadDataset(folder.path);

  REQUIRE(dataset.views.size() == 2);
  CHECK(dataset.layout == tg::DatasetLayout::nerfSynthetic);
  CHECK(dataset.background == glm::vec3(1.0f));
  CHECK_FALSE(dataset.views[0].test);
  CHECK(dataset.views[1].test);
  const tg::Camera& camera = dataset.views[0];
  CHECK(camera.focal.x == Approx(16.0).epsilon(1e-12));
  CHECK(camera.focal.y == camera.focal.x);
  CHECK(camera.center.x == 8);
  CHECK(camera.center.y == 6);
  CHECK(glm::length(camera.position() - glm::dvec3(1, 2, 3)) < 1e-12);
  const glm::dvec3 ahead = camera.rotation * glm::dvec3(0, 2, 3) + camera.translation;
  CHECK(glm::length(ahead - glm::dvec3(0, 0, 1)) < 1e-12);  // one unit in front
  const glm::dvec3 above = camera.rotation * glm::dvec3(1, 2, 4) + camera.translation;
  CHECK(glm::length(above - glm::dvec3(0, -1, 0)) < 1e-12);  // y points down
  // 128/255 red over white, in 8 bit.
  CHECK(dataset.pixels(0)->rgb[0] == 255);
  CHECK(dataset.pixels(0)->rgb[1] == 127);
  CHECK(dataset.pixels(0)->rgb[2] == 127);

  DatasetOptions black;
  black.background = glm::vec3(0.0f);
  CHECK(loadDataset(folder.path, black).pixels(0)->rgb[0] == 128);
}

TEST_CASE("reads instant-ngp's transforms.json and skips missing images, counting them", "[dataset]") {
  tg::TemporaryFolder folder;
  Json frames = Json::array();
  for (int i = 0; i < 10; ++i) {
    const std::string file = "images/" + std::to_string(i) + ".png";
    frames.push_back(frame(file));
    if (i != 3) writePicture(folder / file, 16, 12);
  }
  frames[5]["fl_x"] = 33.0;  // nerfstudio: intrinsics of a frame override the shared ones
  Json json = pinhole(frames);
  json["k1"] = 0.0;
  json["ply_file_path"] = "cloud.ply";
  writeText(folder / "transforms.json", json.dump());
  writeText(folder / "cloud.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
            "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n1 2 3 255 0 0\n");
  const tg::Dataset dataset = loadDataset(folder.path);
  CHECK(dataset.missing_images == 1);
  REQUIRE(dataset.notes.size() == 1);
  CHECK(dataset.notes[0] == "1 of 10 listed images are missing and were skipped (the first: images/3.png)");
  REQUIRE(dataset.views.size() == 9);
  CHECK(dataset.indices(true).size() == 2);  // 0 and, of the nine that exist, the ninth
  CHECK(dataset.views[7].name == "0.png");
  CHECK(dataset.views[8].name == "9.png");
  CHECK(dataset.views[0].focal.x == 20);
  CHECK(dataset.views[0].focal.y == 21);
  CHECK(dataset.views[3].name == "5.png");
  CHECK(dataset.views[3].focal.x == 33);
  CHECK(dataset.background == glm::vec3(0.0f));
  REQUIRE(dataset.points.position.size() == 1);
  CHECK(dataset.points.position[0] == glm::vec3(1, 2, 3));

  DatasetOptions all;
  all.test_every = 0;
  CHECK(loadDataset(folder.path, all).indices(true).empty());
  all.test_every = 3;
  CHECK(loadDataset(folder.path, all).indices(true).size() == 3);
}

TEST_CASE("a photograph that is listed twice counts once, and one that is held out and trained on is named",
          "[dataset]") {
  tg::TemporaryFolder folder;
  Json frames = Json::array();
  for (int i = 0; i < 4; ++i) {
    frames.push_back(frame("images/" + std::to_string(i) + ".png"));
    writePicture(folder / ("images/" + std::to_string(i) + ".png"), 16, 12);
  }
  frames.push_back(frame("images/../images/0.png"));
  writeText(folder / "transforms.json", pinhole(frames).dump());
  const tg::Dataset dataset = loadDataset(folder.path);
  CHECK(dataset.views.size() == 4);
  REQUIRE(dataset.notes.size() == 1);
  CHECK(dataset.notes[0] ==
        "1 of 5 listed images are listed before and count once (the first: images/../images/0.png)");

  fs::remove(folder / "transforms.json");
  writeText(folder / "transforms_train.json", pinhole(frames).dump());
  writeText(folder / "transforms_test.json", pinhole({frames[1], frames[2]}).dump());
  const tg::Dataset split = loadDataset(folder.path);
  CHECK(split.indices(false).size() == 4);
  CHECK(split.indices(true).size() == 2);
  REQUIRE(split.notes.size() == 2);
  CHECK(split.notes[1] == "2 of 2 images that are held out are trained on as well: scores say little");
  DatasetOptions validation;
  validation.validation = true;
  CHECK(loadDataset(folder.path, validation).notes.size() == 1);
}

TEST_CASE("scales intrinsics to the image's size and by --downscale", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "a.png", 34, 26);  // the file says 16 x 12
  writeText(folder / "transforms.json", pinhole({frame("a.png")}).dump());
  const tg::Camera scaled = loadDataset(folder.path).views[0];
  CHECK(scaled.size.x == 34);
  CHECK(scaled.focal.x == Approx(20.0 * 34 / 16));
  CHECK(scaled.center.y == Approx(6.5 * 26 / 12));

  DatasetOptions options;
  options.downscale = 4;  // 34 = 8 * 4 + 2: two columns are cut, the scale stays 1/4
  const tg::Dataset small = loadDataset(folder.path, options);
  CHECK(small.views[0].size.x == 8);
  CHECK(small.views[0].size.y == 6);
  CHECK(small.views[0].focal.x == Approx(20.0 * 34 / 16 / 4));
  CHECK(small.views[0].center.x == Approx(7.5 * 34 / 16 / 4));
  CHECK(small.pixels(0)->rgb.size() == 8u * 6 * 3);
  CHECK(small.pixels(0)->rgb[0] == 255);
}

TEST_CASE("reads COLMAP text models", "[dataset]") {
  tg::TemporaryFolder folder;
  ColmapText().write(folder.path);
  checkColmap(loadDataset(folder.path));
  // Of another program, without its other files.
  writeText(folder / "sparse/0/cameras.bin", "no cameras");
  checkColmap(loadDataset(folder.path));
  fs::remove(folder / "sparse/0/cameras.txt");
  CHECK_THAT(refusal(folder.path), Contains("cameras.bin"));
}

TEST_CASE("reads COLMAP binary models, from sparse/0", "[dataset]") {
  tg::TemporaryFolder folder;
  ColmapBinary().write(folder.path);
  checkColmap(loadDataset(folder.path));
}

TEST_CASE("reads COLMAP models straight in sparse, and SIMPLE_PINHOLE", "[dataset]") {
  tg::TemporaryFolder folder;
  ColmapText text;
  text.cameras = "1 SIMPLE_PINHOLE 16 12 20 7.5 6.5\n";
  text.write(folder.path, "sparse");
  const tg::Camera camera = loadDataset(folder.path).views[0];
  CHECK(camera.focal.x == 20);
  CHECK(camera.focal.y == 20);
  CHECK(camera.center.x == 7.5);
}

TEST_CASE("of several COLMAP models the one called 0 is read and a larger one is named", "[dataset]") {
  tg::TemporaryFolder folder;
  ColmapText text;
  text.write(folder.path, "sparse/2");
  const tg::Dataset lone = loadDataset(folder.path);
  CHECK(lone.views.size() == 10);
  CHECK(lone.notes.empty());
  CHECK(tg::hasCameras(folder.path));
  ColmapText small;
  small.images = "1 1 0 0 0 0 0 5 1 image3.png\n\n2 1 0 0 0 1 0 5 1 image4.png\n\n";
  small.write(folder.path, "sparse/1");
  small.write(folder.path, "sparse/10");
  CHECK(loadDataset(folder.path).views.size() == 10);
  small.write(folder.path, "sparse/0");
  writeText(folder / "sparse/3/cameras.bin", "broken");
  const tg::Dataset dataset = loadDataset(folder.path);
  CHECK(dataset.views.size() == 2);
  CHECK(dataset.notes == std::vector<std::string>{
                             "sparse/2 has more photographs (10) than sparse/0 (2), which is read as it is called 0",
                             "8 photographs in images have no camera and are left out (the first: image0.png)"});
  // The same count in binary.
  fs::remove_all(folder / "sparse/2");
  ColmapBinary().write(folder / "binary");
  fs::rename(folder / "binary/sparse/0", folder / "sparse/2");
  CHECK(loadDataset(folder.path).notes == dataset.notes);
}

TEST_CASE("a COLMAP model in nerfstudio's folder colmap is read where no transforms.json is made of it", "[dataset]") {
  tg::TemporaryFolder folder;
  ColmapText().write(folder / "scene");
  fs::create_directory(folder / "scene/colmap");
  fs::rename(folder / "scene/sparse", folder / "scene/colmap/sparse");
  CHECK(tg::hasCameras(folder / "scene"));
  const tg::Dataset dataset = loadDataset(folder / "scene");
  CHECK(dataset.layout == tg::DatasetLayout::colmap);
  CHECK(dataset.views.size() == 10);
  CHECK(dataset.points.position.size() == 2);
  writeText(folder / "scene/transforms.json", pinhole({frame("images/image3.png")}).dump());
  CHECK(loadDataset(folder / "scene").layout == tg::DatasetLayout::transforms);
  // A data set that is called so is none of the folder that holds it.
  fs::create_directories(folder / "all");
  fs::rename(folder / "scene/images", folder / "scene/colmap/images");
  fs::rename(folder / "scene/colmap", folder / "all/colmap");
  CHECK_THAT(refusal(folder / "all"), Contains("all/colmap?)"));
}

TEST_CASE("photographs that do not have their camera's shape are named, reduced ones are fine", "[dataset]") {
  tg::TemporaryFolder folder;
  Json json = pinhole({frame("images/a.png"), frame("images/b.png"), frame("images/c.png")});
  json["w"] = 1000;
  json["h"] = 667;
  writeText(folder / "transforms.json", json.dump());
  writePicture(folder / "images/a.png", 63, 42);  // 1000 / 16 and 667 / 16, rounded
  writePicture(folder / "images/b.png", 62, 42);
  writePicture(folder / "images/c.png", 62, 41);
  CHECK(loadDataset(folder.path).notes.empty());
  writePicture(folder / "images/b.png", 42, 62);  // turned
  const std::vector<std::string> notes = loadDataset(folder.path).notes;
  REQUIRE(notes.size() == 1);
  CHECK_THAT(notes[0],
             Contains("1 of 3 photographs") && Contains("b.png: expected the shape of 1000 x 667, found 42 x 62"));
}

TEST_CASE("finds photographs by paths with backslashes and by extensions in capitals", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "images/a.png", 16, 12);
  writePicture(folder / "images/b.png", 16, 12);
  fs::rename(folder / "images/b.png", folder / "images/b.PNG");
  Json json = pinhole({frame("images\\a.png"), frame("images/b")});
  json["test_filenames"] = {"images\\a.png"};
  writeText(folder / "transforms.json", json.dump());
  const tg::Dataset dataset = loadDataset(folder.path);
  REQUIRE(dataset.views.size() == 2);
  CHECK(dataset.views[0].name == "b.PNG");
  CHECK(dataset.views[1].name == "a.png");
  CHECK(dataset.views[1].test);
  std::string before = "b.PNG";
  for (const char* name : {"b.JPG", "b.JPEG", "b.WEBP", "b.EXR"}) {  // formats are told by bytes
    fs::rename(folder / "images" / before, folder / "images" / name);
    CHECK(loadDataset(folder.path).views.at(0).name == name);
    before = name;
  }
}

TEST_CASE("finds WebP photographs by their paths without an extension and reads them", "[dataset]") {
  tg::TemporaryFolder folder;
  tg::BytePixels pixels(16, 12);
  for (std::size_t i = 0; i < pixels.data.size(); ++i) pixels.data[i] = i % 4 == 3 ? 255 : static_cast<std::uint8_t>(i);
  fs::create_directories(folder / "images");
  tg::writeFileAtomically(folder / "images/a.webp", tg::encodeWebp(pixels));
  writeText(folder / "transforms.json", pinhole({frame("images/a")}).dump());
  const tg::Dataset dataset = loadDataset(folder.path);
  REQUIRE(dataset.views.size() == 1);
  const std::vector<std::uint8_t>& rgb = dataset.pixels(0)->rgb;
  REQUIRE(rgb.size() == 3 * pixels.size());
  CHECK(rgb[3 * 7 + 1] == pixels.data[4 * 7 + 1]);
  ColmapText().write(folder.path);
  for (int i = 0; i < 10; ++i) writePicture(folder / "images" / ("image" + std::to_string(i) + ".png"), 16, 12);
  CHECK(loadDataset(folder.path).notes ==
        std::vector<std::string>{"1 photographs in images have no camera and are left out (the first: a.webp)"});
}

TEST_CASE("a view below images keeps its folder in its name and one elsewhere is called by its file", "[dataset]") {
  tg::TemporaryFolder folder;
  std::vector<Json> frames;
  for (const char* file : {"./images/cam1/0", "images/cam0/0.png", "images/cam0/1.png", "images/flat.png"}) {
    frames.push_back(frame(file));
  }
  for (const char* file : {"cam0/0.png", "cam0/1.png", "cam1/0.png", "flat.png"}) {
    writePicture(folder / "images" / file, 16, 12);
  }
  writePicture(folder / "train/r_0.png", 16, 12);
  frames.push_back(frame("./train/r_0"));
  writeText(folder / "transforms.json", pinhole(frames).dump());
  DatasetOptions options;
  options.test_every = 2;
  std::vector<std::string> names;
  for (const tg::Camera& view : loadDataset(folder.path, options).views) names.push_back(view.name);
  CHECK(names == std::vector<std::string>{"cam0/1.png", "flat.png", "cam0/0.png", "cam1/0.png", "r_0.png"});
}

TEST_CASE("a point cloud is found by a path with backslashes and what is null is not said", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "a.png", 16, 12);
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  writeText(folder / "points/cloud.ply", ply + "1 2 3\n");
  writeText(folder / "points3d.ply", ply + "4 5 6\n");
  Json json = pinhole({frame("a.png")});
  json["camera_model"] = nullptr;
  const auto pointWith = [&](const Json& path) {
    json["ply_file_path"] = path;
    writeText(folder / "transforms.json", json.dump());
    return loadDataset(folder.path).points.position.at(0);
  };
  CHECK(pointWith("points\\cloud.ply") == glm::vec3(1, 2, 3));
  CHECK(pointWith(nullptr) == glm::vec3(4, 5, 6));
}

TEST_CASE("a COLMAP text without its empty lines is refused and one with a mark of UTF-8 is read", "[dataset]") {
  tg::TemporaryFolder folder;
  ColmapText text;
  text.cameras = "\xef\xbb\xbf" + text.cameras.substr(text.cameras.find("1 PINHOLE"));
  text.write(folder.path);
  CHECK(loadDataset(folder.path).views.size() == 10);
  const fs::path images = folder / "sparse/0/images.txt";
  writeText(images, "1 1 0 0 0 0 0 0 1 image0.png\n2 1 0 0 0 0 0 0 1 image1.png\n");
  CHECK_THAT(refusal(folder.path), Contains("images.txt: line 2: expected the 2D points of 'image0.png'"));
  writeText(images, "1 1 0 0 0 0 0 0 1 image0.png\n2 1 0 0 0 0 0 0 1 my 1 1\n");
  CHECK_THAT(refusal(folder.path), Contains("images.txt: line 2: expected the 2D points of 'image0.png'"));
  writeText(images, "1 1 0 0 0 0 0 0 1 image0.png\n 1.5e2\t-2 -1 nan 4 5 \r\n2 1 0 0 0 0 0 0 1 image1.png");
  CHECK(loadDataset(folder.path).views.size() == 2);
}

TEST_CASE("cameras of instant-ngp that pinholes do not stand for are refused by their key", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "a.png", 16, 12);
  const auto refused = [&](const Json& json) {
    writeText(folder / "transforms.json", json.dump());
    return refusal(folder.path);
  };
  const Json usual = pinhole({frame("a.png")});
  Json json = usual;
  json["ftheta_p0"] = 1.0;
  CHECK_THAT(refused(json), Contains("transforms.json: camera 'ftheta_p0' is not supported: undistort"));
  json = usual;
  json["frames"][0]["latlong"] = true;
  CHECK_THAT(refused(json), Contains("frame 0: camera 'latlong' is not supported"));
  json["frames"][0]["latlong"] = false;
  CHECK(refused(json) == "accepted");
  // Without a second pose there is nothing that the rows of a photograph lie between.
  json["rolling_shutter"] = {0, 0, 1, 0};
  CHECK(refused(json) == "accepted");
  json["frames"][0]["transform_matrix_end"] = kIdentity;
  CHECK_THAT(refused(json), Contains("frame 0: 'rolling_shutter' is not supported"));
  json["rolling_shutter"] = {0, 0, 0.0, 0};
  CHECK(refused(json) == "accepted");
}

TEST_CASE("refuses a COLMAP file that ends anywhere, without crash or huge allocation", "[dataset]") {
  tg::TemporaryFolder folder;
  const ColmapBinary whole;
  whole.write(folder.path);
  const auto everyTruncation = [&](const std::string& file, const std::string& bytes) {
    for (std::size_t length = 0; length < bytes.size(); length += 1 + length / 40) {
      writeText(folder / file, bytes.substr(0, length));
      CHECK_THAT(refusal([&] { tg::readColmap(folder.path); }), Contains("3 ") && Contains(file));
    }
    writeText(folder / file, bytes);
  };
  everyTruncation("sparse/0/cameras.bin", whole.cameras);
  everyTruncation("sparse/0/images.bin", whole.images);
  everyTruncation("sparse/0/points3D.bin", whole.points);
  // A count of 2^61 records.
  writeText(folder / "sparse/0/points3D.bin", Bytes().add<std::uint64_t>(std::uint64_t{1} << 61).data());
  CHECK_THAT(refusal([&] { tg::readColmap(folder.path); }), Contains("too short"));
}

TEST_CASE("refuses broken COLMAP content with its place", "[dataset]") {
  tg::TemporaryFolder folder;
  ColmapText text;
  text.write(folder.path);
  const fs::path images = folder / "sparse/0/images.txt";
  writeText(images, "1 1 0 0 0 0 0 0 5 a.png\n\n");
  CHECK_THAT(refusal(folder.path), Contains("names camera 5, which cameras.txt lacks"));
  writeText(images, "1 0 0 0 0 0 0 0 1 a.png\n\n");
  CHECK_THAT(refusal(folder.path), Contains("image 'a.png': the pose is not usable"));
  writeText(images, "1 1 0 0 oops 0 0 0 1 a.png\n\n");
  CHECK_THAT(refusal(folder.path), Contains("line 1: expected a quaternion"));
  writeText(images, text.images);
  writeText(folder / "sparse/0/cameras.txt", "1 PINHOLE 16 12 20 21 7.5\n");
  CHECK_THAT(refusal(folder.path), Contains("wrong number of parameters (expected 4, found 3)"));
  writeText(folder / "sparse/0/cameras.txt", "1 PINHOLE 16 12 -20 21 7.5 6.5\n");
  CHECK_THAT(refusal(folder.path), Contains("focal length is not positive"));
  writeText(folder / "sparse/0/cameras.txt", "1 PINHOLE 16 0 20 21 7.5 6.5\n");
  CHECK_THAT(refusal(folder.path), Contains("image size out of range (expected 1 to 1048576 pixels a side, found 16"));
  writeText(folder / "sparse/0/cameras.txt", "1 SIMPLE_RADIAL 16 12 20 8 6 1e20\n");
  CHECK_THAT(refusal(folder.path), Contains(".png: the lens distortion is implausible"));
}

TEST_CASE("a data set that names a pipe or a device is refused, not waited for", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "images/0.png", 16, 12);
  Json named = frame("images/0.png");
  named["mask_path"] = "mask";
  writeText(folder / "transforms.json", pinhole({named}).dump());
  REQUIRE(::mkfifo((folder / "mask").c_str(), 0600) == 0);
  CHECK(refusal(folder.path) == "2 " + (folder / "mask").string() + ": is no regular file");
  fs::remove(folder / "mask");
  fs::create_symlink("/dev/null", folder / "mask");
  CHECK(refusal(folder.path) == "2 " + (folder / "mask").string() + ": is no regular file");

  for (const char* extension : {".txt", ".bin"}) {
    tg::TemporaryFolder colmap;
    const fs::path cameras = colmap / ("sparse/0/cameras" + std::string(extension));
    const fs::path images = colmap / ("sparse/0/images" + std::string(extension));
    writeText(cameras, std::string(8, extension[1] == 't' ? '\n' : '\0'));
    REQUIRE(::mkfifo(images.c_str(), 0600) == 0);
    CHECK(refusal(colmap.path) == "2 " + images.string() + ": is no regular file");
  }

  tg::TemporaryFolder block;
  REQUIRE(::mkfifo((block / "points3d.ply").c_str(), 0600) == 0);
  CHECK(refusal([&] { tg::readPointCloudPly(block / "points3d.ply"); }) ==
        "2 " + (block / "points3d.ply").string() + ": is no regular file");
}

TEST_CASE("files of gigabytes that are none of a data set's are refused without being read", "[dataset]") {
  TG_SKIP_IF(noAddressSpaceLimit());
  constexpr std::uintmax_t kSize = std::uintmax_t{3} << 30;  // with holes: on disk they take nothing
  tg::TemporaryFolder folder, text, binary;
  writePicture(folder / "images/0.png", 16, 12);
  writeText(folder / "images/1.png", "no picture");
  fs::resize_file(folder / "images/1.png", kSize);
  writeText(folder / "points.ply", "no points");
  fs::resize_file(folder / "points.ply", kSize);
  ColmapText().write(text.path);
  fs::resize_file(text / "sparse/0/images.txt", kSize);
  for (const char* name : {"cameras.bin", "images.bin"}) writeText(binary / "sparse/0" / name, std::string(8, '\0'));
  fs::resize_file(binary / "sparse/0/images.bin", kSize);

  const AddressSpaceLimit limit(std::uint64_t{1} << 30);
  writeText(folder / "transforms.json", pinhole({frame("images/0.png"), frame("images/1.png")}).dump());
  CHECK(refusal(folder.path) ==
        "3 " + (folder / "images/1.png").string() + ": unknown image format (expected PNG, JPEG, WebP or EXR)");
  Json named = pinhole({frame("images/0.png")});
  named["ply_file_path"] = "points.ply";
  writeText(folder / "transforms.json", named.dump());
  CHECK_THAT(refusal(folder.path), Contains("points.ply: "));
  CHECK(refusal(text.path) == "3 " + (text / "sparse/0/images.txt").string() + ": line 21: holds a byte of value 0");
  CHECK(refusal(binary.path) == "3 " + binary.path.string() + ": the data set lists no images");
}

TEST_CASE("a name as long as a file is quoted by its beginning and its end", "[dataset]") {
  tg::TemporaryFolder colmap, transforms;
  const std::string name(1'000'000, 'x'), quoted = tg::shortened(name);
  ColmapText text;
  text.write(colmap.path);
  for (int i = 0; i < 10; ++i) writePicture(colmap / ("images/image" + std::to_string(i) + ".png"), 16, 12);
  text.images += "11 1 0 0 0 0 0 5 1 " + name + "\n\n";
  text.write(colmap.path);
  CHECK_THAT(loadDataset(colmap.path).notes.at(0), Contains("(the first: images/" + quoted.substr(7) + ")"));
  text.images += "12 0 0 0 0 0 0 5 1 " + name + "\n\n";
  text.write(colmap.path);
  CHECK_THAT(refusal(colmap.path), Contains("image '" + quoted + "': the pose is not usable"));
  text.images = "11 1 0 0 0 0 0 5 1 " + name + "\n\n";
  text.write(colmap.path);
  CHECK_THAT(refusal(colmap.path), Contains("(expected images/" + quoted.substr(7) + " and others"));

  writePicture(transforms / "a.png", 16, 12);
  Json json = pinhole({frame("a.png")});
  json["ply_file_path"] = std::string(4000, 'x');
  writeText(transforms / "transforms.json", json.dump());
  CHECK_THAT(loadDataset(transforms.path).notes.at(0), Contains(quoted + ", which transforms.json names, is missing"));
}

TEST_CASE("a path in transforms.json that holds a zero or is longer than any is refused", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "a.png", 16, 12);
  for (const char* key : {"file_path", "mask_path", "ply_file_path"}) {
    for (const std::string& path : {std::string("a.png") + '\0' + "b", std::string(5000, 'x')}) {
      Json json = pinhole({frame("a.png")});
      (key[0] == 'p' ? json : json["frames"][0])[key] = path;
      writeText(folder / "transforms.json", json.dump());
      CHECK(refusal(folder.path) == "3 " + (folder / "transforms.json").string() + ": " +
                                        (key[0] == 'p' ? "" : "frame 0: ") + "'" + key + "' is not a path");
    }
  }
}

TEST_CASE("refuses what is no data set and says what it looked for", "[dataset]") {
  tg::TemporaryFolder folder;
  CHECK_THAT(refusal(folder.path), Contains("3 ") && Contains("transforms_train.json") && Contains("transforms.json") &&
                                       Contains("sparse/0"));
  CHECK_THAT(refusal(folder / "absent"), Contains("2 ") && Contains("no such folder"));
  writeText(folder / "file", "");
  CHECK_THAT(refusal(folder / "file"), Contains("2 ") && Contains("not a folder"));
}

TEST_CASE("refuses broken transforms.json with the frame it is about", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "a.png", 16, 12);
  const auto refused = [&](const Json& json) {
    writeText(folder / "transforms.json", json.dump());
    return refusal(folder.path);
  };
  writeText(folder / "transforms.json", "{\"frames\": [");
  CHECK_THAT(refusal(folder.path),
             Contains("3 ") && Contains("transforms.json: not valid JSON") && Contains("line 1, column 13"));
  writeText(folder / "transforms.json", "");
  CHECK_THAT(refusal(folder.path), Contains("not valid JSON"));
  CHECK_THAT(refused(Json::array()), Contains("expected a JSON object"));
  CHECK_THAT(refused(Json::object()), Contains("expected an array 'frames'"));
  CHECK_THAT(refused(pinhole(Json::array())), Contains("lists no images"));
  CHECK_THAT(refused(pinhole({frame("b.png")})), Contains("none of the 1 listed images exists (expected b.png"));
  CHECK_THAT(refused({{"frames", {frame("a.png")}}}), Contains("frame 0: no intrinsics"));
  CHECK_THAT(refused(pinhole({frame("a.png"), {{"file_path", "a.png"}}})), Contains("frame 1: expected a 4 x 4"));
  CHECK_THAT(refused(pinhole({frame("a.png", {{2, 0, 0, 0}, {0, 2, 0, 0}, {0, 0, 2, 0}, {0, 0, 0, 1}})})),
             Contains("not a rotation and a translation"));
  CHECK_THAT(refused(pinhole({frame("a.png", {{-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}})})),
             Contains("not a rotation and a translation"));
  for (const Json& row : {Json{0, 0, 0, 2}, {0, 0.01, 0, 1}}) {
    CHECK_THAT(refused(pinhole({frame("a.png", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, row})})),
               Contains("frame 0: 'transform_matrix' is not a rotation and a translation (expected a last row of 0, 0, "
                        "0, 1, found "));
  }
  CHECK_THAT(refused(pinhole({frame("a.png", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 1}})})),
             Contains("frame 0: expected a 4 x 4"));
  CHECK(refused(pinhole({frame("a.png", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}})})) == "accepted");
  CHECK(refused(pinhole({frame("a.png", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {1e-5, 0, 0, 1}})})) == "accepted");
  for (const char* key : {"k4", "k5", "s1"}) {
    Json distorted = pinhole({frame("a.png")});
    distorted[key] = -0.08;
    CHECK_THAT(refused(distorted), Contains("lens distortion '" + std::string(key) +
                                            "' is not supported with camera model OPENCV (expected 0, found -0.08)"));
  }
  Json panorama = pinhole({frame("a.png")});
  panorama["camera_model"] = "EQUIRECTANGULAR";
  CHECK_THAT(refused(panorama), Contains("camera model 'EQUIRECTANGULAR' is not supported"));
  Json fisheye = pinhole({frame("a.png")});
  fisheye["camera_model"] = "OPENCV_FISHEYE";
  fisheye["p1"] = 0.1;
  CHECK_THAT(refused(fisheye), Contains("'p1' is not supported with camera model OPENCV_FISHEYE"));
  Json implausible = pinhole({frame("a.png")});
  implausible["k1"] = 1e6;
  CHECK_THAT(refused(implausible), Contains("3 ") && Contains("a.png: the lens distortion (OPENCV) is implausible"));
  Json huge = pinhole({frame("a.png")});
  huge["w"] = 1e12;
  CHECK_THAT(refused(huge), Contains("transforms.json: image size out of range (expected 1 to 1048576 pixels a side"));
  // What a frame says is told of the frame.
  for (const auto& [key, value] : {std::pair<const char*, Json>("fl_x", "20"),
                                   {"fl_y", -1},
                                   {"camera_angle_x", 7},
                                   {"w", 1e12},
                                   {"k4", 0.1},
                                   {"camera_model", "EQUIRECTANGULAR"}}) {
    Json json = pinhole({frame("a.png"), frame("a.png")});
    json["frames"][1][key] = value;
    INFO(key);
    CHECK_THAT(refused(json), Contains("transforms.json: frame 1: "));
  }

  writeText(folder / "transforms.json", pinhole({frame("a.png")}).dump());
  writeText(folder / "a.png", "not an image");
  CHECK_THAT(refusal(folder.path), Contains("3 ") && Contains("a.png"));
  writePicture(folder / "a.png", 16, 12);
  DatasetOptions options;
  options.downscale = 20;
  CHECK_THAT(refusal(folder.path, options), Contains("1 ") && Contains("too small for the downscale factor"));
  options.downscale = 0;
  CHECK_THAT(refusal(folder.path, options), Contains("--downscale: out of range (expected 1 to 64"));
}

TEST_CASE("refuses numbers that float cannot train with", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "a.png", 16, 12);
  const auto refusedWith = [&](const char* key, double value) {
    Json json = pinhole({frame("a.png")});
    json[key] = value;
    writeText(folder / "transforms.json", json.dump());
    return refusal(folder.path);
  };
  CHECK_THAT(refusedWith("fl_x", 1e300), Contains("3 ") && Contains("a.png: focal length out of range"));
  CHECK_THAT(refusedWith("fl_y", 1e-300), Contains("expected 0.001 to 1e9 pixels, found 1e-300"));
  CHECK_THAT(refusedWith("cx", -1e10), Contains("principal point out of range"));
  const Json far = {{1, 0, 0, 1e300}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  writeText(folder / "transforms.json", pinhole({frame("a.png", far)}).dump());
  CHECK_THAT(refusal(folder.path), Contains("3 ") && Contains("camera position"));

  tg::TemporaryFolder colmap;
  ColmapText text;
  text.points = "1 0 0 1e300 9 9 9 0.1\n";
  text.write(colmap.path);
  CHECK_THAT(refusal(colmap.path), Contains("3 ") && Contains("point 0 is out of range (expected -1e9 to 1e9"));
}

TEST_CASE("downscaling by N reads images_N where it holds the photographs at that size", "[dataset]") {
  tg::TemporaryFolder folder;
  ColmapText text;
  text.cameras = "1 PINHOLE 18 14 20 21 7.5 6.5\n";
  text.write(folder.path);  // images of 16 x 12 under a camera of 18 x 14
  const auto reduce = [&](int count, int width, int height) {
    fs::remove_all(folder / "images_4");
    for (int i = 0; i < count; ++i) {
      writePicture(folder / "images_4" / ("image" + std::to_string(i) + ".png"), width, height);
    }
  };
  DatasetOptions options;
  options.downscale = 4;
  reduce(10, 5, 4);  // 18 / 4 and 14 / 4, rounded up by whoever made them
  const tg::Dataset reduced = loadDataset(folder.path, options);
  const tg::Camera& camera = reduced.views[0];
  CHECK(camera.size.x == 5);
  CHECK(camera.size.y == 4);
  CHECK(camera.focal.x == Approx(20.0 * 5 / 18));
  CHECK(camera.center.y == Approx(6.5 * 4 / 14));
  REQUIRE(reduced.notes.size() == 1);
  CHECK_THAT(reduced.notes[0], Contains("read from images_4"));

  SECTION("the originals need not be there") {
    fs::remove_all(folder / "images");
    CHECK(loadDataset(folder.path, options).views[0].size.x == 5);
  }
  SECTION("another size is not used") {
    reduce(10, 8, 7);
    const tg::Dataset dataset = loadDataset(folder.path, options);
    CHECK(dataset.views[0].size.x == 4);
    CHECK_THAT(dataset.notes.at(0), Contains("images_4 is of another size (expected 1/4 of 18 x 14, found 8 x 7)"));
  }
  SECTION("an incomplete folder is not used") {
    reduce(9, 5, 4);
    const tg::Dataset dataset = loadDataset(folder.path, options);
    CHECK(dataset.views[0].size.x == 4);
    CHECK_THAT(dataset.notes.at(0), Contains("images_4 lacks photographs (found 9 of 10)"));
  }
  SECTION("a folder that is named is read as it is") {
    options.images = "images_4";
    options.downscale = 2;
    const tg::Dataset dataset = loadDataset(folder.path, options);
    CHECK(dataset.views[0].size.x == 2);
    CHECK(dataset.views[0].focal.x == Approx(20.0 * 5 / 18 / 2));
    CHECK(dataset.notes.empty());
  }
}

TEST_CASE("lengths in pixels without a size are of the photographs that are not read", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "images/a.png", 16, 12, 3);
  writePicture(folder / "images_2/a.png", 8, 6, 3);
  Json json = {{"camera_angle_x", 1.0},
               {"fl_x", 20.0},
               {"cx", 9.0},
               {"frames", {frame("images/a.png"), frame("images/gone.png")}}};
  writeText(folder / "transforms.json", json.dump());
  DatasetOptions reduced, named;
  reduced.downscale = 2;
  named.images = "images_2";
  for (const DatasetOptions& options : {reduced, named}) {
    const tg::Dataset dataset = loadDataset(folder.path, options);
    CHECK(dataset.views.at(0).size.x == 8);
    CHECK(dataset.views.at(0).focal.x == Approx(10));
    CHECK(dataset.views.at(0).center.x == Approx(4.5));
    CHECK(dataset.missing_images == 1);
  }
  fs::remove(folder / "images/a.png");
  CHECK_THAT(refusal(folder.path, named), Contains("images/a.png: is not there to tell the size"));
}

TEST_CASE("photographs that are named by absolute paths are those of the folder", "[dataset]") {
  tg::TemporaryFolder folder;
  for (const char* name : {"images/a.png", "images/b.png", "masks/a.png"}) writePicture(folder / name, 16, 12, 3);
  for (const char* name : {"images_2/a.png", "images_2/b.png"}) writePicture(folder / name, 8, 6, 3);
  Json frames = Json::array();
  for (const char* name : {"images/a.png", "images/b.png"}) {
    frames.push_back(frame(fs::absolute(folder / "." / name).string()));
  }
  writeText(folder / "transforms.json", pinhole(frames).dump());
  DatasetOptions options;
  options.downscale = 2;
  for (const fs::path& place : {folder.path, fs::proximate(folder.path)}) {
    const tg::Dataset dataset = loadDataset(place, options);
    CHECK(dataset.files == std::vector<std::string>{"images/b.png", "images/a.png"});
    REQUIRE(dataset.notes.size() == 2);
    CHECK_THAT(dataset.notes[0], Contains("read from images_2"));
    CHECK_THAT(dataset.notes[1], Contains("1 of 2 photographs have a mask"));
  }
}

TEST_CASE("a folder of images that no image could follow is refused", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "train/r_0.png", 16, 12, 3);
  writeText(folder / "transforms.json", Json{{"camera_angle_x", 1.0}, {"frames", {frame("./train/r_0")}}}.dump());
  tg::DatasetOptions options;
  options.images = "nonsense";
  CHECK(tg::test::messageOf([&] { loadDataset(folder.path, options); }, tg::ErrorKind::usage) ==
        folder.path.string() + ": lists no images in a folder \"images\", whose place --image-folder would take");
}

TEST_CASE("what stands beside a camera's angle counts, and a split of calibrated photographs is no synthetic scene",
          "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "images/a.png", 16, 12, 3);
  Json json = {{"camera_angle_x", 2 * std::atan(0.5)}, {"cx", 9.5}, {"fl_y", 20.0}, {"frames", {frame("./images/a")}}};
  for (const bool sized : {false, true}) {
    if (sized) json.update({{"w", 32}, {"h", 24}, {"cx", 19.0}, {"fl_y", 40.0}});
    writeText(folder / "transforms.json", json.dump());
    const tg::Camera camera = loadDataset(folder.path).views.at(0);
    CAPTURE(sized);
    CHECK(camera.focal.x == Approx(16));
    CHECK(camera.focal.y == Approx(20));
    CHECK(camera.center.x == Approx(9.5));
    CHECK(camera.center.y == Approx(6));
  }
  json["fl_x"] = 32.0;
  fs::remove(folder / "transforms.json");
  writeText(folder / "transforms_train.json", json.dump());
  CHECK(loadDataset(folder.path).layout == tg::DatasetLayout::transforms);
  CHECK(loadDataset(folder.path).background == glm::vec3(0.0f));
  writeText(folder / "transforms.json", json.dump());  // beside it, it says as much
  CHECK(loadDataset(folder.path).layout == tg::DatasetLayout::transforms);
  fs::remove(folder / "transforms.json");
  json.erase("fl_x");
  writeText(folder / "transforms_train.json", json.dump());
  CHECK(loadDataset(folder.path).layout == tg::DatasetLayout::nerfSynthetic);
}

TEST_CASE("masks are found by name, or named by a frame", "[dataset]") {
  tg::TemporaryFolder folder;
  const auto writeMask = [&](const fs::path& path, int hidden) {
    fs::create_directories(path.parent_path());
    tg::Image mask(16, 12, 1, 1.0f);
    for (int x = 0; x < hidden; ++x) mask.at(x, 0, 0) = 0;
    tg::writeImage(path, mask);
  };
  const auto hidden = [](const tg::Dataset& dataset, std::size_t view) {
    const std::vector<std::uint8_t>& mask = dataset.pixels(view)->mask;
    return mask.empty() ? -1 : static_cast<int>(std::count(mask.begin(), mask.end(), 0));
  };
  DatasetOptions all;
  all.test_every = 0;
  SECTION("COLMAP") {
    ColmapText().write(folder.path);
    writeMask(folder / "masks/image1.png.png", 3);
    writeMask(folder / "masks/image1.png", 5);  // the longer name goes first
    writeMask(folder / "masks/image2.png.mask.png", 4);
    writeMask(folder / "masks/image3.png", 6);
    writeMask(folder / "masks/image3_mask.png", 7);  // the last of the names
    writeMask(folder / "masks/image4_mask.png", 8);
    const tg::Dataset dataset = loadDataset(folder.path, all);
    CHECK(hidden(dataset, 0) == -1);
    CHECK(hidden(dataset, 1) == 3);
    CHECK(hidden(dataset, 2) == 4);
    CHECK(hidden(dataset, 3) == 6);
    CHECK(hidden(dataset, 4) == 8);
    REQUIRE(dataset.notes.size() == 1);
    CHECK_THAT(dataset.notes[0], Contains("4 of 10 photographs have a mask"));
    DatasetOptions background = all;
    background.masks = tg::MaskMeaning::background;
    const tg::Dataset cut = loadDataset(folder.path, background);
    CHECK(hidden(cut, 1) == -1);
    CHECK(std::ranges::count(std::span(cut.pixels(1)->rgb).first(9), 0) == 9);  // three pixels of black
    CHECK_THAT(cut.notes.at(0), Contains("pixels where it is 0 are background"));
    fs::remove_all(folder / "masks");
    writeMask(folder / "masks/other.png", 1);
    CHECK_THAT(loadDataset(folder.path).notes.at(0), Contains("masks holds no mask that goes with a photograph"));
  }
  SECTION("JSON") {
    Json frames = {frame("images/a.png"), frame("images/b.png"), frame("c.png")};
    for (const char* file : {"images/a.png", "images/b.png", "c.png"}) writePicture(folder / file, 16, 12);
    frames[0]["mask_path"] = "elsewhere/hide.png";
    writeMask(folder / "elsewhere/hide.png", 2);
    writeMask(folder / "masks/a.png", 9);  // a mask that is named wins
    writeMask(folder / "masks/b.png", 3);
    writeMask(folder / "masks/c.png", 4);
    writeText(folder / "transforms.json", pinhole(frames).dump());
    const tg::Dataset dataset = loadDataset(folder.path, all);
    CHECK(hidden(dataset, 0) == 2);
    CHECK(hidden(dataset, 1) == 3);
    CHECK(hidden(dataset, 2) == 4);
    fs::remove(folder / "elsewhere/hide.png");
    CHECK_THAT(refusal(folder.path), Contains("2 ") && Contains("hide.png"));
    frames[0]["mask_path"] = 7;
    writeText(folder / "transforms.json", pinhole(frames).dump());
    CHECK_THAT(refusal(folder.path), Contains("frame 0: 'mask_path' is not a path"));
  }
  SECTION("NeRF-synthetic: train and test views of one name have masks of their own") {
    for (const char* side : {"train", "test"}) {
      writePicture(folder / side / "r_0.png", 16, 12);
      writeText(folder / ("transforms_" + std::string(side) + ".json"),
                Json{{"camera_angle_x", 1.0}, {"frames", {frame("./" + std::string(side) + "/r_0")}}}.dump());
    }
    writeMask(folder / "masks/train/r_0.png", 1);
    writeMask(folder / "masks/test/r_0.png", 2);
    const tg::Dataset dataset = loadDataset(folder.path);
    CHECK(hidden(dataset, 0) == 1);
    CHECK(hidden(dataset, 1) == 2);
  }
}

TEST_CASE("nerfstudio's points are in the frame of its poses: applied_transform is not applied again", "[dataset]") {
  tg::TemporaryFolder folder;
  for (const char* file : {"images/a.png", "images/b.png"}) writePicture(folder / file, 16, 12);
  const Json moved = {{1, 0, 0, 4}, {0, 1, 0, 5}, {0, 0, 1, 6}, {0, 0, 0, 1}};
  Json json = pinhole({frame("images/a.png", moved), frame("./images/b.png")});
  json["applied_transform"] = {{1, 0, 0, 0}, {0, 0, 1, 0}, {0, -1, 0, 0}};
  json["ply_file_path"] = "sparse_pc.ply";
  json["train_filenames"] = {"./images/b.png"};
  json["test_filenames"] = {"./images/a.png"};
  writeText(folder / "transforms.json", json.dump());
  const std::string header = "ply\nformat ascii 1.0\nelement vertex ";
  const std::string properties = "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  writeText(folder / "sparse_pc.ply", header + "1" + properties + "1 2 3\n");
  const tg::Dataset dataset = loadDataset(folder.path);
  REQUIRE(dataset.points.position.size() == 1);
  CHECK(dataset.points.position[0] == glm::vec3(1, 2, 3));
  REQUIRE(dataset.views.size() == 2);
  CHECK(dataset.views[0].name == "b.png");
  CHECK(dataset.views[1].test);  // listed, though the first of all names
  CHECK(dataset.views[1].name == "a.png");
  CHECK(glm::length(dataset.views[1].position() - glm::dvec3(4, 5, 6)) < 1e-12);
  DatasetOptions test;
  test.only_test = true;
  CHECK(loadDataset(folder.path, test).views.size() == 1);
  CHECK(loadDataset(folder.path, test).views[0].name == "a.png");

  writeText(folder / "sparse_pc.ply", header + "0" + properties);
  CHECK_THAT(loadDataset(folder.path).notes.at(0), Contains("sparse_pc.ply holds no points"));
  DatasetOptions points;
  points.points = folder / "sparse_pc.ply";
  CHECK_THAT(refusal(folder.path, points), Contains("3 ") && Contains("sparse_pc.ply: holds no points"));
  std::filesystem::remove(folder / "sparse_pc.ply");
  CHECK_THAT(loadDataset(folder.path).notes.at(0), Contains("sparse_pc.ply, which transforms.json names, is missing"));
  json["test_filenames"] = "a.png";
  writeText(folder / "transforms.json", json.dump());
  CHECK_THAT(refusal(folder.path), Contains("'test_filenames' is not an array"));
}

TEST_CASE("nerfstudio's lists say what is trained, what is held out and what is neither", "[dataset]") {
  tg::TemporaryFolder folder;
  Json frames = Json::array();
  for (const char* name : {"a", "b", "c", "d"}) {
    const std::string image = std::string("images/") + name + ".png";
    writePicture(folder / image, 16, 12);
    frames.push_back(frame(image));
  }
  Json json = pinhole(frames);
  json["train_filenames"] = {"./images/b.png", "images/c.png"};
  json["val_filenames"] = {"images/d.png"};
  const auto views = [&] {
    writeText(folder / "transforms.json", json.dump());
    std::string names;
    for (const tg::Camera& view : loadDataset(folder.path).views) names += (view.test ? "test " : "") + view.name + " ";
    return names;
  };
  CHECK(views() == "b.png c.png test d.png ");
  CHECK_THAT(loadDataset(folder.path).notes.at(0), Contains("1 of 4 frames are left out"));
  json["test_filenames"] = {"images/a.png"};
  CHECK(views() == "b.png c.png test a.png ");
  // However paths are written; what is left out need not be of a camera that is known.
  json["test_filenames"] = {(folder / "images/a.png").string()};
  json["train_filenames"] = {"images/b.png", "images/../images/c.png"};
  json["frames"][1]["file_path"] = "images/b";
  json["frames"][3]["camera_model"] = "FISHEYE624";
  CHECK(views() == "b.png c.png test a.png ");
  json["frames"] = frames;
  json["val_filenames"] = nullptr;
  json.erase("test_filenames");
  CHECK(views() == "c.png test b.png ");  // every 8th of what is listed
  json["test_filenames"] = Json::array();
  CHECK(views() == "b.png c.png ");
  CHECK_THAT(loadDataset(folder.path).notes.at(1), Contains("no view is held out"));
  json["test_filenames"] = {"images/f.png"};
  writeText(folder / "transforms.json", json.dump());
  CHECK_THAT(refusal(folder.path), Contains("held out names none of the 4 frames"));
  json.erase("test_filenames");
  json["train_filenames"] = {"images/e.png"};
  writeText(folder / "transforms.json", json.dump());
  CHECK_THAT(refusal(folder.path), Contains("train_filenames names none of the 4 frames"));
  json["train_filenames"] = 3;
  writeText(folder / "transforms.json", json.dump());
  CHECK_THAT(refusal(folder.path), Contains("'train_filenames' is not an array"));
}

TEST_CASE("the layout that is asked for is the one that is read", "[dataset]") {
  tg::TemporaryFolder folder;
  writePicture(folder / "a.png", 16, 12);
  writePicture(folder / "b.png", 16, 12);
  writeText(folder / "transforms.json", pinhole({frame("a.png")}).dump());
  DatasetOptions options;
  options.layout = tg::DatasetLayout::nerfSynthetic;
  CHECK_THAT(refusal(folder.path, options), Contains("3 ") && Contains("expected transforms_train.json, found "
                                                                       "transforms.json: use --layout transforms"));
  writeText(folder / "transforms_train.json", pinhole({frame("b.png")}).dump());
  CHECK(loadDataset(folder.path, options).views[0].name == "b.png");
  options.layout = tg::DatasetLayout::transforms;
  CHECK(loadDataset(folder.path, options).views[0].name == "a.png");
  fs::remove(folder / "transforms.json");
  CHECK(loadDataset(folder.path, options).views[0].name == "b.png");
}

TEST_CASE("a data set reads the same pixels whatever the memory limit, a random background keeps alpha", "[dataset]") {
  tg::TemporaryFolder folder;
  Json frames = Json::array();
  for (int i = 0; i < 6; ++i) {
    const std::string file = std::to_string(i) + ".png";
    tg::Image image(16, 12, 4, static_cast<float>(i) / 6);
    tg::writeImage(folder / file, image);
    frames.push_back(frame(file));
  }
  writeText(folder / "transforms.json", pinhole(frames).dump());
  const tg::Dataset kept = loadDataset(folder.path);
  CHECK(kept.photographs->keptViews() == 6);
  DatasetOptions options;
  options.image_memory = 16 * 12 * 3 * 5;
  const tg::Dataset streamed = loadDataset(folder.path, options);
  CHECK(streamed.photographs->keptViews() == 2);
  CHECK_THAT(streamed.notes.at(0), Contains("4 of 6 are decoded whenever they are needed"));
  options.random_background = true;
  const tg::Dataset random = loadDataset(folder.path, options);
  for (std::size_t i = 0; i < 6; ++i) {
    streamed.prefetch((i + 1) % 6);
    CHECK(streamed.pixels(i)->rgb == kept.pixels(i)->rgb);
    CHECK(random.pixels(i)->rgb == kept.pixels(i)->rgb);
    CHECK(kept.composited(i, glm::vec3(1.0f))->rgb == kept.pixels(i)->rgb);
  }
  // View 1 of the training views is 2.png: 2/6 grey at alpha 2/6, 85 of 255, over white.
  REQUIRE(random.views[1].name == "2.png");
  CHECK(random.composited(1, glm::vec3(1.0f))->rgb[0] == std::lround(85 * (85 / 255.0) + 255 * (1 - 85 / 255.0)));
}

TEST_CASE("the extent is 1.1 times the largest distance from the training cameras' mean", "[dataset]") {
  tg::Dataset dataset;
  for (double x : {-1.0, 0.0, 4.0, 100.0}) {
    tg::Camera camera;
    camera.translation = {-x, 0, 0};
    camera.test = x == 100.0;
    dataset.views.push_back(camera);
  }
  CHECK(tg::cameraExtent(dataset) == Approx(3.3));
  tg::Dataset panorama = dataset;
  for (std::size_t i = 0; i < panorama.views.size(); ++i) {
    const double angle = 0.7 * static_cast<double>(i);
    const glm::dvec3 eye(0.1, 0.2, 0.3), to(std::cos(angle), 0.1, std::sin(angle));
    panorama.views[i] = tg::lookAt(eye, eye + to, {0, -1, 0}, 0.8, 64, 48);
  }
  CHECK(tg::cameraExtent(panorama) == 1.0);  // but for rounding at one place
  for (std::size_t i = 0; i < panorama.views.size(); ++i) {  // at the origin the rounding is all there is
    panorama.views[i].translation = {i % 2 == 0 ? 1e-8 : -1e-8, 0, 0};
  }
  CHECK(tg::cameraExtent(panorama) < 1e-7);
  panorama.points.position = {panorama.views[0].position() + 5.0 * glm::transpose(panorama.views[0].rotation)[2]};
  CHECK(tg::sceneExtent(panorama, 2) == 1.0);
}

TEST_CASE("the extent of a scene is bounded by how near its points are seen", "[dataset]") {
  tg::Dataset dataset;
  for (double x : {-30.0, 0.0, 30.0}) {
    tg::Camera camera;
    camera.size = {100, 100};
    camera.focal = {50, 50};
    camera.center = {50, 50};
    camera.translation = {-x, 0, 0};
    dataset.views.push_back(camera);
  }
  CHECK(tg::sceneExtent(dataset, 2) == Approx(33));  // without points
  // Seen by all three cameras from farther away, too, and one that none sees.
  dataset.points.position = {{-30, 0, 2}, {0, 1, 4}, {30, 0, 5}, {0, 0, -1}};
  CHECK(tg::sceneExtent(dataset, 2) == Approx(8));
  CHECK(tg::sceneExtent(dataset, 9) == Approx(33));
  CHECK(tg::sceneExtent(dataset, 0) == Approx(33));
  dataset.points.position = {{0, 0, -1}};
  CHECK(tg::sceneExtent(dataset, 2) == Approx(33));
}

TEST_CASE("reads the shared scenes, COLMAP and JSON poses of one scene agree", "[dataset][shared]") {
  TG_SKIP_IF(tg::test::missingShared({"data/fox"}));
  const tg::DatasetIndex colmap = tg::readColmap(tg::test::sharedFile("data/fox"));
  const tg::DatasetIndex json = tg::readTransforms(tg::test::sharedFile("data/fox"));
  REQUIRE(colmap.entries.size() == 50);
  REQUIRE(json.entries.size() == 50);
  CHECK(colmap.points.position.size() == 11357);
  for (const auto& a : colmap.entries) {
    for (const auto& b : json.entries) {
      if (a.camera.name != b.camera.name) continue;
      CHECK(glm::length(a.camera.position() - b.camera.position()) < 1e-5);
      for (int c = 0; c < 3; ++c) {
        CHECK(glm::length(a.camera.rotation[c] - b.camera.rotation[c]) < 1e-5);
      }
    }
  }
}

TEST_CASE("a validation split is of the training views, and the test views are not there", "[dataset]") {
  tg::TemporaryFolder folder;
  std::vector<Json> frames;
  for (char c = 'a'; c < 'a' + 20; ++c) {
    frames.push_back(frame(std::string(1, c) + ".png"));
    writePicture(folder / (std::string(1, c) + ".png"), 16, 12);
  }
  writeText(folder / "transforms.json", pinhole(frames).dump());
  tg::DatasetOptions options;
  options.validation = true;
  const tg::Dataset dataset = loadDataset(folder.path, options);
  REQUIRE(dataset.views.size() == 17);  // without a, i, q
  std::string test;
  for (const std::size_t view : dataset.indices(true)) test += dataset.views[view].name.front();
  CHECK(test == "bkt");
}
