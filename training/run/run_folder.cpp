// SPDX-License-Identifier: Apache-2.0
// What is written when, and what is found again.
#include "training/run/run_folder.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/file/sha256.h"
#include "core/image/drawn.h"
#include "core/run/live.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "training/run/trained_bundle.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOutputsName = "outputs.json";
constexpr std::uint64_t kMostOutputsBytes = 1 << 20;
constexpr std::size_t kMostOutputs = 4096;
constexpr double kLargestShare = 0.05;  // of the time for checkpoints

// Left by a process that was killed while it wrote.
bool isTemporary(const fs::path& path) { return path.filename().string().starts_with(".tg-"); }

// Of a run that was watched when it was killed.
bool isLiveFile(const fs::path& file) {
  return file == kLiveModelName || file == kLiveStatusName || file == kControlName;
}

// Nothing to lose: empty, or, where a run is to go on, what one leaves that was killed before its first checkpoint.
bool isFresh(const fs::path& folder, bool resume) {
  return std::all_of(fs::directory_iterator(folder), fs::directory_iterator(), [&](const fs::directory_entry& entry) {
    const fs::path file = entry.path().filename();
    return isTemporary(file) || (resume && (file == kMetricsName || file == "previews" || isLiveFile(file)));
  });
}

void removeTemporaries(const fs::path& folder) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    if (isTemporary(entry.path()) && entry.is_regular_file(ignored)) fs::remove(entry.path(), ignored);
  }
}

std::string pathFrom(const fs::path& folder, const fs::path& file) {
  return fs::absolute(file).lexically_normal().lexically_relative(fs::absolute(folder).lexically_normal()).string();
}

// JSON is UTF-8: of a name that is none the list has the bytes, since names that differ in those alone are two files.
nlohmann::ordered_json jsonOf(const std::string& name) {
  try {
    requireUtf8(name, kOutputsName);
    return name;
  } catch (const Error&) {
    return std::vector<std::uint8_t>(name.begin(), name.end());
  }
}

std::string nameOf(const nlohmann::json& output, const JsonNode& node) {
  if (output.is_string()) return output.get<std::string>();
  const auto is_byte = [](const nlohmann::json& byte) {
    return byte.is_number_unsigned() && byte.get<std::uint64_t>() <= 255;
  };
  if (!output.is_array() || !std::ranges::all_of(output, is_byte)) node.fail("outputs: expected paths");
  const auto bytes = output.get<std::vector<std::uint8_t>>();
  return {bytes.begin(), bytes.end()};
}

struct OwnFile {
  std::string path;
  std::string sha256;  // as the run left it; "": it may be writing it, or did so before there was this
};

std::vector<OwnFile> outputsOf(const fs::path& folder) {
  const fs::path path = folder / kOutputsName;
  if (!fs::exists(path)) return {};
  const std::string name = path.string();
  const nlohmann::json listed = parseJson(readRegularFile(path, kMostOutputsBytes), name);
  const JsonNode node{listed, name, ""};
  std::vector<OwnFile> outputs;
  for (const nlohmann::json& output : node.list("outputs", kMostOutputs)) outputs.push_back({nameOf(output, node), ""});
  if (!node.has("sha256")) return outputs;
  std::size_t i = 0;
  for (const nlohmann::json& sum : node.list("sha256", kMostOutputs)) {
    if (!sum.is_string()) node.fail("sha256: expected texts");
    if (i < outputs.size()) outputs[i++].sha256 = sum.get<std::string>();
  }
  return outputs;
}

void writeOutputs(const fs::path& folder, const std::vector<OwnFile>& outputs) {
  nlohmann::ordered_json paths = nlohmann::ordered_json::array(), sums = paths;
  for (const OwnFile& output : outputs) {
    paths.push_back(jsonOf(output.path));
    sums.push_back(output.sha256);
  }
  writeTextAtomically(folder / kOutputsName, dumpJson({{"outputs", paths}, {"sha256", sums}}) + "\n");
}

