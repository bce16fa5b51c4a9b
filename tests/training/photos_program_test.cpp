// SPDX-License-Identifier: Apache-2.0
// `tgtrain photos` from photographs to a model, with programs in the place of colmap and ffmpeg that do what a test
// says; and with the real ones.
#include <fcntl.h>
#include <sqlite3.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <thread>
#include <tuple>
#include <vector>

#include "core/bundle/bundle.h"
#include "core/file/file.h"
#include "core/image/image.h"
#include "core/system/descriptor.h"
#include "program.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/child.h"
#include "training/data/dataset.h"

namespace fs = std::filesystem;
using tg::test::Outcome;
using tg::test::run;

namespace {

class Writer {
 public:
  template <typename T>
  Writer& add(T value) {
    const auto* const bytes = reinterpret_cast<const std::uint8_t*>(&value);
    bytes_.insert(bytes_.end(), bytes, bytes + sizeof value);
    return *this;
  }
  Writer& add(const std::string& text) {
    bytes_.insert(bytes_.end(), text.c_str(), text.c_str() + text.size() + 1);
    return *this;
  }
  void save(const fs::path& path) const { tg::writeFileAtomically(path, bytes_); }

 private:
  std::vector<std::uint8_t> bytes_;
};

glm::dvec4 quaternionOf(const glm::dmat3& m) {  // w, x, y, z; m[column][row]
  const double w = std::sqrt(std::max(0.0, 1 + m[0][0] + m[1][1] + m[2][2])) / 2;
  const auto part = [](double square, double sign) {
    return std::copysign(std::sqrt(std::max(0.0, square)) / 2, sign);
  };
  return {w, part(1 + m[0][0] - m[1][1] - m[2][2], m[1][2] - m[2][1]),
          part(1 - m[0][0] + m[1][1] - m[2][2], m[2][0] - m[0][2]),
          part(1 - m[0][0] - m[1][1] + m[2][2], m[0][1] - m[1][0])};
}

// The folder of a test: photographs of the built-in scene in photos/, what COLMAP would make of them in answer/, a
// colmap and an ffmpeg in bin/ that hand that out and add a word to calls.txt each time.
class Trial : public tg::TemporaryFolder {
 public:
  explicit Trial(int views = 6) {
    const std::string sample =
        "'" TG_TGTRAIN "' make-sample scene --size 32 --test-views 1 --points 50 --supersampling 1";
    REQUIRE(run(*this, sample + " --views " + std::to_string(views)).code == 0);
    for (const char* below : {"photos", "answer", "bin"}) fs::create_directory(path / below);
    tg::DatasetOptions options;
    options.only_test = false;
    const tg::Dataset dataset = tg::loadDataset(path / "scene", options);
    for (std::size_t i = 0; i < dataset.views.size(); ++i) {
      const std::string number = std::to_string(i);
      tg::Image image = tg::readImage(path / "scene/train" / ("r_" + number + ".png"));
      const float white[3] = {1, 1, 1};
      image = tg::compositeOver(image, white);
      tg::writeImage(path / "photos" / ("IMG " + number + ".jpg"), image);
      tg::writeImage(path / "answer" / formatted(i + 1), image);
      names_.push_back("IMG_" + number + ".jpg");
    }
    answer(dataset, names_);
    script("ffmpeg",
           "case \"$*\" in *rawvideo*) echo frames >>calls.txt; [ -f film.raw ] && cat film.raw;;"
           "*) for last; do :; done; echo take >>calls.txt; cp answer/*.jpg \"$(dirname \"${last#file:}\")\";; esac");
    script("colmap",
           "while [ $# -gt 0 ]; do case $1 in help) echo 'COLMAP 4.0 -- x'; echo matches_importer;;"
           "--database_path) database=$2;; --output_path) output=$2;; --Mapper.min_model_size) smallest=$2;; "
           "--image_list_path|--match_list_path) list=$2;;"
           "feature_extractor|matches_importer|mapper) task=$1;; -h) exit 0;; esac; shift; done;"
           "[ -n \"$task\" ] || exit 0; echo $task >>calls.txt; [ -n \"$list\" ] && cat \"$list\" >>lists.txt;"
           "[ -f \"hang_$task\" ] && { rm \"hang_$task\"; echo $$ >child.txt; exec sleep 600; };"
           "[ -f \"full_$task\" ] && echo 'SQLite error [database.cc, line 7]: database or disk is full';"
           "[ -f \"fail_$task\" ] && { echo 'what a pity'; exit 1; };"
           "case $task in feature_extractor|matches_importer) cp answer/database.db \"$database\"; echo 'Processed "
           "file [1/6]';;"
           "mapper) [ -d models_$smallest ] && models=models_$smallest; for model in ${models:-models}/*; do"
           " cp -r \"$model\" \"$output\" || exit 1; done;; esac; exit 0");
    ::unsetenv("DISPLAY");
    ::unsetenv("WAYLAND_DISPLAY");
  }

