// SPDX-License-Identifier: Apache-2.0
// The stages in a row.
#include "training/photos/photos.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "training/photos/child.h"
#include "training/photos/outcome.h"
#include "training/photos/prepare.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPairsAtOnce = 200;  // between two lines of progress
constexpr std::size_t kMostNamed = 10;     // photographs that are left out, in words
constexpr std::size_t kFewestCameras = 3;
constexpr std::size_t kSmallestModel = 10;  // COLMAP's own choice, where there are enough photographs
constexpr int kFirstTrials = 5;  // a round, of which COLMAP does five where it finds none: its own 200 take minutes
constexpr double kUsualFocal = 1.2;         // of the longer side: COLMAP's guess

// "12.3 s", "3 min 05 s"
std::string duration(double seconds) {
  return seconds < 100 ? formatted("%.1f s", seconds)
                       : formatted("%d min %02d s", int(seconds) / 60, int(seconds) % 60);
}

class Job {
 public:
  Job(const PhotosOptions& options, Ledger& ledger, const PhotosListener& listener, const std::atomic<int>& stop)
      : options_(options), ledger_(ledger), listener_(listener), stop_(stop), work_(ledger.folder()) {
    std::error_code ignored;
    film_ = !fs::is_directory(options.input, ignored);
  }

  void run() {
    const std::string made_of = madeOf(options_);
    std::error_code ignored;
    fs::create_directories(work_ / "logs", ignored);
    stage(PhotoStage::photographs, made_of, [&](bool) { return prepare(); });
    takePrepared();
    listener_.say(std::to_string(photographs_.size()) + (film_ ? " frames" : " photographs") + " of " +
                  std::to_string(cameras().size()) + (cameras().size() == 1 ? " camera" : " cameras"));
    if (matching_ == Matching::spatial) checkPlaces();
    // Databases go from one COLMAP to another in one direction at most.
    if (ledger_.isDone(PhotoStage::features, keyOf(PhotoStage::features)) &&
        !ledger_.isDone(PhotoStage::cameras, keyOf(PhotoStage::cameras)) &&
        ledger_.result(PhotoStage::features) != solverName()) {
      ledger_.begin(PhotoStage::features, "");
    }
    stage(PhotoStage::features, keyOf(PhotoStage::features), [&](bool) { return features(); });
    stage(PhotoStage::matches, keyOf(PhotoStage::matches), [&](bool) { return matches(); });
    stage(PhotoStage::cameras, keyOf(PhotoStage::cameras), [&](bool) { return solve(); });
    judge();
  }

  // The first stage that run() would do.
  std::optional<PhotoStage> undone() {
    if (!isDone(PhotoStage::photographs, madeOf(options_))) return PhotoStage::photographs;
    takePrepared();
    for (const PhotoStage stage : {PhotoStage::features, PhotoStage::matches, PhotoStage::cameras}) {
      if (!isDone(stage, keyOf(stage))) return stage;
    }
    return std::nullopt;
  }

 private:
  fs::path images() const { return work_ / "images"; }
  SolverFiles files() const { return {work_ / "database.db", images()}; }

  void takePrepared() {
    photographs_ = preparedFromJson(ledger_.result(PhotoStage::photographs));
    std::vector<std::optional<Place>> places;
    for (const Prepared& photograph : photographs_) places.push_back(photograph.place);
    matching_ = chosenMatching(options_.matching, film_, places);
  }

  // What a stage of COLMAP is made of beside those before it.
  std::string keyOf(PhotoStage stage) const {
    const std::string with = std::string(name(options_.solver)) + ", ";
    if (stage == PhotoStage::features) return with + "lens " + std::string(name(options_.lens));
    if (stage == PhotoStage::matches) return with + std::string(name(matching_));
    return with + std::string(name(options_.mapper)) + " mapper";
  }