std::string sha256Of(const fs::path& file) {
  const FileReader reader(file, std::numeric_limits<std::uint64_t>::max());
  std::vector<std::uint8_t> piece(std::size_t{1} << 20);
  Sha256 sum;
  for (std::uint64_t at = 0; at < reader.size(); at += piece.size()) {
    piece.resize(static_cast<std::size_t>(std::min<std::uint64_t>(piece.size(), reader.size() - at)));
    reader.read(at, piece);
    sum.add(piece);
  }
  return sum.hex();
}

std::string previewName(Stage stage, int iteration) {
  char digits[16];
  std::snprintf(digits, sizeof digits, "%07d", iteration);
  return std::string(name(stage)) + "_" + digits + ".png";
}

std::string momentText(Stage stage, int iteration, int iterations) {
  return std::string(name(stage)) + " " + std::to_string(iteration) + "/" + std::to_string(iterations);
}

bool isPreviewName(const std::string& file) {
  for (const Stage stage : valuesOf<Stage>()) {
    const std::string model = previewName(stage, 0);
    const std::size_t digits = model.find('_') + 1;
    if (file.size() == model.size() && file.compare(0, digits, model, 0, digits) == 0 && file.ends_with(".png") &&
        file.find_first_not_of("0123456789", digits) == digits + 7) {
      return true;
    }
  }
  return false;
}

void removePreviews(const fs::path& folder) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    if (isPreviewName(entry.path().filename().string())) fs::remove(entry.path(), ignored);
  }
  fs::remove(folder, ignored);  // where nothing else is in it
}

}  // namespace

Ownership ownershipOf(const fs::path& folder, const fs::path& file) {
  const std::vector<OwnFile> all = outputsOf(folder);
  const auto found = std::ranges::find(all, pathFrom(folder, file), &OwnFile::path);
  if (found == all.end()) return Ownership::others;
  const bool same = found->sha256.empty() || !isFile(file) || sha256Of(file) == found->sha256;
  return same ? Ownership::own : Ownership::changed;
}

RunFolder::RunFolder(RunFolderOptions options)
    : options_(std::move(options)), log_(options_.metrics_every, options_.eval_every) {
  const fs::path& folder = options_.folder;
  std::error_code error;
  made_ = fs::create_directories(folder, error);
  if (error) throw Error(ErrorKind::cannotWrite, folder.string(), "cannot make this folder: " + error.message());
  try {
    lock_.emplace(folder);
    has_checkpoint_ = options_.resume && fs::exists(checkpoint());
    if (!has_checkpoint_ && !options_.overwrite && !isFresh(folder, options_.resume)) {
      throw Error(ErrorKind::cannotWrite, folder.string(),
                  options_.resume ? "holds files but no checkpoint to resume (add --overwrite to start anew)"
                                  : "exists already (add --resume to go on with it, or --overwrite to start anew)");
    }
    removeTemporaries(folder);
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      if (isLiveFile(entry.path().filename())) fs::remove(entry.path(), error);
    }
    requireWritable(checkpoint());
  } catch (...) {
    leave();
    throw;
  }
}

RunFolder::~RunFolder() {
  if (metrics_ >= 0) ::close(metrics_);
  leave();
}

void RunFolder::leave() {
  std::error_code ignored;
  if (metrics_ >= 0 && last_checkpoint_.empty()) {  // which the same command would be refused for
    fs::remove(options_.folder / kMetricsName, ignored);
    fs::remove(checkpoint(), ignored);
    removePreviews(options_.folder / "previews");
  }
  if (made_) fs::remove(options_.folder, ignored);  // where nothing is in it
}

bool RunFolder::owns(const fs::path& file) const {
  return has_checkpoint_ && ownershipOf(options_.folder, file) == Ownership::own;
}

