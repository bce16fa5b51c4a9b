// SPDX-License-Identifier: Apache-2.0
// Scenes of unusual size and place: what is said of them, and how they are moved and scaled as they are read.
#include "training/data/normalize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/model/camera.h"
#include "core/system/median.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/data/dataset.h"
#include "training/dataset_files.h"

namespace fs = std::filesystem;
using tg::loadDataset;
using namespace tg::test;

namespace {

const glm::dvec3 kUtm(500'000, 5'000'000, 100);

std::string text(double value) {
  std::array<char, 40> digits;
  std::snprintf(digits.data(), digits.size(), "%.17g", value);
  return digits.data();
}

glm::dvec3 pointAt(int i) { return {0.02 * (i % 7) - 0.06, 0.03 * (i % 5) - 0.06, 0.01 * (i % 11) - 0.05}; }

// Ten cameras on a ring of radius 4 about the points, all of it scaled and then moved. binary: points as doubles.
void writeRing(const fs::path& folder, double scale, const glm::dvec3& offset, bool points = true, bool binary = true) {
  std::vector<Json> frames;
  for (int i = 0; i < 10; ++i) {
    const std::string file = "images/" + std::to_string(i) + ".png";
    writePicture(folder / file, 16, 12);
    const glm::dvec3 from = 4.0 * glm::dvec3(std::cos(0.6 * i), std::sin(0.6 * i), 0.3);
    const tg::Camera camera = tg::lookAt(from, {0, 0, 0}, {0, 0, 1}, 1, 16, 12);
    const glm::dmat3 axes = glm::transpose(camera.rotation);  // OpenGL's y and z point the other way
    Json matrix = kIdentity;
    for (int row = 0; row < 3; ++row) {
      matrix[row] = {axes[0][row], -axes[1][row], -axes[2][row], scale * from[row] + offset[row]};
    }
    frames.push_back(frame(file, matrix));
  }
  writeText(folder / "transforms.json", pinhole(std::move(frames)).dump());
  if (!points) return;
  std::string rows;
  for (int i = 0; i < 50; ++i) {
    const glm::dvec3 point = scale * pointAt(i) + offset;
    if (binary) rows.append(reinterpret_cast<const char*>(&point), sizeof point);
    if (!binary) rows += text(point.x) + " " + text(point.y) + " " + text(point.z) + "\n";
  }
  writeText(folder / "points3d.ply", std::string("ply\nformat ") + (binary ? "binary_little_endian" : "ascii") +
                                         " 1.0\nelement vertex 50\nproperty double x\nproperty double y\n"
                                         "property double z\nend_header\n" +
                                         rows);
}

tg::Dataset normalized(const fs::path& folder, tg::DatasetOptions options = {}) {
  options.normalize = true;
  return loadDataset(folder, options);
}

// [world units] how far cameras and points of two data sets are apart at most.
double apart(const tg::Dataset& a, const tg::Dataset& b) {
  REQUIRE(a.views.size() == b.views.size());
  REQUIRE(a.points.position.size() == b.points.position.size());
  double most = 0;
  for (std::size_t i = 0; i < a.views.size(); ++i) {
    most = std::max(most, glm::length(a.views[i].position() - b.views[i].position()));
  }
  for (std::size_t i = 0; i < a.points.position.size(); ++i) {
    most = std::max(most, double{glm::length(a.points.position[i] - b.points.position[i])});
  }
  return most;
}

std::vector<std::string> notesOf(const fs::path& folder) {
  tg::DatasetOptions options;
  options.normalize_by = "--normalize";
  return loadDataset(folder, options).notes;
}

// [world units] of cameras from the origin.
double medianDistance(const tg::Dataset& dataset) {
  std::vector<double> distances;
  for (const tg::Camera& view : dataset.views) distances.push_back(glm::length(view.position()));
  return tg::medianOf(std::move(distances));
}

}  // namespace

TEST_CASE("a scene that lies before the near plane is told of, with points and without", "[dataset]") {
  const tg::TemporaryFolder folder;
  const std::string near = "than 0.2, where nothing is drawn (add --normalize)";
  for (const bool points : {true, false}) {
    writeRing(folder / "usual", 1, {}, points);
    writeRing(folder / "small", 0.03, {}, points);
    CHECK(notesOf(folder / "usual").empty());
    REQUIRE(notesOf(folder / "small").size() == 1);
    CHECK_THAT(notesOf(folder / "small")[0], Contains(near));
    CHECK_THAT(loadDataset(folder / "small").notes.at(0), Catch::Matchers::EndsWith("where nothing is drawn"));
    fs::remove_all(folder / "usual");
    fs::remove_all(folder / "small");
  }
}

TEST_CASE("a scene so far out that floats are coarser than its pixels is told of", "[dataset]") {
  const tg::TemporaryFolder folder;
  for (const bool points : {true, false}) {
    writeRing(folder / "near", 1, {1000, 0, 0}, points);
    writeRing(folder / "far", 1, kUtm, points);
    CHECK(notesOf(folder / "near").empty());
    const std::string said = " lie 5e+06 from the origin, where floats are 0.5 apart (add --normalize)";
    CHECK(notesOf(folder / "far") == std::vector{(points ? "points" : "cameras") + said});
    fs::remove_all(folder / "near");
    fs::remove_all(folder / "far");
  }
}

TEST_CASE("normalized scenes are the same wherever they lie and however large they are", "[dataset]") {
  const tg::TemporaryFolder folder;
  writeRing(folder / "usual", 1, {});
  const tg::Dataset usual = normalized(folder / "usual");
  CHECK(1.1 * medianDistance(usual) == Approx(tg::kNormalExtent));
  CHECK(usual.normalized);
  const auto [scale, offset] = GENERATE(table<double, glm::dvec3>({{0.001, {0, 0, 0}}, {1, kUtm}, {1e5, -kUtm}}));
  const bool binary = GENERATE(true, false);
  CAPTURE(scale, offset.x, binary);
  writeRing(folder / "moved", scale, offset, true, binary);
  CHECK(apart(usual, normalized(folder / "moved")) < 1e-6);  // doubles: 1e-9 m of 5e6 m
}

TEST_CASE("a normalized scene is the same for every split and tgconvert's edits bring it back", "[dataset]") {
  const tg::TemporaryFolder folder;
  writeRing(folder / "scene", 0.03, {10, 20, 30});
  const tg::Dataset dataset = normalized(folder / "scene");
  REQUIRE(dataset.notes.size() == 1);
  tg::DatasetOptions test;
  test.only_test = true;
  const tg::Dataset held_out = normalized(folder / "scene", test);
  const std::vector<std::size_t> indices = dataset.indices(true);
  REQUIRE(held_out.views.size() == indices.size());
  for (std::size_t i = 0; i < indices.size(); ++i) {
    CHECK(held_out.views[i].translation == dataset.views[indices[i]].translation);
  }
  tg::DatasetOptions fewer;
  fewer.downscale = 2;
  fewer.test_every = 3;
  CHECK(normalized(folder / "scene", fewer).points.position == dataset.points.position);

  double scale = 0;
  glm::dvec3 offset(0.0);
  const std::string back = dataset.notes[0].substr(dataset.notes[0].find("--scale"));
  REQUIRE(std::sscanf(back.c_str(), "--scale %lf --translate %lf,%lf,%lf", &scale, &offset.x, &offset.y, &offset.z) ==
          4);
  for (int i = 0; i < 50; ++i) {
    const glm::dvec3 point = scale * glm::dvec3(dataset.points.position[static_cast<std::size_t>(i)]) + offset;
    CHECK(glm::length(point - (0.03 * pointAt(i) + glm::dvec3(10, 20, 30))) < 1e-7);
  }
}

TEST_CASE("COLMAP's points keep their doubles until they are normalized", "[dataset]") {
  const tg::TemporaryFolder folder;
  ColmapText at_home;
  at_home.write(folder / "home");
  ColmapText far = at_home;
  far.images.clear();
  for (int i = 0; i < 10; ++i) {  // the quarter turn about y has world z as camera x, and -x as camera z
    far.images += std::to_string(i + 1) + " 2 0 2 0 " + text(i - kUtm.z) + " " + text(-kUtm.y) + " " +
                  text(5 + kUtm.x) + " 1 image" + std::to_string(9 - i) + ".png\n\n";
  }
  far.points = "1 500000.5 4999999 104 255 0 51 0.1 1 0\n7 500001 5000002 103 0 255 0 0.1\n";
  far.write(folder / "far");
  CHECK(apart(normalized(folder / "home"), normalized(folder / "far")) < 1e-6);
  ColmapBinary().write(folder / "binary");
  CHECK(apart(normalized(folder / "home"), normalized(folder / "binary")) < 1e-6);
}

TEST_CASE("of one camera the points set the scale, and without points nothing does", "[dataset]") {
  const tg::TemporaryFolder folder;
  writePicture(folder / "a.png", 16, 12);
  writeText(folder / "transforms.json", pinhole({frame("a.png")}).dump());
  CHECK_THAT(normalized(folder.path).notes[0], Contains("normalized: 1 times as large"));
  writeText(folder / "points3d.ply",
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
            "end_header\n0 0 -0.01\n0 0 -0.02\n0 0 -7\n");
  CHECK(normalized(folder.path).points.position[1] == glm::vec3(0, 0, -tg::kNormalExtent));
}

TEST_CASE("one camera far out does not shrink a scene and neither does a wide path through it", "[dataset]") {
  const tg::TemporaryFolder folder;
  const auto depths = [&](const char* name, double spacing, double outlier) {  // ten cameras that look at z = -5
    std::vector<Json> frames;
    for (int i = 0; i < 10; ++i) {
      const std::string file = "images/" + std::to_string(i) + ".png";
      writePicture(folder / name / file, 16, 12);
      Json matrix = kIdentity;
      matrix[0][3] = spacing * i + (i == 9 ? outlier : 0);
      frames.push_back(frame(file, matrix));
    }
    writeText(folder / name / "transforms.json", pinhole(std::move(frames)).dump());
    std::string rows;
    for (int i = 0; i < 10; ++i) rows += text(spacing * i) + " 0 -5\n";
    writeText(folder / name / "points3d.ply",
              "ply\nformat ascii 1.0\nelement vertex 10\nproperty float x\n"
              "property float y\nproperty float z\nend_header\n" +
                  rows);
    const tg::Dataset dataset = normalized(folder / name);
    CHECK(dataset.notes.size() == 1);  // says the scale and nothing against it
    return -double{dataset.points.position[0].z};
  };
  CHECK(depths("usual", 1, 0) == Approx(5 * tg::kNormalExtent / (1.1 * 3)));
  CHECK(depths("outlier", 1, 1000) == Approx(depths("other", 1, 0)));
  CHECK(depths("wide", 100, 0) == Approx(tg::kNormalDepth));
}

TEST_CASE("cameras close together far from the origin are not at one place", "[dataset]") {
  const tg::TemporaryFolder folder;
  writeRing(folder / "usual", 1, {});
  writeRing(folder / "small", 0.04, kUtm);
  CHECK(notesOf(folder / "small").size() == 2);
  CHECK(apart(normalized(folder / "usual"), normalized(folder / "small")) < 1e-6);
}

TEST_CASE("cameras at one place but for rounding leave the scale to the points", "[dataset]") {
  const tg::TemporaryFolder folder;
  std::vector<Json> frames;
  for (int i = 0; i < 5; ++i) {
    const std::string file = "images/" + std::to_string(i) + ".png";
    writePicture(folder / file, 16, 12);
    Json matrix = kIdentity;
    matrix[0][3] = 2 + 1e-7 * i;
    frames.push_back(frame(file, matrix));
  }
  writeText(folder / "transforms.json", pinhole(std::move(frames)).dump());
  CHECK_THAT(normalized(folder.path).notes.at(0), Contains("normalized: 1 times as large"));
  writeText(folder / "points3d.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
            "end_header\n2 0 -0.02\n");
  CHECK(normalized(folder.path).points.position.at(0).z == Approx(-tg::kNormalExtent));
}

TEST_CASE("cameras that doubles cannot normalize are named, not the points", "[dataset]") {
  const tg::TemporaryFolder folder;
  writeRing(folder / "far", 1e300, {});
  CHECK_THAT(refusal([&] { normalized(folder / "far"); }),
             Contains(".png: camera position out of range (expected -1e100 to 1e100, found "));
  writeRing(folder / "near", 1e-310, {});
  CHECK_THAT(refusal([&] { normalized(folder / "near"); }), Contains("too near each other or too far apart"));
}
