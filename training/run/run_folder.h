// SPDX-License-Identifier: Apache-2.0
// The folder of a run that can be watched, killed and resumed: checkpoint, model.tgz, metrics.jsonl, previews/, and
// outputs.json where it has written files elsewhere.
#pragma once
#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "core/file/folder_lock.h"
#include "training/run/checkpoint.h"
#include "training/run/metrics_log.h"
#include "training/run/report.h"
#include "training/run/trainer.h"

namespace tg {

struct RunFolderOptions {
  std::filesystem::path folder;
  bool resume = false;             // go on from the checkpoint, where there is one
  bool overwrite = false;          // else: replace what is there
  double checkpoint_seconds = 60;  // between two checkpoints; 0: after every step
  int metrics_every = 10;          // [iterations] a line of metrics.jsonl
  int eval_every = 0;              // [iterations] test scores in it; 0: at the end of each stage alone
  int preview_every = 0;           // [iterations] a picture in previews/; 0: none
};

// What a run is made of. Data set and start model must outlive the folder.
struct RunInputs {
  const Dataset& dataset;
  const TrainSettings& settings;
  const GaussianModel* start = nullptr;  // that stage 1 goes on from, if any
  TrainingJsonOptions json;
  const std::atomic<bool>* stop = nullptr;  // set: leave out test scores, the run is about to end
  FlagTexts quantized_for;                  // runIdentity()
  const GaussianModel* context = nullptr;   // likewise
};

// What a file, which is not of the folder, is to the run in `folder` by its outputs.json: that has paths from the
// folder on, so both may be moved together. Not `own` is what has changed since the run wrote it. Throws
// Error(cannotRead / badData).
enum class Ownership { others, own, changed };
Ownership ownershipOf(const std::filesystem::path& folder, const std::filesystem::path& file);

// One process at a time. Whatever happens to it, the folder holds the last checkpoint and a valid model, or nothing.
class RunFolder {
 public:
  // Makes and locks the folder, which goes again where no checkpoint has come into it. Throws Error(cannotWrite) when
  // it is in use or holds what must not be replaced.
  explicit RunFolder(RunFolderOptions options);
  ~RunFolder();
  RunFolder& operator=(RunFolder&&) = delete;

  const std::filesystem::path& folder() const { return options_.folder; }
  std::filesystem::path model() const { return options_.folder / "model.tgz"; }
  std::filesystem::path checkpoint() const { return options_.folder / "checkpoint"; }
  bool hasCheckpoint() const { return has_checkpoint_; }

  // Call once, before training: the state to go on from, with the metrics cut back to it; or none, with the old run
  // removed. Throws what readCheckpoint and checkResumable throw.
  std::optional<RunState> begin(const RunInputs& inputs);
  // Metrics, previews, and a checkpoint where one is due: after the first step, at the end of each stage, and every
  // checkpoint_seconds, but so that at most a twentieth of the time goes into them. A checkpoint that cannot be written
  // is reported on stderr, once until there is one again, and tried again later; the first one throws
  // Error(cannotWrite).
  void afterStep(const Trainer& trainer);
  // The last checkpoint and model, finished or not. Returns the model's training.json. Throws Error(cannotWrite).
  std::string finish(const Trainer& trainer);
  // What the run goes on from: "plain 812/1500", or "" without a checkpoint.
  const std::string& lastCheckpoint() const { return last_checkpoint_; }

  // Whether ownershipOf() says so of a run that goes on.
  bool owns(const std::filesystem::path& file) const;
  // Makes it so or not: before `file` is written, since who is killed meanwhile is to find it again.
  void setOwn(const std::filesystem::path& file, bool own) const;
  // After that: from now on it is its own only as it is now.
  void markWritten(const std::filesystem::path& file) const;

  // Wall time of the run, all its sessions together.
  double seconds() const;
  // `told` every line of metrics.jsonl from now on.
  void onMetrics(MetricsLog::Sink told) { told_ = std::move(told); }
  // Of metrics.jsonl, after begin().
  int metricsDescriptor() const { return metrics_; }

 private:
  using Clock = std::chrono::steady_clock;

  void leave();
  std::string save(const Trainer& trainer);  // returns training.json
  void openMetrics(std::uint64_t keep_bytes);
  void writeMetrics(const RunMetrics& metrics);
  void writePreview(const Trainer& trainer) const;

  const RunFolderOptions options_;
  const Clock::time_point start_ = Clock::now();
  bool made_ = false;  // was not there before
  std::optional<FolderLock> lock_;
  bool has_checkpoint_ = false;
  double earlier_seconds_ = 0;
  const Dataset* dataset_ = nullptr;
  TrainingJsonOptions json_;
  RunIdentity identity_;
  int metrics_ = -1;  // descriptor
  std::uint64_t metrics_bytes_ = 0;
  bool metrics_lost_ = false;  // the last line could not be written
  MetricsLog log_;
  MetricsLog::Sink told_;
  bool saved_ = false;    // in this session
  bool unsaved_ = false;  // the last checkpoint could not be written
  std::string last_checkpoint_;
  Clock::time_point next_save_{};
};

}  // namespace tg