  // COLMAP's model of those photographs, and its database.
  void answer(const tg::Dataset& dataset, const std::vector<std::string>& names, const std::string& model = "0") {
    const fs::path folder = path / "models" / model;
    fs::create_directories(folder);
    const tg::Camera& first = dataset.views.front();
    Writer()
        .add(std::uint64_t{1})
        .add(std::uint32_t{1})
        .add(std::int32_t{1})
        .add(std::uint64_t{32})
        .add(std::uint64_t{32})
        .add(first.focal.x)
        .add(first.focal.y)
        .add(16.0)
        .add(16.0)
        .save(folder / "cameras.bin");
    Writer images;
    images.add(std::uint64_t{names.size()});
    for (std::size_t i = 0; i < names.size(); ++i) {
      const tg::Camera& camera = dataset.views[i];
      const glm::dvec4 rotation = quaternionOf(camera.rotation);
      images.add(std::uint32_t(i + 1));
      for (int c = 0; c < 4; ++c) images.add(double(rotation[c]));
      for (int c = 0; c < 3; ++c) images.add(double(camera.translation[c]));
      images.add(std::uint32_t{1}).add(names[i]).add(std::uint64_t{0});
    }
    images.save(folder / "images.bin");
    Writer points;
    points.add(std::uint64_t{dataset.points.position.size()});
    for (std::size_t i = 0; i < dataset.points.position.size(); ++i) {
      points.add(std::uint64_t(i));
      for (int c = 0; c < 3; ++c) points.add(double(dataset.points.position[i][c]));
      for (int c = 0; c < 3; ++c) points.add(std::uint8_t{128});
      points.add(0.5).add(std::uint64_t{0});
    }
    points.save(folder / "points3D.bin");
    fs::remove(path / "answer/database.db");
    sqlite3* database = nullptr;
    REQUIRE(sqlite3_open((path / "answer/database.db").c_str(), &database) == SQLITE_OK);
    REQUIRE(sqlite3_exec(
                database,
                "PRAGMA journal_mode = WAL; CREATE TABLE images (image_id INTEGER, name TEXT); CREATE TABLE keypoints "
                "(image_id INTEGER, rows INTEGER); CREATE TABLE matches (pair_id INTEGER, rows INTEGER); CREATE TABLE "
                "two_view_geometries (pair_id INTEGER, rows INTEGER, config INTEGER);"
                "INSERT INTO images VALUES (9, 'IMG_5.jpg'), (5, 'IMG_4.jpg'), (1, 'IMG_0.jpg');"
                "INSERT INTO keypoints VALUES (9, 7), (5, 500), (1, 500);"
                "INSERT INTO two_view_geometries VALUES (2147483647 * 1 + 5, 16, 3);",
                nullptr, nullptr, nullptr) == SQLITE_OK);
    sqlite3_close(database);
  }

  void script(const std::string& name, const std::string& text) const {
    const fs::path file = path / "bin" / name;
    std::ofstream(file) << "#!/bin/sh\ncd '" << path.string() << "'\n" << text << "\n";
    fs::permissions(file, fs::perms::owner_all);
  }