  // Whether what a stage works on or leaves is there.
  bool hasFiles(PhotoStage stage) const {
    std::error_code ignored;
    if (stage == PhotoStage::photographs) return fs::is_directory(images(), ignored);
    return isFile(files().database) && (stage != PhotoStage::cameras || isFile(work_ / "sparse/0/images.bin"));
  }
  bool isDone(PhotoStage stage, const std::string& made_of) const {
    return hasFiles(stage) && ledger_.isDone(stage, made_of);
  }

  // Does what is not done. `work` is told whether it goes on with what was begun, and returns the result.
  template <typename Work>
  void stage(PhotoStage stage, const std::string& made_of, Work work) {
    if (stop_ != 0) throw Stopped();
    const std::string title(name(stage));
    if (isDone(stage, made_of)) return listener_.say(title + ": done before");
    const bool goes_on = hasFiles(stage) && ledger_.isBegun(stage, made_of);
    findSolverOnce();  // a machine that cannot go on says so before it reads a film or forgets what is done
    if (stage != PhotoStage::photographs) forgetCameras();
    if (!goes_on && stage == PhotoStage::matches) {
      ledger_.begin(stage, "");  // until those of before are gone no later call goes on with them
      forgetMatches(files().database);
    }
    if (!goes_on) ledger_.begin(stage, made_of);
    const auto start = std::chrono::steady_clock::now();
    const auto [told, result] = work(goes_on);
    ledger_.finish(stage, result);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    listener_.say(title + ": " + told + " in " + duration(seconds));
  }
  using Outcome = std::pair<std::string, std::string>;  // what to say, what to keep

  // Those of before are not of what comes now, and with them the folder would count as a data set.
  void forgetCameras() const {
    std::error_code ignored;
    for (const char* cameras : {"sparse", "sparse.part"}) fs::remove_all(work_ / cameras, ignored);
  }

  void checkPlaces() const {
    const auto nowhere = std::ranges::find_if(photographs_, [](const Prepared& p) { return !p.place; });
    if (nowhere == photographs_.end()) return;
    throw Error(ErrorKind::usage, nowhere->source,
                "does not say where it was taken, as --matching spatial expects of all");
  }

  Outcome prepare() {
    const fs::path part = work_ / "images.part", masks = work_ / "masks.part";
    makeEmpty(part);
    makeEmpty(masks);
    const std::vector<Prepared> prepared =
        prepareImages(options_, part, masks, work_ / "logs/photographs.txt", listener_, stop_);
    forgetCameras();  // only now: with their own photographs they are still a data set
    giveName(part, images());
    giveName(masks, work_ / "masks");
    if (std::error_code ignored; fs::is_empty(work_ / "masks", ignored)) fs::remove(work_ / "masks", ignored);
    return {std::to_string(prepared.size()) + " prepared", toJson(prepared)};
  }

  // Photographs that share a camera: of one size, one make and one focal length.
  std::vector<std::vector<const Prepared*>> cameras() const {
    std::map<std::tuple<int, int, std::string, long>, std::vector<const Prepared*>> groups;
    for (const Prepared& photograph : photographs_) {
      const long focal = std::lround(photograph.focal);
      groups[{photograph.width, photograph.height, photograph.camera, focal}].push_back(&photograph);
    }
    std::vector<std::vector<const Prepared*>> cameras;
    for (auto& [key, group] : groups) cameras.push_back(std::move(group));
    return cameras;
  }

  std::string solverName() {  // as JSON
    const Solver& solver = findSolverOnce();
    return dumpJson(std::string(name(solver.kind)) + " " + solver.version);
  }

  const Solver& findSolverOnce() {
    if (!solver_) {
      solver_ = findSolver(options_.solver, work_ / "logs/solver.txt", stop_);
      if (options_.mapper == Mapper::global && !solver_->global_mapper) {
        throw Error(ErrorKind::device, solver_->program,
                    "has no global mapper" + expectedFound("COLMAP or pycolmap 4", "version " + solver_->version));
      }
      listener_.say(std::string("cameras by ") + (solver_->kind == SolverKind::colmap ? "colmap " : "pycolmap ") +
                    solver_->version + ", " + solver_->program + (solver_->gpu ? ", on the GPU" : ""));
    }
    return *solver_;
  }

