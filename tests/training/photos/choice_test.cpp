// SPDX-License-Identifier: Apache-2.0
// What is chosen: frames of a film, pairs of photographs, words for COLMAP; and what its database tells.
#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/file/file.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "training/photos/child.h"
#include "training/photos/film.h"
#include "training/photos/hdr.h"
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
  tg::FilmFacts facts;
  const auto words = [&](bool mapped) {
    return tg::extractFrames("/bin/ffmpeg", "/a/-y:b.mp4", std::vector<std::size_t>{3, 17}, 1600, "/x/50%/im", facts,
                             mapped);
  };
  const auto after = [&](const std::string& flag, bool mapped = true) {
    const Strings all = words(mapped);
    return *(std::ranges::find(all, flag) + 1);
  };
  CHECK(after("-i") == "file:/a/-y:b.mp4");
  CHECK(after("-vf").starts_with(
      "bwdif=mode=send_frame:deint=interlaced,select='(eq(n,3)+eq(n,17))',scale=out_color_matrix=bt601:"));
  CHECK(words(true).back() == "file:/x/50%%/im/%06d.jpg");
  CHECK(std::ranges::count(words(true), std::string("-nostdin")) == 1);
  for (const char* line :
       {"  Duration: 00:01:02.50, start: 0.0, bitrate: 4 kb/s",
        "  Stream #0:0: Video: mjpeg (Baseline), yuvj420p(pc, bt470bg/unknown/unknown), 90 fps, (attached pic)",
        "  Stream #0:1: Video: hevc, yuv420p10le(tv, bt2020nc/bt2020/arib-std-b67), 1920x1080, 29.97 fps, 30 tbr",
        "  Stream #0:2: Video: hevc, yuv420p10le(tv, unknown/unknown/smpte2084), 1920x1080, 10 fps, 30 tbr",
        "Duration: N/A, x"}) {
    facts.read(line);
  }
  CHECK(facts.frames() == 1873);
  CHECK_FALSE(facts.onlySound());
  CHECK(facts.transfer() == tg::Transfer::hlg);
  CHECK_THAT(after("-vf"), Contains(":tin=arib-std-b67,") && Contains("tonemap=mobius"));
  CHECK_THAT(after("-vf"), !Contains("pin="));
  CHECK_THAT(after("-vf", false), !Contains("tonemap"));
  facts = {};
  facts.read("Input #0, mov,mp4,m4a,3gp,3g2,mj2, from 'file:x':");
  CHECK(facts.onlySound());
  facts.read("  Stream #0:0: Video: hevc, yuv420p10le(tv, bt2020nc/unknown/smpte2084, progressive), 640x480, 10 fps");
  CHECK(facts.transfer() == tg::Transfer::pq);
  CHECK_THAT(after("-vf"), Contains(":pin=bt2020:min=bt2020nc:tin=smpte2084,"));

  CHECK(facts.pixelShape().empty());
  CHECK_THAT(after("-vf"), !Contains("sar"));
  const std::string stream = "  Stream #0:0: Video: h264, yuv420p, 1440x1080 [SAR 1:1 DAR 4:3], ";
  facts = {};
  facts.read(stream + "25 fps");
  CHECK(facts.pixelShape().empty());
  facts = {};
  facts.read(stream + "SAR 1217:1216 DAR 4:3, 25 fps");
  CHECK(facts.pixelShape().empty());
  facts = {};
  facts.read(stream + "SAR 4:3 DAR 16:9, 25 fps");
  CHECK(facts.pixelShape() == "4:3");
  CHECK_THAT(after("-vf"), Contains(",scale=w='round(iw*sar)':h=ih,scale="));

  tg::FilterList filters;
  filters.read(" .S. tonemap           V->V       Conversion to/from different dynamic ranges.");
  filters.read(" ... tonemap_opencl    V->V       Perform HDR to SDR conversion with tonemapping.");
  CHECK_FALSE(filters.mapsTones());
  filters.read(" .SC zscale            V->V       Apply resizing, colorspace and bit depth conversion.");
  CHECK(filters.mapsTones());
}

TEST_CASE("ffmpeg takes as many frames as it is told", "[photos]") {
  const auto ffmpeg = tg::findProgram("ffmpeg");
  TG_SKIP_IF(ffmpeg ? "" : "no ffmpeg on the PATH");
  const tg::TemporaryFolder folder;
  const std::atomic<int> stop{0};
  const std::filesystem::path film = folder / "film.mkv", log = folder / "log.txt", frames = folder / "frames";
  std::filesystem::create_directory(frames);
  const std::string source = "testsrc=size=64x48:rate=30:duration=10";
  REQUIRE(tg::runChild({{ffmpeg->string(), "-f", "lavfi", "-i", source, film.string()}, log, {}, {}}, stop).code == 0);
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < 300; i += i % 3 == 0 ? 2 : 1) chosen.push_back(i);
  const Strings words = tg::extractFrames(ffmpeg->string(), film, chosen, 32, frames, {}, false);
  const tg::ChildEnd end = tg::runChild({words, log, {}, {}}, stop);
  INFO(end.last);
  CHECK(end.code == 0);
  CHECK(std::distance(std::filesystem::directory_iterator(frames), {}) == 200);
  CHECK(chosen.size() == 200);
}