  Outcome photos(const std::string& arguments, const std::string& path_before = "$PWD/bin:$PATH") const {
    return run(*this, "PATH=\"" + path_before + "\" '" TG_TGTRAIN "' photos " + arguments);
  }
  // The words since the last call.
  std::string calls() const {
    std::string text = textOf("calls.txt");
    fs::remove(path / "calls.txt");
    return text;
  }
  std::string textOf(const std::string& name) const {
    std::ifstream stream(path / name);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  const std::vector<std::string>& names() const { return names_; }

 private:
  static std::string formatted(std::size_t number) {
    const std::string digits = std::to_string(number);
    return std::string(6 - digits.size(), '0') + digits + ".jpg";
  }
  std::vector<std::string> names_;
};

const std::string kShort = " --iterations 4 --texture-iterations 2 --gaussians 40";
const std::string kAll = "feature_extractor\nmatches_importer\nmapper\n";

// That the same command once more runs COLMAP from `task` on and ends well.
void checkGoesOn(const Trial& trial, const std::string& task) {
  const Outcome on = trial.photos("photos -o model.tgz" + kShort);
  INFO(on.output);
  CHECK(on.code == 0);
  CHECK(trial.calls() == kAll.substr(kAll.find(task)));
}

}  // namespace

TEST_CASE("photographs become a model by one command, which does nothing twice", "[photos]") {
  const Trial trial;
  std::ofstream(trial / "photos/notes.txt") << "not a photograph";
  std::ofstream(trial / "photos/broken.jpg") << "\xff\xd8\xff and no more";
  const Outcome made = trial.photos("photos -o model.tgz" + kShort);
  INFO(made.output);
  REQUIRE(made.code == 0);
  CHECK_THAT(made.output, Contains("ignored, no photographs: notes.txt"));
  CHECK_THAT(made.output, Contains("photos/broken.jpg: broken JPEG") && Contains("left out"));
  CHECK_THAT(made.output, Contains("6 photographs of 1 camera") && Contains("15 pairs (exhaustive)"));
  CHECK_THAT(made.output, Contains("cameras: 6 of 6 photographs, 49 points, mean reprojection error 0.50 px"));
  CHECK_THAT(made.output, Contains("wrote model.tgz") && Contains("tgview model.tgz shows it"));
  CHECK(trial.calls() == kAll);
  CHECK_THAT(trial.textOf("lists.txt"), Contains("IMG_0.jpg\nIMG_1.jpg\n") && Contains("IMG_4.jpg IMG_5.jpg\n"));
  CHECK(tg::readBundle(trial / "model.tgz").cameras.size() == 6);

  const Outcome again = trial.photos("photos -o model.tgz" + kShort);
  INFO(again.output);
  CHECK(again.code == 0);
  CHECK_THAT(again.output, Contains("matches: done before"));
  CHECK(trial.calls().empty());

  // An edit is not lost to a command that has nothing left to do.
  std::ofstream(trial / "model.tgz", std::ios::app) << "edited";
  const Outcome edited = trial.photos("photos -o model.tgz" + kShort);
  CHECK(edited.code == 4);
  CHECK_THAT(edited.output, Contains("model.tgz: has changed since this run wrote it (add --overwrite to replace it"));
  CHECK(trial.textOf("model.tgz").ends_with("edited"));
  CHECK(trial.photos("photos -o model.tgz --overwrite" + kShort).code == 0);

  // Another setting of training: a new run, which may not replace the model by itself.
  const Outcome other = trial.photos("photos -o model.tgz --iterations 5 --texture-iterations 2 --gaussians 40");
  CHECK(other.code == 4);
  CHECK_THAT(other.output, Contains("model.tgz: exists already (add --overwrite to replace it)"));
  CHECK(trial.photos("photos -o model.tgz --iterations 5 --texture-iterations 2 --gaussians 40 --overwrite").code == 0);
  CHECK(trial.calls().empty());

  // A folder that holds no run of this one is named before COLMAP's hours.
  fs::create_directory(trial / "other");
  std::ofstream(trial / "other/notes.txt") << "mine";
  const Outcome elsewhere = trial.photos("photos -o n.tgz --run other" + kShort);
  CHECK(elsewhere.code == 4);
  CHECK_THAT(elsewhere.output, Contains("other: exists already"));
  CHECK(trial.calls().empty());
  // Another way to match: from there on anew.
  CHECK(trial.photos("photos -o model.tgz --overwrite --matching sequential" + kShort).code == 0);
  CHECK(trial.calls() == "matches_importer\nmapper\n");
  // Another photograph: all anew.
  tg::copyFileAtomically(trial / "photos/IMG 0.jpg", trial / "photos/IMG 0 (1).jpg");
  const Outcome copied = trial.photos("photos -o model.tgz --overwrite --matching sequential" + kShort);
  INFO(copied.output);
  CHECK(copied.code == 0);
  CHECK(trial.calls() == kAll);
  // A copy is none, lest its twin is held out while it trains.
  CHECK_THAT(copied.output, Contains("photos: left out, copies: IMG 0 (1).jpg (of IMG 0.jpg)\n") &&
                                Contains("6 photographs of 1 camera"));
}

TEST_CASE("a command that was killed goes on where it was, and its child ends with it", "[photos]") {
  const Trial trial;
  const std::string task = GENERATE(std::string("feature_extractor"), "matches_importer", "mapper");
  CAPTURE(task);
  std::ofstream(trial / ("hang_" + task)) << "";
  REQUIRE(run(trial, "PATH=\"$PWD/bin:$PATH\" '" TG_TGTRAIN "' photos photos -o model.tgz" + kShort +
                         " >first.txt 2>&1 & echo $! >parent.txt")
              .code == 0);
  for (int wait = 0; wait < 3000 && trial.textOf("child.txt").empty(); ++wait) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const pid_t parent = std::stoi(trial.textOf("parent.txt")), child = std::stoi(trial.textOf("child.txt"));
  const int signal = GENERATE(SIGKILL, SIGTERM);
  REQUIRE(::kill(parent, signal) == 0);
  for (int wait = 0; wait < 3000 && ::kill(child, 0) == 0; ++wait)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  CHECK(::kill(child, 0) != 0);
  for (int wait = 0; wait < 3000 && ::kill(parent, 0) == 0; ++wait)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  if (signal == SIGTERM) CHECK_THAT(trial.textOf("first.txt"), Contains("stopped; the same command goes on"));
  CHECK_FALSE(fs::exists(trial / "model.tgz"));
  trial.calls();

  checkGoesOn(trial, task);
}

TEST_CASE("a signal between the last of COLMAP and training ends the command", "[photos]") {
  const Trial trial;
  REQUIRE(trial.photos("photos -o model.tgz" + kShort).code == 0);
  const std::string command =
      "PATH=\"$PWD/bin:$PATH\" '" TG_TGTRAIN "' photos photos -o model.tgz --overwrite --texture-iterations 2";
  // What is said until all stages are found done; then it waits for a pipe that takes no more.
  const std::string all = run(trial, command + " --iterations 5 2>/dev/null").output;
  const std::size_t before = all.find("cameras: 6 of 6");
  REQUIRE(before != all.npos);
  const fs::path name = trial / "pipe";
  REQUIRE(::mkfifo(name.c_str(), 0600) == 0);
  const tg::Descriptor pipe(::open(name.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  const int capacity = ::fcntl(pipe.get(), F_SETPIPE_SZ, 1);
  REQUIRE(capacity > int(before) + 8);
  const std::string filling(capacity - before - 8, '.');
  REQUIRE(::write(pipe.get(), filling.data(), filling.size()) == ssize_t(filling.size()));
  REQUIRE(run(trial, command + " --iterations 6 >pipe 2>errors.txt & echo $! >parent.txt").code == 0);
  const pid_t parent = std::stoi(trial.textOf("parent.txt"));
  int waiting = 0;
  for (int wait = 0; wait < 3000 && waiting < capacity - 8; ++wait) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    REQUIRE(::ioctl(pipe.get(), FIONREAD, &waiting) == 0);
  }
  CHECK(waiting == capacity - 8);
  CHECK(::kill(parent, SIGTERM) == 0);
  std::string said;
  for (int wait = 0; wait < 3000 && ::kill(parent, 0) == 0; ++wait) {
    std::vector<char> piece(4096);
    const ssize_t count = ::read(pipe.get(), piece.data(), piece.size());
    if (count > 0) said.append(piece.data(), count);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  CHECK(::kill(parent, 0) != 0);
  CHECK_THAT(said, Contains("cameras: done before\n") && !Contains("training on"));
  CHECK_THAT(trial.textOf("errors.txt"), Contains("tgtrain: stopped; the same command goes on\n"));
}

TEST_CASE("a training of photographs that is stopped says that the same command goes on", "[photos]") {
  const Trial trial;
  REQUIRE(trial.photos("photos -o model.tgz" + kShort).code == 0);
  tg::test::Child child(trial, "photos photos -o model.tgz --overwrite --iterations 1000000 --densification none");
  child.until([&] { return child.output().find("plain ") != std::string::npos; });
  child.send(SIGINT);
  CHECK(child.end() == 128 + SIGINT);
  CHECK_THAT(child.output(), Contains("the same command goes on from model.photos/run/checkpoint"));
}

TEST_CASE("the largest model is taken, and who is in none hears why", "[photos]") {
  Trial trial;
  const tg::Dataset dataset = tg::loadDataset(trial / "scene", {});
  const std::vector<std::string>& names = trial.names();
  trial.answer(dataset, {names[2], names[3], names[4]});
  trial.answer(dataset, {names.begin(), names.begin() + 4}, "1");
  for (const std::string stage : {"found in", "done before"}) {
    const Outcome made = trial.photos("photos -o model.tgz" + kShort);
    INFO(made.output);
    CHECK(made.code == 0);
    CHECK_THAT(made.output, Contains("cameras: " + stage));
    CHECK_THAT(made.output, Contains("fall into 2 models") && Contains("the largest, of 4, is taken (others have 3)"));
    CHECK_THAT(made.output, Contains("left out: IMG 5.jpg: too little to hold on to: 7 features"));
    CHECK_THAT(made.output, Contains("left out: IMG 4.jpg: hangs together with 2 others in another model\n"));
  }
  for (const std::string file : {"-wal", "-shm"}) CHECK_FALSE(fs::exists(trial / ("model.photos/database.db" + file)));
  const Outcome few = trial.photos("photos -o model.tgz --least-registered 70" + kShort);
  CHECK(few.code == 3);
  CHECK_THAT(few.output, Contains("too few photographs have a camera (expected at least 70 % of 6, found 4)") &&
                             !Contains("--matching exhaustive"));
  const Outcome neighbours = trial.photos("photos -o m.tgz --matching sequential --least-registered 70" + kShort);
  CHECK_THAT(neighbours.output, Contains("something with a pattern in view; --matching exhaustive. --least"));

  // As an older version left it.
  nlohmann::json list = nlohmann::json::parse(trial.textOf("model.photos/photos.json"));
  list["stages"]["cameras"]["result"] = nullptr;
  std::ofstream(trial / "model.photos/photos.json") << list;
  const Outcome older = trial.photos("photos -o model.tgz" + kShort);
  INFO(older.output);
  CHECK(older.code == 0);
  CHECK_THAT(older.output, Contains("cameras: done before") && !Contains("fall into") &&
                               Contains("left out: IMG 4.jpg: 16 points in common with IMG 0.jpg, its best match of "
                                        "1, do not tie it to the model\n"));
}

TEST_CASE("a splinter of few photographs is taken only where COLMAP finds no model of most", "[photos]") {
  Trial trial;
  const tg::Dataset dataset = tg::loadDataset(trial / "scene", {});
  trial.answer(dataset, {trial.names()[0], trial.names()[1], trial.names()[2]});
  fs::rename(trial / "models", trial / "models_3");
  const bool whole = GENERATE(true, false);
  if (whole) {
    trial.answer(dataset, {trial.names().begin(), trial.names().begin() + 5});
    fs::rename(trial / "models", trial / "models_4");
  } else {
    fs::create_directory(trial / "models_4");
  }
  const Outcome made = trial.photos("photos -o model.tgz" + kShort);
  INFO(made.output);
  CHECK(made.code == 0);
  CHECK_THAT(made.output, Contains(whole ? "cameras: 5 of 6 photographs" : "cameras: 3 of 6 photographs"));
  const bool told = made.output.find("no 4 of the 6 photographs hang together: 3 are enough\n") != std::string::npos;
  CHECK(told != whole);
  CHECK(trial.calls() == (whole ? kAll : kAll + "mapper\n"));
}

TEST_CASE("what COLMAP cannot do is an error with its last words", "[photos]") {
  const Trial trial;
  std::ofstream(trial / "fail_feature_extractor") << "";
  const Outcome features = trial.photos("photos -o model.tgz" + kShort);
  CHECK(features.code == 3);
  CHECK_THAT(features.output, Contains("model.photos/logs/features.txt: colmap failed (exit code 1): what a pity"));
  fs::remove(trial / "fail_feature_extractor");
  std::ofstream(trial / "fail_mapper") << "";
  const Outcome mapper = trial.photos("photos -o model.tgz" + kShort);
  CHECK(mapper.code == 3);
  CHECK_THAT(mapper.output, Contains("tgtrain: photos: no cameras found (expected some photographs that hang together, "
                                     "found none). What helps: ") &&
                                Contains("what a pity"));
  CHECK_THAT(mapper.output, Contains("left out: IMG 5.jpg: too little to hold on to: 7 features"));
  CHECK_FALSE(fs::exists(trial / "model.photos/sparse.part"));
  CHECK_THAT(mapper.output, Contains("photographs: done before"));
  CHECK_FALSE(fs::exists(trial / "model.tgz"));
}

TEST_CASE("a stage whose database took not all is not done", "[photos]") {
  const Trial trial;
  const std::string task = GENERATE(std::string("feature_extractor"), "matches_importer", "mapper");
  CAPTURE(task);
  std::ofstream(trial / ("full_" + task)) << "";
  const Outcome full = trial.photos("photos -o model.tgz" + kShort);
  CHECK(full.code == 4);
  CHECK_THAT(full.output, Contains("tgtrain: model.photos/database.db: SQLite error [database.cc, line 7]: database or "
                                   "disk is full\n"));
  trial.calls();
  fs::remove(trial / ("full_" + task));
  checkGoesOn(trial, task);
}

TEST_CASE("no command goes on with matches that an earlier one could not remove", "[photos]") {
  const Trial trial;
  REQUIRE(trial.photos("photos -o model.tgz" + kShort).code == 0);
  trial.calls();
  std::ofstream(trial / "model.photos/database.db") << "no database, but long enough to be looked into by a library";
  for (const char* time : {"first", "again"}) {
    CAPTURE(time);
    const Outcome outcome = trial.photos("photos -o model.tgz --overwrite --matching sequential" + kShort);
    INFO(outcome.output);
    CHECK(outcome.code == 3);
    CHECK_THAT(outcome.output, Contains("no database of COLMAP (remove it to start anew)"));
  }
  CHECK(trial.calls().empty());
}

TEST_CASE("a model that COLMAP did not write to its end is no model", "[photos]") {
  const Trial trial;
  const fs::path file = trial / "models/0" / GENERATE(std::string("cameras.bin"), "images.bin", "points3D.bin");
  CAPTURE(file);
  const std::vector<std::uint8_t> whole = tg::readFile(file, 1 << 20);
  tg::writeFileAtomically(file, std::span(whole).first(whole.size() / 2));
  const Outcome full = trial.photos("photos -o model.tgz" + kShort);
  CHECK(full.code == 4);
  CHECK_THAT(full.output, Contains("model.photos/sparse.part/0/" + file.filename().string() + ": ") &&
                              Contains(": not written to its end, as on a full disk\n"));
  // Of a COLMAP that failed what it said is told.
  fs::rename(trial / "bin/colmap", trial / "bin/whole");
  trial.script("colmap", "bin/whole \"$@\"; [ \"$1\" != mapper ] || { echo 'what a pity'; exit 1; }");
  const Outcome failed = trial.photos("photos -o model.tgz" + kShort);
  CHECK(failed.code == 3);
  CHECK_THAT(failed.output, Contains("tgtrain: model.photos/logs/cameras.txt: colmap failed (exit code 1): ") &&
                                Contains("what a pity\n") && !Contains("full disk"));
  fs::rename(trial / "bin/whole", trial / "bin/colmap");
  tg::writeFileAtomically(file, whole);
  const Outcome on = trial.photos("photos -o model.tgz" + kShort);
  INFO(on.output);
  CHECK(on.code == 0);
  CHECK_THAT(on.output, Contains("matches: done before"));
}

TEST_CASE("cameras of before do not stand beside photographs of now", "[photos]") {
  const Trial trial;
  REQUIRE(trial.photos("photos -o model.tgz" + kShort).code == 0);
  CHECK(tg::hasCameras(trial / "model.photos"));
  tg::writeImage(trial / "photos/IMG 0.jpg", tg::readImage(trial / "photos/IMG 1.jpg"));
  std::ofstream(trial / "fail_feature_extractor") << "";
  CHECK(trial.photos("photos -o model.tgz --overwrite" + kShort).code == 3);
  CHECK_FALSE(tg::hasCameras(trial / "model.photos"));
}

TEST_CASE("a command that cannot begin leaves the cameras that are there", "[photos]") {
  const Trial trial;
  REQUIRE(trial.photos("photos -o model.tgz" + kShort).code == 0);
  trial.calls();
  trial.script("python3", "exit 1");
  std::ofstream(trial / "film.mp4") << "no film";
  fs::create_directory(trial / "without ffmpeg");
  fs::copy(trial / "bin/colmap", trial / "without ffmpeg/colmap");
  const auto refused = [&](const std::string& arguments, int code, const std::string& path = "$PWD/bin:$PATH") {
    const Outcome outcome = trial.photos(arguments + " -o model.tgz --overwrite" + kShort, path);
    INFO(outcome.output);
    CHECK(outcome.code == code);
    CHECK(tg::hasCameras(trial / "model.photos"));
  };
  refused("photos --cameras-by pycolmap", 5);
  refused("photos --matching spatial", 1);
  refused("photos --matching spatial --lens OPENCV", 1);
  const Outcome again = trial.photos("photos -o model.tgz" + kShort);
  INFO(again.output);
  CHECK(again.code == 0);
  CHECK(trial.calls().empty());
  refused("film.mp4 --work model.photos", 3);
  refused("film.mp4 --work model.photos", 5, "$PWD/without ffmpeg:/nowhere");
}

TEST_CASE("a model that may not be replaced is named before cameras are looked for again", "[photos]") {
  const Trial trial;
  REQUIRE(trial.photos("photos -o model.tgz" + kShort).code == 0);
  CHECK(trial.calls() == kAll);
  fs::create_directory(trial / "others");
  for (const char* name : {"IMG 1.jpg", "IMG 2.jpg", "IMG 3.jpg"}) {
    fs::copy(trial / "photos" / name, trial / "others" / name);
  }
  const auto bytes = [&](const std::string& name) { return trial.textOf("model.photos/" + name); };
  const std::vector<std::string> kept = {"photos.json", "database.db", "sparse/0/images.bin", "images/IMG_0.jpg",
                                         "run/checkpoint"};
  std::vector<std::string> before;
  for (const std::string& name : kept) before.push_back(bytes(name));
  for (const auto& [arguments, stage] :
       std::initializer_list<std::pair<std::string, std::string>>{{"others", "photographs"},
                                                                  {"photos --lens OPENCV", "features"},
                                                                  {"photos --matching sequential", "matches"},
                                                                  {"photos --sh-degree 1", "training"}}) {
    const Outcome refused = trial.photos(arguments + " -o model.tgz" + kShort);
    INFO(refused.output);
    CHECK(refused.code == 4);
    CHECK_THAT(refused.output, Contains("model.tgz: exists already (add --overwrite to replace it); for this input and "
                                        "these flags model.photos is made anew from its " +
                                        stage + " on\n"));
    CHECK(std::ranges::count(refused.output, '\n') == 1);
    CHECK(trial.calls().empty());
    for (std::size_t i = 0; i < kept.size(); ++i) CHECK(bytes(kept[i]) == before[i]);
  }
  CHECK(trial.photos("others -o model.tgz --overwrite --matching exhaustive" + kShort).code != 4);
  CHECK(trial.calls() == kAll);
}

TEST_CASE("a film gives its sharpest frames", "[photos]") {
  Trial trial;
  constexpr std::size_t kSide = 720;
  std::vector<std::uint8_t> film(12 * kSide * kSide, 0);
  for (std::size_t frame = 0; frame < 12; frame += 2) {  // the odd ones are blurred
    for (std::size_t i = 0; i < kSide * kSide; i += 3) film[frame * kSide * kSide + i] = 255;
  }
  tg::writeFileAtomically(trial / "film.raw", film);
  std::ofstream(trial / "a film.mp4") << "any bytes";
  std::vector<std::string> names;
  for (const char* number : {"1", "3", "5", "7", "9"}) names.push_back(std::string("frame_00000") + number + ".jpg");
  names.push_back("frame_000011.jpg");
  trial.answer(tg::loadDataset(trial / "scene", {}), names);
  const Outcome made = trial.photos("'a film.mp4' -o model.tgz --frames 6" + kShort);
  INFO(made.output);
  CHECK(made.code == 0);
  CHECK_THAT(made.output, Contains("the sharpest 6 of 12 frames are kept, 32 x 32"));
  CHECK_THAT(made.output, Contains("pairs (sequential)"));
  CHECK(trial.calls() == "frames\ntake\n" + kAll);
  CHECK(fs::exists(trial / "model.photos/images/frame_000011.jpg"));
}

TEST_CASE("inputs that are none, and programs that are not there, are told in a line", "[photos]") {
  const Trial trial;
  fs::create_directory(trial / "empty");
  std::ofstream(trial / "broken.mp4") << "no film";
  const auto says = [&](const Outcome& outcome, int code, const std::string& text) {
    INFO(outcome.output);
    CHECK(outcome.code == code);
    CHECK_THAT(outcome.output, Contains(text));
    CHECK(std::ranges::count(outcome.output, '\n') <= 2);
  };
  says(trial.photos("absent -o x.tgz"), 2, "absent: cannot open");
  says(trial.photos("empty -o x.tgz"), 3, "empty: too few photographs");
  says(trial.photos("'photos/IMG 0.jpg' -o x.tgz"), 3, "too few photographs");
  REQUIRE(run(trial, "tar cf photos.tar photos && tar czf photos.tgz photos").code == 0);
  std::ofstream(trial / "photos.zip") << "PK\3\4 and so on";
  for (const std::string archive : {"photos.tar", "photos.tgz", "photos.zip"}) {
    says(trial.photos(archive + " -o x.tgz"), 3, archive + ": is an archive (expected a folder of photographs");
  }
  says(trial.photos("scene -o x.tgz"), 1, "scene: is a data set with cameras already: `tgtrain scene -o model.tgz`");
  CHECK_FALSE(fs::exists(trial / "x.photos"));
  std::ofstream(trial / "empty/notes.jpg") << "a text";
  says(trial.photos("empty -o x.tgz"), 3, "found 0); no photographs by their bytes: notes.jpg");
  fs::create_directories(trial / "masked/masks");
  fs::copy(trial / "photos/IMG 0.jpg", trial / "masked/masks/a.jpg");
  says(trial.photos("masked -o x.tgz"), 3, "found 0); what lies in a folder `masks` counts as masks");
  std::ofstream(trial / "empty/IMG_1.DNG") << "II*";
  std::ofstream(trial / "empty/IMG_2.MOV") << "a film";
  says(trial.photos("empty -o x.tgz"), 3, "it holds pictures in formats that are not read: IMG_1.DNG (export");
  says(trial.photos("empty -o x.tgz"), 3,
       "it holds IMG_2.MOV (a film has a command of its own: `tgtrain photos empty/");
  says(trial.photos("broken.mp4 -o x.tgz"), 3, "broken.mp4: is no film that ffmpeg can read");
  CHECK_FALSE(fs::exists(trial / "x.photos"));
  says(trial.photos("photos"), 1, "expected a folder of photographs or a film, and -o model.tgz");
  says(trial.photos("photos -o x.tgz --work photos"), 4, "photos: holds other files");
  says(trial.photos("photos -o y.tgz", "/nowhere"), 5,
       "no COLMAP found (expected colmap on the PATH, as `apt install colmap`");
  CHECK_FALSE(fs::exists(trial / "y.photos"));
  says(trial.photos("photos -o y.tgz --mapper global"), 5, "has no global mapper");
  fs::create_directory(trial / "only");
  fs::copy(trial / "bin/colmap", trial / "only/colmap");
  says(trial.photos("broken.mp4 -o z.tgz", "$PWD/only:/nowhere"), 5, "no ffmpeg found");
  says(trial.photos("'photos/IMG 0.jpg' 'photos/IMG 1.jpg' -o x.tgz"), 1,
       "tgtrain photos: unexpected argument: photos/IMG 1.jpg: expected one folder or film (see --help)");
  const Outcome pointed = run(trial, "'" TG_TGTRAIN "' photos -o x.tgz");
  CHECK(pointed.code == 1);
  says(run(trial, "'" TG_TGTRAIN "' ./photos -o x.tgz"), 3,
       "./photos: not a data set, but photographs without cameras: `tgtrain photos ./photos -o model.tgz`");
  says(run(trial, "'" TG_TGTRAIN "' broken.mp4 -o x.tgz"), 3, "broken.mp4: is a film: `tgtrain photos broken.mp4");
  says(run(trial, "'" TG_TGTRAIN "' -q photos photos -o x.tgz"), 1, "expected before every flag");
}

TEST_CASE("the help of photos has every flag of training but those that it refuses", "[photos]") {
  const tg::TemporaryFolder folder;
  const auto flags_of = [&](const std::string& command) {
    std::istringstream help(run(folder, "'" TG_TGTRAIN "' " + command).output);
    std::set<std::string> flags;
    for (std::string line; std::getline(help, line);) {
      const std::size_t at = line.find("--");
      if (at <= 6 && line.starts_with("  ")) flags.insert(line.substr(at, line.find_first_of(" ,=[", at) - at));
    }
    return flags;
  };
  std::set<std::string> missing = flags_of("--help");
  CHECK(missing.size() > 80);
  for (const std::string& flag : flags_of("photos --help")) missing.erase(flag);
  for (const char* flag : {"--completion", "--man"}) missing.erase(flag);  // of the program
  CHECK(missing == std::set<std::string>{"--image-folder", "--layout"});
  for (const std::string& flag : missing) {
    const Outcome refused = run(folder, "'" TG_TGTRAIN "' photos absent -o x.tgz " + flag + " auto");
    CHECK(refused.output == "tgtrain: " + flag + " is of a data set, and photos makes its own\n");
  }
}

TEST_CASE("what training would refuse is refused before cameras are looked for", "[photos]") {
  const Trial trial;
  for (const auto& [flags, code, text] : std::initializer_list<std::tuple<std::string, int, std::string>>{
           {"-o x.tgz --steps 4", 1, "x.tgz: --target-size and --steps are only for .sog and .glb"},
           {"-o x.tgz --quantize-iterations 5", 1, "is for a file of coarser numbers"},
           {"-o x.sog --target-size 1KB", 1, "--target-size is out of reach"},
           {"-o x.tgz --serve nonsense", 1, "--serve: expected [ADDRESS:]PORT"},
           {"-o x.tgz --serve-token 0123456789", 1, "(expected --serve with it)"},
           {"-o x.tgz --background 7", 1, "--background: not a colour"},
           {"-o x.tgz --start-model none.ply", 2, "none.ply"},
           {"-o x.tgz --test-every 1", 1, "--test-every: out of range (expected 0, for none, or at least 2, found 1)"},
           {"-o x.tgz --downscale 65", 1, "--downscale: out of range (expected 1 to 64, found 65)"},
           {"-o x.tgz --points none.ply", 2, "none.ply: no such file"},
           {"-o x.tgz --context none.tgz", 2, "none.tgz: no such file"},
           {"-o x.tgz --layout colmap", 1, "--layout is of a data set, and photos makes its own"},
           {"-o x.tgz --image-folder images_2", 1, "--image-folder is of a data set"},
           {"-o x.tgz --device cuda", 5, "CUDA"}}) {
    const Outcome refused =
        run(trial, "CUDA_VISIBLE_DEVICES= PATH=\"$PWD/bin:$PATH\" '" TG_TGTRAIN "' photos photos " + flags + kShort);
    INFO(flags << '\n' << refused.output);
    CHECK(refused.code == code);
    CHECK_THAT(refused.output, Contains(text));
    CHECK(trial.calls().empty());
  }
  CHECK_FALSE(fs::exists(trial / "x.photos"));
}

TEST_CASE("other steps of the file are another training", "[photos]") {
  const Trial trial;
  const std::string train = "photos -o x.sog" + kShort + " --steps ";
  REQUIRE(trial.photos(train + "2").code == 0);
  CHECK(trial.photos(train + "2").code == 0);
  const Outcome other = trial.photos(train + "4");
  CHECK(other.code == 4);
  CHECK_THAT(other.output, Contains("x.sog: exists already"));
}

TEST_CASE("a run folder that is named goes on, and begins anew with --overwrite where a flag changed", "[photos]") {
  const Trial trial;
  const std::string train = "photos -o x.tgz --run kept --texture-iterations 2 --gaussians 40 --iterations ";
  REQUIRE(trial.photos(train + "5").code == 0);
  CHECK(trial.photos(train + "5").code == 0);
  CHECK(trial.photos(train + "6").code == 4);
  const Outcome anew = trial.photos(train + "6 --overwrite");
  INFO(anew.output);
  CHECK(anew.code == 0);
}

TEST_CASE("a start model of the same name and other content is another training", "[photos]") {
  const Trial trial;
  REQUIRE(trial.photos("photos -o start.tgz --iterations 4 --texture-iterations 2 --gaussians 40").code == 0);
  const std::string train = "photos -o x.tgz --start-model start.tgz" + kShort;
  REQUIRE(trial.photos(train).code == 0);
  REQUIRE(trial.photos("photos -o start.tgz --iterations 5 --texture-iterations 2 --gaussians 40 --overwrite").code ==
          0);
  const Outcome other = trial.photos(train + " --overwrite");
  INFO(other.output);
  CHECK(other.code == 0);
}

TEST_CASE("a film of the real ffmpeg becomes frames, the right way up", "[photos]") {
  const Trial trial(12);
  TG_SKIP_IF(run(trial, "command -v ffmpeg").code == 0 ? "" : "no ffmpeg");
  fs::remove(trial / "bin/ffmpeg");
  REQUIRE(run(trial,
              "ffmpeg -v error -framerate 5 -pattern_type glob -i 'photos/*.jpg' -vf scale=96:64,setsar=1 -q:v 2 'my "
              "film.avi'")
              .code == 0);
  std::ofstream(trial / "fail_mapper") << "";
  const Outcome made = trial.photos("'my film.avi' -o model.tgz --frames 4 --longest-side 48");
  INFO(made.output);
  CHECK(made.code == 3);  // the answer is of other photographs
  CHECK_THAT(made.output, Contains("the sharpest 4 of 12 frames are kept, 48 x 32"));
  std::size_t frames = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(trial / "model.photos/images")) {
    const tg::Image image = tg::readImage(entry.path());
    CHECK((image.width == 48 && image.height == 32));
    ++frames;
  }
  CHECK(frames == 4);
}

TEST_CASE("frames of an interlaced film with wide pixels are whole and have square ones", "[photos]") {
  const Trial trial(3);
  TG_SKIP_IF(run(trial, "command -v ffmpeg").code == 0 ? "" : "no ffmpeg");
  fs::remove(trial / "bin/ffmpeg");
  // An upright edge that moves by three pixels from field to field.
  REQUIRE(run(trial,
              "ffmpeg -v error -f lavfi -i \"color=black:size=48x64:rate=20:duration=0.6,format=yuv420p,"
              "geq=lum='255*gt(X,3*N+3)':cb=128:cr=128,tinterlace=interleave_top,setdar=4/3,setfield=tff\" "
              "-c:v mpeg2video -flags +ildct+ilme -q:v 1 fields.avi")
              .code == 0);
  std::ofstream(trial / "fail_mapper") << "";
  const Outcome made = trial.photos("fields.avi -o model.tgz --frames 4");
  INFO(made.output);
  CHECK_THAT(made.output, Contains("the film's pixels are no squares (16:9)"));
  CHECK_THAT(made.output, Contains("4 of 6 frames are kept, 85 x 64"));
  int frames = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(trial / "model.photos/images")) {
    const tg::Image image = tg::readImage(entry.path());
    REQUIRE((image.width == 85 && image.height == 64));
    float most = 0;
    for (int x = 0; x < 85; ++x) most = std::max(most, std::abs(image.at(x, 31, 1) - image.at(x, 32, 1)));
    CHECK(most < 0.2f);
    ++frames;
  }
  CHECK(frames == 4);
}

TEST_CASE("frames of a film in HDR look like those of the film that is not", "[photos]") {
  const Trial trial(3);
  TG_SKIP_IF(run(trial,
                 "ffmpeg -v error -hide_banner -encoders | grep -q libx265 && ffmpeg -v error -filters | grep -q "
                 "' zscale '")
                         .code == 0
                 ? ""
                 : "no ffmpeg with libx265 and zscale");
  fs::remove(trial / "bin/ffmpeg");
  const std::string transfer = GENERATE(std::string("arib-std-b67"), "smpte2084");
  CAPTURE(transfer);
  // 33 x 47: an odd side for the maps.
  const std::string to_hdr =
      "scale=66:94,setsar=1,format=gbrpf32le,zscale=tin=bt709:pin=bt709:min=gbr:rin=full:t=linear:p=bt709:m=gbr:r=full:"
      "npl=203,"
      "zscale=p=bt2020:t=" +
      transfer + ":m=bt2020nc:r=tv:npl=203,format=yuv420p10le";
  REQUIRE(run(trial, "ffmpeg -v error -framerate 5 -f image2 -i 'photos/IMG %d.jpg' -vf '" + to_hdr +
                         "' -c:v libx265 -x265-params log-level=error:crf=4 -color_primaries bt2020 -color_trc " +
                         transfer + " -colorspace bt2020nc -color_range tv hdr.mp4")
              .code == 0);
  const auto frames = [&](const std::string& more) {
    const Outcome made = trial.photos("hdr.mp4 -o model.tgz --longest-side 47" + more);
    INFO(made.output);
    REQUIRE(fs::is_directory(trial / "model.photos/images"));
    std::vector<tg::Image> images;
    for (const char* number : {"1", "2", "3"}) {
      images.push_back(tg::readImage(trial / ("model.photos/images/frame_00000" + std::string(number) + ".jpg")));
    }
    return std::pair(images, made.output);
  };
  const auto [mapped, output] = frames("");
  CHECK_THAT(output, Contains("the film is in HDR") && Contains("33 x 47"));
  const auto distance = [&](const std::vector<tg::Image>& images) {
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
      const tg::Image truth = tg::readImage(trial / ("photos/IMG " + std::to_string(i) + ".jpg"));
      for (int c = 0; c < 3; ++c) {
        double difference = 0;
        for (int y = 0; y < 47; ++y)
          for (int x = 0; x < 33; ++x) difference += images[i].at(x, y, c) / (33 * 47.0);
        for (std::size_t p = 0; p < std::size_t{32} * 32; ++p) difference -= truth.data[3 * p + c] / 1024.0;
        sum += std::abs(difference) / 9;
      }
    }
    return sum;
  };
  const double close = distance(mapped);
  // An ffmpeg without zscale.
  trial.script("ffmpeg", "case \"$*\" in *-filters*) exit 0;; esac; PATH=/usr/bin:/usr/local/bin exec ffmpeg \"$@\"");
  const auto [pale, warned] = frames(" --frames 119");
  CHECK_THAT(warned, Contains("frames come out pale (expected an ffmpeg with the filters zscale and tonemap"));
  CHECK(close < 0.5 * distance(pale));
}