  // Runs COLMAP; `counted` is told of the photographs done. COLMAP 3.8 goes on, to exit code 0, without what its
  // database did not take.
  void colmap(std::vector<std::string> words, PhotoStage stage, const std::function<void(std::size_t)>& counted) {
    const fs::path log = work_ / "logs" / (std::string(name(stage)) + ".txt");
    std::string lost;
    const auto line = [&](std::string_view text) {
      if (const std::size_t at = text.find("SQLite error"); at != text.npos && lost.empty()) lost = text.substr(at);
      const std::size_t done = photographsDone(text, stage == PhotoStage::cameras);
      if (done > 0 && counted) counted(done);
    };
    const ChildEnd end = runChild({std::move(words), log, line, {}}, stop_);
    if (!lost.empty()) throw Error(ErrorKind::cannotWrite, files().database.string(), lost);
    if (end.code == 0) return;
    throw Error(end.code >= 128 ? ErrorKind::device : ErrorKind::badData, log.string(),
                (solver_->kind == SolverKind::colmap ? "colmap" : "pycolmap") + std::string(" failed (exit code ") +
                    std::to_string(end.code) + "): " + end.last);
  }

  // Always all of them: COLMAP gives photographs that are added later a camera of their own.
  Outcome features() {
    const Solver& solver = findSolverOnce();
    for (const char* file : {"database.db", "database.db-wal", "database.db-shm", "database.db-journal"}) {
      std::error_code ignored;
      fs::remove(work_ / file, ignored);
    }
    std::size_t before = 0;
    for (const std::vector<const Prepared*>& camera : cameras()) {
      std::string list;
      for (const Prepared* photograph : camera) list += photograph->name + "\n";
      const fs::path names = work_ / "list.txt";
      writeTextAtomically(names, list);
      const Prepared& first = *camera.front();
      // Parameters count as known in COLMAP; without EXIF it guesses and varies them.
      const std::string parameters =
          first.focal > 0 ? lensParameters(options_.lens, first.focal, first.width, first.height) : "";
      colmap(findFeatures(solver, files(), names, options_.lens, parameters, options_.threads), PhotoStage::features,
             [&](std::size_t done) { listener_.progress("features", before + done - 1, photographs_.size()); });
      before += camera.size();
    }
    listener_.progress("features", before, before);
    std::size_t known = 0;
    for (const Prepared& photograph : photographs_) known += photograph.focal > 0;
    return {
        "of " + std::to_string(before) + " photographs, " + std::to_string(known) + " with a focal length from EXIF",
        solverName()};
  }

  Outcome matches() {
    const Solver& solver = findSolverOnce();
    Pairs pairs;
    if (matching_ == Matching::exhaustive) {
      pairs = allPairs(photographs_.size());
      if (photographs_.size() > kMostExhaustive) {
        listener_.warn(std::to_string(pairs.size()) +
                       " pairs are matched, which takes long (--matching sequential: fewer)");
      }
    } else if (matching_ == Matching::sequential) {
      pairs = sequentialPairs(photographs_.size());
      if (options_.matching == Matching::automatic && photographs_.size() > kMostExhaustive && !film_) {
        listener_.warn(
            "photographs are matched with those of neighbouring names, since they do not all say where they "
            "were taken and all pairs would take long (--matching exhaustive)");
      }
    } else {
      std::vector<Place> places;
      for (const Prepared& photograph : photographs_) places.push_back(photograph.place.value());
      pairs = spatialPairs(places);
    }
    for (std::size_t begin = 0; begin < pairs.size(); begin += kPairsAtOnce) {
      listener_.progress("matching pairs", begin, pairs.size());
      const std::size_t end = std::min(begin + kPairsAtOnce, pairs.size());
      std::string list;
      for (std::size_t i = begin; i < end; ++i) {
        list += photographs_[pairs[i].first].name + " " + photographs_[pairs[i].second].name + "\n";
      }
      writeTextAtomically(work_ / "list.txt", list);
      colmap(matchPairs(solver, files(), work_ / "list.txt", options_.threads), PhotoStage::matches, {});
    }
    listener_.progress("matching pairs", pairs.size(), pairs.size());
    return {std::to_string(pairs.size()) + " pairs (" + std::string(name(matching_)) + ")", "null"};
  }