TEST_CASE("a picture in HDR keeps what is darker than half of paper white, and presses what is brighter", "[photos]") {
  // BT.2100: signals of grey light, and that light over paper white (203 cd/m2).
  struct Case {
    tg::Transfer transfer;
    float signal;
    double light;
  };
  for (const Case& known : {Case{tg::Transfer::pq, 0.5806889f, 1}, Case{tg::Transfer::pq, 0.4416979f, 0.25},
                            Case{tg::Transfer::hlg, 0.75f, 1}, Case{tg::Transfer::pq, 0.7518271f, 1000 / 203.0},
                            Case{tg::Transfer::hlg, 1, 1000 / 203.0}, Case{tg::Transfer::hlg, 0, 0}}) {
    CAPTURE(int(known.transfer), known.signal);
    tg::Image image(1, 1, 3);
    for (int c = 0; c < 3; ++c) image.at(0, 0, c) = known.signal;
    const tg::Image grey = tg::toneMapped(image, known.transfer, 9);
    const double light = std::pow(grey.at(0, 0, 1), 2.4);
    CHECK(grey.at(0, 0, 0) == Approx(grey.at(0, 0, 2)).margin(1e-4));
    if (known.light <= tg::kUnchanged) CHECK(light == Approx(known.light).margin(1e-3));
    if (known.light == 1) CHECK((light > 0.7 && light < 0.85));
    if (known.light > 4) CHECK(light == Approx(1).epsilon(2e-3));
  }
  // A red of BT.709 as BT.2020 has it is that red again.
  tg::Image red(1, 1, 3);
  const double light[3] = {0.627404 * 0.4, 0.069097 * 0.4, 0.016391 * 0.4};
  for (int c = 0; c < 3; ++c) {
    const double power = std::pow(light[c] * 203 / 10000, 1305 / 8192.0);
    red.at(0, 0, c) =
        static_cast<float>(std::pow((3424 / 4096.0 + 2413 / 128.0 * power) / (1 + 2392 / 128.0 * power), 2523 / 32.0));
  }
  const tg::Image narrow = tg::toneMapped(red, tg::Transfer::pq, 9);
  CHECK(std::pow(narrow.at(0, 0, 0), 2.4) == Approx(0.4).margin(1e-3));
  CHECK(std::pow(narrow.at(0, 0, 1), 2.4) == Approx(0).margin(1e-3));
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
  // A phone without a new fix: neighbours by name.
  const tg::Pairs same = tg::spatialPairs(std::vector<tg::Place>(250, {47, 8}));
  CHECK(std::ranges::count(same, std::pair<std::size_t, std::size_t>(200, 215)) == 1);
  CHECK(std::ranges::count(same, std::pair<std::size_t, std::size_t>(0, 200)) == 0);

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
  CHECK(has(tg::solveCameras(solver, {}, "out", tg::Mapper::global, 3, 0, 0), "global_mapper"));
  CHECK(has(tg::solveCameras(solver, {}, "out", tg::Mapper::incremental, 3, 5, 0), "--Mapper.init_num_trials"));
  CHECK_FALSE(has(tg::solveCameras(solver, {}, "out", tg::Mapper::incremental, 3, 0, 0), "--Mapper.init_num_trials"));
  CHECK(tg::lensParameters(tg::LensModel::simpleRadial, 700, 640, 480) == "700,320,240,0");

  CHECK(tg::photographsDone("Processed file [27/30]", false) == 27);
  CHECK(tg::photographsDone("Registering image #12 (13)", true) == 13);
  CHECK(tg::photographsDone("I2026 x.cc:1] Registering image #5 (num_reg_frames=21)", true) == 21);
  CHECK(tg::photographsDone("Registering image #12", true) == 0);
  CHECK(tg::photographsDone("Processed file [27/30]", true) == 0);
}

