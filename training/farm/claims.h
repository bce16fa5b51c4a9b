// SPDX-License-Identifier: Apache-2.0
// Who works on which job of a farm, in a folder that machines share. There is no server and no lock that must be given
// back: a job is taken by making the folder of its next attempt, which succeeds for one of all who try, on NFS too; and
// a result appears by one rename. Whatever a worker leaves when it is killed is one of the states below.
//
//   farm.json                  the jobs, and which version works on them
//   jobs/NAME/0001/            an attempt: worker.json, beat, log.txt, run/, result/ until it is renamed
//   jobs/NAME/0001/end.json    how it ended, where that was neither success nor the death of its worker
//   jobs/NAME/failed.json      nobody tries again
//   results/NAME/              done: the model, job.json, metrics.jsonl
#pragma once
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "core/system/names.h"
#include "training/farm/jobs.h"

namespace tg {

// How an attempt ended that gave no result: its worker was told to stop, or the training ended with an error.
enum class AttemptEnd { released, failed };
constexpr auto namesOf(AttemptEnd) { return enumNames("released", "failed"); }

struct Failure {
  int code = 0;  // the exit code of tgtrain, 128 + N after signal N
  std::string words;
  std::string worker = {};  // at whom
};

// Open: nobody is at it. Taken: somebody is, or died.
enum class JobState { open, taken, done, failed };
constexpr auto namesOf(JobState) { return enumNames("open", "taken", "done", "failed"); }

// What the folder says of a job at this moment.
struct JobView {
  JobState state = JobState::open;
  int attempts = 0;                // the number of the newest; 0: none
  int failures = 0;                // attempts that ended so
  int deaths = 0;                  // attempts that nobody ended, but for the newest
  std::vector<std::string> failed_at;  // the workers of those
  std::string worker;              // of the newest attempt
  std::string beat;                // of the newest attempt; another text a moment later: its worker is alive
  std::optional<Failure> failure;  // of state failed
};

class FarmFolder {
 public:
  // Of a farm that is there, for --status. Throws Error(cannotRead / badData), also where its results are gone.
  explicit FarmFolder(std::filesystem::path folder);
  // Joins the farm in `folder`, or begins it there unless `join` says that it must be one. Throws Error(usage) for the
  // folder of other jobs or of another version, Error(cannotRead / badData / cannotWrite).
  FarmFolder(std::filesystem::path folder, const std::vector<FarmJob>& jobs, const std::string& version, bool join);

  const std::filesystem::path& folder() const { return folder_; }
  const std::vector<FarmJob>& jobs() const { return jobs_; }
  std::filesystem::path attempt(const std::string& job, int number) const;
  std::filesystem::path result(const std::string& job) const { return folder_ / "results" / job; }

  JobView look(const std::string& job) const;
  // Takes a job for attempt `number`, the one after the newest. False: another worker was faster, or it is done.
  // Throws Error(cannotWrite), also where the results are gone: all that is done would be done again.
  bool claim(const std::string& job, int number, const std::string& worker) const;
  // Says that the worker of an attempt lives. Throws Error(cannotWrite), also where the attempt's folder is gone.
  void beat(const std::string& job, int number, std::uint64_t count) const;
  // Whether a later attempt was begun by somebody who took this one's worker for dead.
  bool isOvertaken(const std::string& job, int number) const;
  // The newest checkpoint of earlier attempts, with the metrics until then, becomes this attempt's run; theirs are
  // removed. Links share its bytes: a checkpoint is replaced, never changed. False: there is none.
  bool carryOver(const std::string& job, int number) const;
  void end(const std::string& job, int number, AttemptEnd end, const Failure& failure) const;
  void fail(const std::string& job, const Failure& failure) const;  // nobody tries again
  // Renames the attempt's result into place. False: another attempt's is there already, and stays.
  bool publish(const std::string& job, int number) const;
  // Removes the runs of a job that is done: checkpoints are as large as three models.
  void sweep(const std::string& job) const;

  // Throws Error(kind) where the results are gone: what is done would be done again.
  void requireResults(ErrorKind kind = ErrorKind::cannotWrite) const;

 private:
  const std::filesystem::path folder_;
  std::vector<FarmJob> jobs_;
};

// Tells the dead from the living without comparing clocks of machines: a worker is dead when its beat has not changed
// for so long on the clock of whoever looks. A look after a long pause of the one who looks counts as a short one: it
// may have slept beside the other.
class BeatWatch {
 public:
  using Clock = std::chrono::steady_clock;
  BeatWatch(std::chrono::duration<double> stale, std::chrono::duration<double> longest_look)
      : stale_(stale), longest_look_(longest_look) {}

  // Notes what a job's beat is now. True: dead.
  bool isDead(const std::string& job, const JobView& view, Clock::time_point now);

 private:
  struct Seen {
    int attempt = 0;
    std::string beat;
    Clock::time_point last{};
    std::chrono::duration<double> unchanged{0};
  };
  const std::chrono::duration<double> stale_, longest_look_;
  std::map<std::string, Seen> seen_;
};

}  // namespace tg