void RunFolder::setOwn(const fs::path& file, bool own) const {
  std::vector<OwnFile> all = outputsOf(options_.folder);
  const std::string name = pathFrom(options_.folder, file);
  const std::size_t erased = std::erase_if(all, [&](const OwnFile& output) { return output.path == name; });
  if (!own && erased == 0) return;
  if (own) all.push_back({name, ""});
  if (all.size() > kMostOutputs) all.erase(all.begin());
  writeOutputs(options_.folder, all);
}

void RunFolder::markWritten(const fs::path& file) const {
  std::vector<OwnFile> all = outputsOf(options_.folder);
  const auto found = std::ranges::find(all, pathFrom(options_.folder, file), &OwnFile::path);
  if (found == all.end() || !isFile(file)) return;
  found->sha256 = sha256Of(file);
  writeOutputs(options_.folder, all);
}

double RunFolder::seconds() const {
  return earlier_seconds_ + std::chrono::duration<double>(Clock::now() - start_).count();
}

std::optional<RunState> RunFolder::begin(const RunInputs& inputs) {
  TG_ASSERT(dataset_ == nullptr, "a run begins once");
  dataset_ = &inputs.dataset;
  json_ = inputs.json;
  log_.stop = inputs.stop;
  if (json_.fingerprint.empty()) json_.fingerprint = datasetFingerprint(inputs.dataset);
  identity_ = runIdentity(inputs.dataset, inputs.settings, json_.fingerprint, inputs.start, inputs.quantized_for,
                          inputs.context);
  if (!has_checkpoint_) {
    // The checkpoint last: until then, the old run can go on.
    std::error_code ignored;
    removePreviews(options_.folder / "previews");
    fs::remove(model(), ignored);
    fs::remove(options_.folder / kOutputsName, ignored);
    fs::remove(checkpoint(), ignored);
    openMetrics(0);
    return std::nullopt;
  }
  Checkpoint found = readCheckpoint(checkpoint());
  checkResumable(found, identity_, inputs.dataset, inputs.settings, checkpoint().string());
  earlier_seconds_ = found.header.seconds;
  last_checkpoint_ =
      momentText(found.state.stage, found.state.iteration, iterationsOf(inputs.settings, found.state.stage));
  log_.resume(found.state.stage, found.state.finished);
  openMetrics(found.header.metrics_bytes);
  return std::move(found.state);
}

// Lines after the checkpoint will be written again.
void RunFolder::openMetrics(std::uint64_t keep_bytes) {
  const fs::path path = options_.folder / kMetricsName;
  metrics_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  struct stat status{};
  if (metrics_ < 0 || ::fstat(metrics_, &status) != 0 || !S_ISREG(status.st_mode)) {
    if (metrics_ >= 0) ::close(std::exchange(metrics_, -1));  // and stays as it is
    throw Error(ErrorKind::cannotWrite, path.string(), "cannot open as a regular file: " + systemReason());
  }
  metrics_bytes_ = std::min(keep_bytes, static_cast<std::uint64_t>(status.st_size));
  if (::ftruncate(metrics_, static_cast<off_t>(metrics_bytes_)) != 0) {
    throw Error(ErrorKind::cannotWrite, path.string(), "cannot cut: " + systemReason());
  }
}

// One write a line: a reader, and a run that was killed, see whole lines.
void RunFolder::writeMetrics(const RunMetrics& metrics) {
  const std::string line = formatMetrics(metrics);
  errno = 0;
  const ssize_t written = ::write(metrics_, line.data(), line.size());
  if (written == static_cast<ssize_t>(line.size())) {
    metrics_bytes_ += static_cast<std::uint64_t>(written);
    metrics_lost_ = false;
  } else {
    const std::string reason = written < 0 ? systemReason() : "no space for a whole line";
    if (written > 0 && ::ftruncate(metrics_, static_cast<off_t>(metrics_bytes_)) != 0) metrics_bytes_ += written;
    if (!std::exchange(metrics_lost_, true)) {  // once, until there is room again
      std::fprintf(stderr, "tgtrain: %s: cannot write: %s\n", (options_.folder / kMetricsName).c_str(), reason.c_str());
    }
  }
  if (told_) told_(metrics);
}