  // Those that COLMAP has written just now: it ends with exit code 0 also where not all of a file could be.
  static std::vector<FoundModel> writtenModels(const fs::path& part) {
    try {
      return findModels(part);
    } catch (const Error& error) {
      if (error.kind != ErrorKind::badData) throw;
      throw Error(ErrorKind::cannotWrite, error.what() + std::string(": not written to its end, as on a full disk"));
    }
  }

  // Whether COLMAP left one, be it cut off.
  static bool leftModel(const fs::path& part) {
    try {
      return !findModels(part).empty();
    } catch (const Error&) {
      return true;
    }
  }

  // The models of at least so many photographs that COLMAP finds; `why`: in its words, where it finds none.
  std::vector<FoundModel> findCameras(const fs::path& part, std::size_t smallest, int trials, std::string& why) {
    makeEmpty(part);
    const std::size_t count = photographs_.size();
    try {
      colmap(solveCameras(findSolverOnce(), files(), part, options_.mapper, smallest, trials, options_.threads),
             PhotoStage::cameras,
             [&](std::size_t done) { listener_.progress("cameras", std::min(done, count - 1), count); });
    } catch (const Error& error) {
      // It also fails where it finds none.
      if (error.kind != ErrorKind::badData || leftModel(part)) throw;
      why = std::string(" (") + error.what() + ")";
    }
    return writtenModels(part);
  }

  // COLMAP keeps the first model that is large enough, be it a splinter after which no other finds a beginning. So only
  // one of most photographs is, until there is none of a few beginnings.
  Outcome solve() {
    const fs::path part = work_ / "sparse.part";
    const std::size_t count = photographs_.size();
    const std::size_t least = std::min(kSmallestModel, std::max(kFewestCameras, count / 3));
    const std::size_t most = std::min(kSmallestModel, count * 3 / 4);
    std::string why;
    std::vector<FoundModel> models;
    if (most > least && options_.mapper == Mapper::incremental) {
      models = findCameras(part, most, kFirstTrials, why);
      if (models.empty()) {
        listener_.say(formatted("no %zu of the %zu photographs hang together: %zu are enough", most, count, least));
      }
    }
    if (models.empty()) models = findCameras(part, least, 0, why);
    if (models.empty()) foundNone(why);
    listener_.progress("cameras", count, count);
    const fs::path chosen = part / "chosen";
    fs::rename(models[0].folder, chosen);
    makeEmpty(work_ / "sparse");
    giveName(chosen, work_ / "sparse/0");
    std::error_code ignored;
    fs::remove_all(part, ignored);
    nlohmann::ordered_json others = nlohmann::ordered_json::array();
    for (std::size_t i = 1; i < models.size(); ++i) others.push_back(models[i].summary.images);
    return {"found", dumpJson(others)};
  }

  // The photographs of the models that were not taken, the largest first.
  std::vector<std::set<std::string>> otherModels() const {
    const std::string path = Ledger::kFile;
    const nlohmann::json result = parseJson(ledger_.result(PhotoStage::cameras), path);
    std::vector<std::set<std::string>> models;
    if (result.is_null()) return models;  // by a version that did not keep them
    for (const nlohmann::json& model : JsonNode{result, path, "cameras"}.array().value) {
      std::set<std::string>& names = models.emplace_back();
      for (const nlohmann::json& name : JsonNode{model, path, "a model"}.array().value) {
        names.insert(JsonNode{name, path, "a photograph"}.string());
      }
    }
    return models;
  }

  // `why`: in COLMAP's words, or "".
  [[noreturn]] void foundNone(const std::string& why) const {
    std::error_code ignored;
    fs::remove_all(work_ / "sparse.part", ignored);
    nameLeftOut({}, {});
    throw Error(
        ErrorKind::badData, options_.input.string(),
        "no cameras found" + expectedFound("some photographs that hang together", "none") + ". " + advice() + why);
  }

