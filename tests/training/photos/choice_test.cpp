// SPDX-License-Identifier: Apache-2.0
// What is chosen: frames of a film, pairs of photographs, words for COLMAP; and what its database tells.
#include <sqlite3.h>

#include <algorithm>
#include <vector>

#include "core/file/file.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/photos/film.h"
#include "training/photos/outcome.h"
#include "training/photos/pairs.h"
#include "training/photos/solver.h"

using Strings = std::vector<std::string>;

TEST_CASE("blur takes sharpness, and the sharpest of each stretch is taken", "[photos]") {
  const std::size_t side = tg::kJudgedSide;
  std::vector<std::uint8_t> sharp(side * side), blurred(side * side), flat(side * side, 99);
  for (std::size_t i = 0; i < sharp.size(); ++i) {
    sharp[i] = (i % side / 8 + i / side / 8) % 2 ? 200 : 20;
    const std::size_t phase = i % side % 16;
    blurred[i] = static_cast<std::uint8_t>(20 + 22 * (phase < 8 ? phase : 16 - phase));
  }
  CHECK(tg::sharpness(flat) == 0);
  CHECK(tg::sharpness(sharp) > 10 * tg::sharpness(blurred));

  tg::SharpnessMeter meter;
  std::vector<std::uint8_t> film;
  for (const auto* frame : {&flat, &sharp, &blurred, &flat}) film.insert(film.end(), frame->begin(), frame->end());
  film.resize(film.size() - 5);  // the last frame is cut off
  for (std::size_t at = 0; at < film.size(); at += 100'003) {
    meter.add(std::span(film).subspan(at, std::min<std::size_t>(100'003, film.size() - at)));
  }
  REQUIRE(meter.frames().size() == 3);
  CHECK(meter.frames()[1] == tg::sharpness(sharp));

  const std::vector<double> values = {1, 5, 2, 9, 9, 3, 4, 0};
  CHECK(tg::sharpestFrames(values, 3) == std::vector<std::size_t>{1, 3, 6});
  CHECK(tg::sharpestFrames(values, 100).size() == 8);
  CHECK(tg::sharpestFrames({}, 3).empty());
}

TEST_CASE("ffmpeg is told of files, not of options or protocols", "[photos]") {
  const Strings words =
      tg::extractFrames("/bin/ffmpeg", "/a/-y:b.mp4", std::vector<std::size_t>{3, 17}, 1600, "/x/50%/im");
  const auto after = [&](const std::string& flag) { return *(std::ranges::find(words, flag) + 1); };
  CHECK(after("-i") == "file:/a/-y:b.mp4");
  CHECK(after("-vf").starts_with("select='eq(n,3)+eq(n,17)',scale="));
  CHECK(words.back() == "file:/x/50%%/im/%06d.jpg");
  CHECK(std::ranges::count(words, std::string("-nostdin")) == 1);
  tg::FilmLength length;
  for (const char* line : {"  Duration: 00:01:02.50, start: 0.0, bitrate: 4 kb/s",
                           "  Stream #0:0: Video: h264, yuv420p, 1920x1080, 29.97 fps, 30 tbr", "Duration: N/A, x"}) {
    length.read(line);
  }
  CHECK(length.frames() == 1873);
}

TEST_CASE("neighbours are matched, and loops are closed, without all pairs", "[photos]") {
  CHECK(tg::allPairs(4).size() == 6);
  const tg::Pairs pairs = tg::sequentialPairs(300);
  CHECK(pairs.size() < 300 * 18);
  const auto has = [&](std::size_t a, std::size_t b) { return std::ranges::count(pairs, std::pair(a, b)) == 1; };
  CHECK(has(0, 1));
  CHECK(has(7, 17));
  CHECK(has(7, 23));
  CHECK(has(0, 290));  // the end of a walk around something with its beginning
  CHECK_FALSE(has(1, 293));
  CHECK(tg::sequentialPairs(1).empty());

  std::vector<tg::Place> places;
  for (int i = 0; i < 250; ++i) places.push_back({47 + 0.001 * (i % 2), 8 + 0.0001 * i});
  const tg::Pairs near = tg::spatialPairs(places);
  CHECK(std::ranges::is_sorted(near));
  CHECK(std::ranges::adjacent_find(near) == near.end());
  CHECK(near.size() < 250 * 36);
  CHECK(std::ranges::count(near, std::pair<std::size_t, std::size_t>(0, 2)) == 1);
  CHECK(std::ranges::count(near, std::pair<std::size_t, std::size_t>(0, 249)) == 0);

  using tg::Matching;
  const std::vector<std::optional<tg::Place>> unknown(201), known(201, tg::Place{1, 2});
  CHECK(tg::chosenMatching(Matching::automatic, true, known) == Matching::sequential);
  CHECK(tg::chosenMatching(Matching::automatic, false, {known.begin(), known.begin() + 200}) == Matching::exhaustive);
  CHECK(tg::chosenMatching(Matching::automatic, false, known) == Matching::spatial);
  CHECK(tg::chosenMatching(Matching::automatic, false, unknown) == Matching::sequential);
  CHECK(tg::chosenMatching(Matching::exhaustive, true, unknown) == Matching::exhaustive);
}

TEST_CASE("COLMAP's options have the names of its version", "[photos]") {
  tg::Solver solver;
  solver.program = "/usr/bin/colmap";
  const auto has = [](const Strings& words, const std::string& word) { return std::ranges::count(words, word) == 1; };
  const auto features = [&] {
    return tg::findFeatures(solver, {"/w/database.db", "/w/images"}, "/w/list.txt", tg::LensModel::opencv,
                            tg::lensParameters(tg::LensModel::opencv, 700.5, 640, 480), 2);
  };
  CHECK(has(features(), "--SiftExtraction.use_gpu"));
  CHECK(has(features(), "700.5,700.5,320,240,0,0,0,0"));
  CHECK(has(tg::matchPairs(solver, {}, "list", 0), "--SiftMatching.use_gpu"));
  solver.renamed_options = true;
  CHECK(has(features(), "--FeatureExtraction.use_gpu"));
  CHECK(has(tg::matchPairs(solver, {}, "list", 0), "--FeatureMatching.use_gpu"));
  CHECK(has(tg::solveCameras(solver, {}, "out", tg::Mapper::global, 3, 0), "global_mapper"));
  CHECK(tg::lensParameters(tg::LensModel::simpleRadial, 700, 640, 480) == "700,320,240,0");

  CHECK(tg::photographsDone("Processed file [27/30]", false) == 27);
  CHECK(tg::photographsDone("Registering image #12 (13)", true) == 13);
  CHECK(tg::photographsDone("I2026 x.cc:1] Registering image #5 (num_reg_frames=21)", true) == 21);
  CHECK(tg::photographsDone("Registering image #12", true) == 0);
  CHECK(tg::photographsDone("Processed file [27/30]", true) == 0);
}

TEST_CASE("a photograph without a camera hears why from COLMAP's database", "[photos]") {
  const tg::TemporaryFolder folder;
  sqlite3* database = nullptr;
  REQUIRE(sqlite3_open((folder / "d.db").c_str(), &database) == SQLITE_OK);
  const auto run = [&](const std::string& text) {
    REQUIRE(sqlite3_exec(database, text.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK);
  };
  run("CREATE TABLE images (image_id INTEGER, name TEXT); CREATE TABLE keypoints (image_id INTEGER, rows INTEGER);"
      "CREATE TABLE matches (pair_id INTEGER, rows INTEGER); CREATE TABLE two_view_geometries (pair_id INTEGER, rows "
      "INTEGER);");
  run("INSERT INTO images VALUES (1, 'a.jpg'), (2, 'b.jpg'), (3, 'c.jpg'), (4, 'd.jpg');"
      "INSERT INTO keypoints VALUES (1, 900), (2, 12), (3, 800), (4, 700);");
  run("INSERT INTO two_view_geometries VALUES (" + std::to_string(2147483647LL * 1 + 4) + ", 17);");
  sqlite3_close(database);
  const Strings reasons = tg::whyLeftOut(folder / "d.db", {"b.jpg", "c.jpg", "d.jpg", "e.jpg"});
  CHECK(reasons[0] == "too little to hold on to: 12 features, blurred or bare");
  CHECK(reasons[1] == "nothing in common with another photograph that it was matched with");
  CHECK(reasons[2] == "17 points in common with a.jpg, its best match of 1, do not tie it to the model");
  CHECK(reasons[3] == "COLMAP could not read it");
  CHECK(tg::forgetMatches(folder / "d.db"));
  CHECK(tg::whyLeftOut(folder / "d.db", {"d.jpg"})[0] == reasons[1]);
  tg::writeTextAtomically(folder / "none.db", "no database, but long enough to be looked into by a library");
  CHECK(tg::whyLeftOut(folder / "none.db", {"d.jpg"})[0].empty());
  CHECK_FALSE(tg::forgetMatches(folder / "none.db"));
}