TEST_CASE("pycolmap gets every name as it is", "[photos]") {
  const auto python = tg::findProgram("python3");
  TG_SKIP_IF(python ? "" : "no python3 on the PATH");
  const tg::TemporaryFolder folder;
  // Writes down what it is asked for.
  tg::writeTextAtomically(folder / "pycolmap.py",
                          "class ImageReaderOptions: pass\n"
                          "class FeatureExtractionOptions: pass\n"
                          "class CameraMode: SINGLE = 0\n"
                          "def extract_features(database, images, image_names, **others):\n"
                          "    open(database, 'wb').write('|'.join(image_names).encode())\n");
  const Strings names = {"narrow\u202fspace.jpg", "no\u00a0break.jpg", "wide\u3000.jpg", "next\u0085line.jpg", "a.jpg"};
  std::string list, expected;
  for (const std::string& name : names) {
    list += name + "\n";
    expected += (expected.empty() ? "" : "|") + name;
  }
  tg::writeTextAtomically(folder / "list.txt", list);
  tg::Solver solver;
  solver.kind = tg::SolverKind::pycolmap;
  solver.program = python->string();
  Strings words = tg::findFeatures(solver, {folder / "asked", folder.path}, folder / "list.txt",
                                   tg::LensModel::simpleRadial, "", 1);
  words.insert(words.begin(), {"/usr/bin/env", "PYTHONPATH=" + folder.path.string()});
  const std::atomic<int> stop{0};
  const tg::ChildEnd end = tg::runChild({words, folder / "log.txt", {}, {}}, stop);
  INFO(end.last);
  REQUIRE(end.code == 0);
  const std::vector<std::uint8_t> asked = tg::readFile(folder / "asked", 1000);
  CHECK(std::string(asked.begin(), asked.end()) == expected);
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
      "INTEGER, config INTEGER);");
  run("INSERT INTO images VALUES (1, 'a.jpg'), (2, 'b.jpg'), (3, 'c.jpg'), (4, 'd.jpg'), (6, 'f.jpg');"
      "INSERT INTO keypoints VALUES (1, 900), (2, 12), (3, 800), (4, 700), (6, 700);");
  // Between photographs: matches, and what they show (3: depth, 4 to 6: one place, or something flat).
  const auto match = [&](std::int64_t first, std::int64_t second, int rows, int config) {
    run("INSERT INTO two_view_geometries VALUES (" + std::to_string(2147483647 * first + second) + ", " +
        std::to_string(rows) + ", " + std::to_string(config) + ");");
  };
  match(1, 4, 17, 3);
  match(4, 6, 9, 4);
  match(1, 6, 99, 6);
  sqlite3_close(database);
  const auto why = [&](const Strings& names, bool has_model = true) {
    return tg::whyLeftOut(folder / "d.db", names, {{"a.jpg", "frame 9"}}, has_model);
  };
  const Strings reasons = why({"b.jpg", "c.jpg", "d.jpg", "e.jpg", "f.jpg"});
  CHECK(reasons[0] == "too little to hold on to: 12 features, blurred or bare");
  CHECK(reasons[1] == "nothing in common with another photograph that it was matched with");
  CHECK(reasons[2] == "17 points in common with frame 9, its best match of 2, do not tie it to the model");
  CHECK(reasons[3] == "COLMAP could not read it");
  // Without a known focal length 6 is what ordinary pairs have, too.
  CHECK(reasons[4] == "99 points in common with frame 9, its best match of 2, do not tie it to the model");
  CHECK(why({"f.jpg"}, false)[0] ==
        "no match of 2 shows depth, as from one place or of something flat: step aside between photographs");
  CHECK(why({"d.jpg"}, false)[0] == "17 points in common with frame 9, its best match of 2, begin no model");
  REQUIRE(sqlite3_open((folder / "d.db").c_str(), &database) == SQLITE_OK);
  run("BEGIN EXCLUSIVE;");
  CHECK(tg::test::messageOf([&] { tg::forgetMatches(folder / "d.db"); }, tg::ErrorKind::cannotWrite) ==
        (folder / "d.db").string() + ": another program holds it");
  sqlite3_close(database);
  CHECK_NOTHROW(tg::forgetMatches(folder / "d.db"));
  CHECK(why({"d.jpg"})[0] == reasons[1]);
  tg::writeTextAtomically(folder / "none.db", "no database, but long enough to be looked into by a library");
  CHECK(tg::whyLeftOut(folder / "none.db", {"d.jpg"}, {}, true)[0].empty());
  CHECK(tg::test::messageOf([&] { tg::forgetMatches(folder / "none.db"); }, tg::ErrorKind::badData) ==
        (folder / "none.db").string() + ": no database of COLMAP (remove it to start anew)");
  CHECK(tg::test::messageOf([&] { tg::forgetMatches(folder / "gone.db"); }, tg::ErrorKind::cannotWrite) ==
        (folder / "gone.db").string() + ": unable to open database file");
}