  // All but those that have a camera; `others`: in models that were not taken.
  void nameLeftOut(const std::set<std::string>& have, const std::vector<std::set<std::string>>& others) const {
    std::vector<std::string> names;
    std::vector<const Prepared*> left_out;
    std::map<std::string, std::string> called;
    for (const Prepared& photograph : photographs_) {
      called[photograph.name] = photograph.source;
      if (have.contains(photograph.name)) continue;
      names.push_back(photograph.name);
      left_out.push_back(&photograph);
    }
    std::vector<std::string> reasons = whyLeftOut(files().database, names, called, !have.empty());
    for (std::size_t i = 0; i < std::min(names.size(), kMostNamed); ++i) {
      const auto other = std::ranges::find_if(others, [&](const auto& model) { return model.contains(names[i]); });
      if (other != others.end()) {
        reasons[i] = "hangs together with " + std::to_string(other->size() - 1) + " others in another model";
      }
      listener_.warn("left out: " + left_out[i]->source + (reasons[i].empty() ? "" : ": " + reasons[i]));
    }
    if (names.size() > kMostNamed) listener_.warn("left out: " + std::to_string(names.size() - kMostNamed) + " more");
  }

  // What came out, and whether it is enough; also when the stage was done before.
  void judge() {
    const ColmapSummary summary = summarizeColmap(work_ / "sparse/0");
    const std::size_t count = photographs_.size(), placed = summary.images.size();
    listener_.say("cameras: " + std::to_string(placed) + " of " + std::to_string(count) +
                  (film_ ? " frames" : " photographs") +
                  formatted(", %zu points, mean reprojection error %.2f px", summary.points, summary.error));
    const std::vector<std::set<std::string>> others = otherModels();
    if (!others.empty()) {
      std::string sizes;
      for (const std::set<std::string>& model : others) {
        sizes += (sizes.empty() ? "" : ", ") + std::to_string(model.size());
      }
      listener_.warn("the photographs fall into " + std::to_string(others.size() + 1) +
                     " models that do not hang together: the largest, of " + std::to_string(placed) +
                     ", is taken (others have " + sizes + ")");
    }
    nameLeftOut({summary.images.begin(), summary.images.end()}, others);
    const double percent = 100.0 * static_cast<double>(placed) / static_cast<double>(count);
    if (placed < kFewestCameras || percent < options_.least_registered) {
      throw Error(ErrorKind::badData, options_.input.string(),
                  "too few photographs have a camera" +
                      expectedFound(formatted("at least %.0f %% of %zu", options_.least_registered, count),
                                    std::to_string(placed)) +
                      ". " + advice() + " --least-registered P goes on with fewer.");
    }
  }

  std::string advice() const {
    return std::string(
               "What helps: more photographs, each sharing two thirds of its view with the next; walk around rather "
               "than turn on the spot; sharp pictures, no zoom, no mirrors, something with a pattern in view") +
           (matching_ == Matching::exhaustive ? "." : "; --matching exhaustive.");
  }

  const PhotosOptions& options_;
  Ledger& ledger_;
  const PhotosListener& listener_;
  const std::atomic<int>& stop_;
  const fs::path work_;
  bool film_ = false;
  std::vector<Prepared> photographs_;
  Matching matching_ = Matching::automatic;  // as chosen, once there are photographs
  std::optional<Solver> solver_;
};

}  // namespace

void checkInput(const PhotosOptions& options) { madeOf(options); }

std::optional<PhotoStage> undoneStage(const PhotosOptions& options, Ledger& ledger) {
  const PhotosListener nobody;
  const std::atomic<int> never{0};
  return Job(options, ledger, nobody, never).undone();
}

void preparePhotos(const PhotosOptions& options, Ledger& ledger, const PhotosListener& listener,
                   const std::atomic<int>& stop) {
  try {
    Job(options, ledger, listener, stop).run();
  } catch (const fs::filesystem_error& error) {
    throw Error(ErrorKind::cannotWrite, error.path1().string(), error.code().message());
  }
}

}  // namespace tg