void RunFolder::writePreview(const Trainer& trainer) const {
  const std::size_t view = previewView(*dataset_);
  const Camera& camera = dataset_->views[view];
  const Image truth = dataset_->pixels(view)->image();
  const Image picture = trainer.picture(camera);
  Image both(2 * camera.size.x, camera.size.y, 3);
  for (int y = 0; y < camera.size.y; ++y) {
    for (int x = 0; x < camera.size.x; ++x) {
      for (int c = 0; c < 3; ++c) {
        both.at(x, y, c) = truth.at(x, y, c);
        both.at(camera.size.x + x, y, c) = picture.at(x, y, c);
      }
    }
  }
  const fs::path folder = options_.folder / "previews";
  std::error_code ignored;
  fs::create_directory(folder, ignored);
  writeDrawn(folder / previewName(trainer.stage(), trainer.progress().iteration), both);
}

std::string RunFolder::save(const Trainer& trainer) {
  const Clock::time_point start = Clock::now();
  ::fdatasync(metrics_);
  writeCheckpoint(checkpoint(), {identity_, seconds(), metrics_bytes_}, trainer.state());
  const TrainProgress progress = trainer.progress();
  const std::string moment = momentText(progress.stage, progress.iteration, progress.iterations);
  if (!last_checkpoint_.empty()) last_checkpoint_ = moment;  // the first counts once there is a model, too
  TrainResult result = trainer.result();
  result.untextured.reset();
  json_.total_seconds = seconds();
  const Bundle bundle =
      makeTrainedBundle(*dataset_, trainer.settings(), result.report, std::move(result.model), json_);
  writeBundle(model(), bundle);
  last_checkpoint_ = moment;
  const Clock::time_point end = Clock::now();
  const double cost = std::chrono::duration<double>(end - start).count();
  const double pause =
      options_.checkpoint_seconds > 0 ? std::max(options_.checkpoint_seconds, cost / kLargestShare) : 0;
  next_save_ = end + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(pause));
  saved_ = true;
  unsaved_ = false;
  return bundle.training_json;
}

void RunFolder::afterStep(const Trainer& trainer) {
  TG_ASSERT(dataset_ != nullptr, "begin() comes first");
  log_.afterStep(trainer, seconds(), [this](const RunMetrics& line) { writeMetrics(line); });
  const TrainProgress progress = trainer.progress();
  const bool last = progress.iteration == progress.iterations;
  const auto requireSaved = [this](const Error& error) {
    if (!saved_ || error.kind != ErrorKind::cannotWrite) throw;
  };
  try {
    if (options_.preview_every > 0 && progress.iteration % options_.preview_every == 0) writePreview(trainer);
  } catch (const Error& error) {
    requireSaved(error);
    std::fprintf(stderr, "tgtrain: %s (training goes on)\n", error.what());
  }
  try {
    if (!saved_ || last || Clock::now() >= next_save_) save(trainer);
  } catch (const Error& error) {
    requireSaved(error);
    if (!std::exchange(unsaved_, true)) {
      std::fprintf(stderr, "tgtrain: %s (training goes on; the last checkpoint is of %s)\n", error.what(),
                   last_checkpoint_.c_str());
    }
    next_save_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                    std::chrono::duration<double>(options_.checkpoint_seconds));
  }
}

std::string RunFolder::finish(const Trainer& trainer) {
  TG_ASSERT(dataset_ != nullptr, "begin() comes first");
  log_.finish(trainer, seconds(), [this](const RunMetrics& line) { writeMetrics(line); });
  return save(trainer);
}

}  // namespace tg
