// SPDX-License-Identifier: Apache-2.0
// Look, claim, train, publish; and what to do where one of them fails.
#include "training/farm/work.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "core/bundle/blocks.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/run/live.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "core/system/shortened.h"
#include "core/system/signals.h"
#include "training/farm/claims.h"
#include "training/photos/child.h"

namespace tg {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr const char* kThisProgram = "/proc/self/exe";  // also while another version is being installed over it
constexpr std::chrono::seconds kPatience(30);           // to finish a step and write a checkpoint
constexpr int kPause = 50;                              // [ms] between two looks for a signal
constexpr int kSignalled = 128;
constexpr Seconds kSignalDelay(3);  // between a scheduler's signals to processes of one job

std::string workerName() {
  char host[HOST_NAME_MAX + 1] = {};
  if (::gethostname(host, sizeof host - 1) != 0) host[0] = '\0';
  return printable(host) + ":" + std::to_string(::getpid());
}

std::string machineOf(const std::string& worker) { return worker.substr(0, worker.rfind(':')); }

bool isStopCode(int code) {
  return std::ranges::any_of(kStopSignals, [&](int signal) { return code == kSignalled + signal; });
}

// The same end whenever it is tried: a wrong command line, wrong data.
bool isFinal(int code) {
  return code == static_cast<int>(ErrorKind::usage) || code == static_cast<int>(ErrorKind::badData);
}

// Throws Error(cannotWrite) with `words` where a model might not fit.
void requireRoom(const fs::path& folder, const std::string& words) {
  const fs::path probe = folder / "room";
  try {
    writeTextAtomically(probe, std::string(std::size_t{16} << 20, ' '));
  } catch (const Error&) {
    throw Error(ErrorKind::cannotWrite, words);
  }
  std::error_code ignored;
  fs::remove(probe, ignored);
}

class Worker {
 public:
  Worker(const FarmOptions& options, const FarmListener& listener, const std::atomic<int>& stop)
      : options_(options),
        listener_(listener),
        stop_(stop),
        folder_(fs::absolute(options.folder).lexically_normal(), readJobs(options.jobs), TG_VERSION, options.join),
        watch_(Seconds(options.stale), Seconds(2 * options.heartbeat)) {}

  int run() {
    while (stop_ == 0) {
      const std::optional<Choice> choice = choose();
      if (choice) {
        work(*choice);
      } else if (open_ == 0 || options_.no_wait) {
        break;
      } else {
        pause(Seconds(options_.heartbeat));
      }
    }
    return stop_ != 0 ? kSignalled + stop_ : conclude();
  }

  std::size_t jobs() const { return folder_.jobs().size(); }

 private:
  struct Choice {
    const FarmJob* job = nullptr;
    JobView view;
  };

  // Not so where it is missing, an empty folder, as a share that is not mounted, or a block of such a one.
  bool hasData(const FarmJob& job) const {
    const fs::path folder = jobs_folder_ / job.dataset;
    std::error_code error;
    if (fs::status(folder, error).type() == fs::file_type::not_found || fs::is_empty(folder, error)) return false;
    try {
      const std::optional<BlockFile> block = readBlock(folder);
      if (block) (void)wholeDataset(folder, *block);
    } catch (const Error& why) {
      return why.kind != ErrorKind::cannotRead;
    }
    return true;
  }

  // The first of the open jobs that failed least, those of dead workers among them. What failed on this machine waits
  // for others while there are any at work: a broken one would try everything until it is given up. Counts what is not
  // settled and has its data here.
  std::optional<Choice> choose() {
    std::optional<Choice> best, again;
    bool elsewhere = false;
    open_ = 0;
    folder_.requireResults();
    for (const FarmJob& job : folder_.jobs()) {
      if (settled_.contains(job.name)) continue;
      JobView view = folder_.look(job.name);
      if (view.state == JobState::taken && watch_.isDead(job.name, view, Clock::now())) {
        if (view.deaths >= options_.takeovers) {
          const Failure failure{kSignalled + SIGKILL, std::to_string(view.deaths + 1) + " workers died at it",
                                view.worker};
          folder_.fail(job.name, failure);
          folder_.end(job.name, view.attempts, AttemptEnd::released, failure);  // for one who removes failed.json
          listener_.warn(job.name + ": given up: " + failure.words);
          view.state = JobState::failed;
        } else {
          view.state = JobState::open;
        }
      }
      if (view.state == JobState::done || view.state == JobState::failed) {
        if (view.state == JobState::done) folder_.sweep(job.name);
        settled_.insert(job.name);
        continue;
      }
      if (view.state == JobState::taken) elsewhere = elsewhere || machineOf(view.worker) != machine_;
      if (!hasData(job)) {
        if (view.state == JobState::open && passed_over_.insert(job.name).second) {
          listener_.warn(job.name + ": its data set " + job.dataset + " is not on this machine; left to others");
        }
        continue;
      }
      ++open_;
      if (view.state != JobState::open) continue;
      const bool failed_here = std::ranges::find(view.failed_at, machine_, machineOf) != view.failed_at.end();
      std::optional<Choice>& place = failed_here ? again : best;
      if (!place || view.failures < place->view.failures) place = Choice{&job, std::move(view)};
      if (best && best->view.failures == 0) break;
    }
    return best || elsewhere ? best : again;
  }

  void work(const Choice& choice) {
    const FarmJob& job = *choice.job;
    const int number = choice.view.attempts + 1;
    if (!folder_.claim(job.name, number, worker_)) return;
    bool overtaken = false;
    try {
      const bool resumed = folder_.carryOver(job.name, number);
      listener_.say(job.name + ": " + (number > 1 ? "attempt " + std::to_string(number) : std::string("begins")) +
                    (resumed ? ", from a checkpoint" : ""));
      finish(job, number, choice.view.failures, train(job, number, overtaken));
    } catch (const Stopped&) {
      if (overtaken) return listener_.warn(job.name + ": another worker has taken over; this one lets it go");
      folder_.end(job.name, number, AttemptEnd::released, {kSignalled + stop_, "stopped", worker_});
      listener_.say(job.name + ": stopped; open for others");
    } catch (const Error& error) {
      release(job, number, error.what());
      throw;
    }
  }

  // For others, if the folder can still be written: an attempt that nobody ended goes stale.
  void release(const FarmJob& job, int number, const std::string& why) {
    try {
      folder_.end(job.name, number, AttemptEnd::released, {static_cast<int>(ErrorKind::cannotWrite), why, worker_});
    } catch (const Error&) {
    }
  }

  // Its exit code and the last of its errors.
  Failure train(const FarmJob& job, int number, bool& overtaken) {
    const fs::path place = folder_.attempt(job.name, number), result = place / "result";
    std::error_code error;
    fs::create_directory(result, error);
    if (error) throw Error(ErrorKind::cannotWrite, result.string(), "cannot make this folder: " + error.message());
    ChildCommand command;
    // A name alone may be that of a command. The job's flags come last: one without its value would take ours for it.
    command.words = {kThisProgram,
                     fs::path(job.dataset).is_absolute() ? job.dataset : "./" + job.dataset,
                     "--run",
                     (place / "run").string(),
                     "--resume",
                     "-o",
                     (result / job.output).string()};
    if (std::ranges::find(job.flags, "--reproducible") == job.flags.end()) command.words.push_back("--reproducible");
    if (options_.threads > 0) command.words.push_back("--threads=" + std::to_string(options_.threads));
    command.words.insert(command.words.end(), job.flags.begin(), job.flags.end());
    command.log = place / "log.txt";
    const std::string_view ours = "tgtrain: ";
    std::string error_line;
    command.line = [&](std::string_view line) {
      if (line.starts_with(ours)) error_line = line.substr(ours.size());
    };
    command.folder = jobs_folder_;
    command.patience = kPatience;
    Clock::time_point last_try = Clock::now(), last_beat = last_try;
    std::uint64_t beats = 0;
    command.meanwhile = [&] {
      const Clock::time_point now = Clock::now();
      if (now - last_try < Seconds(options_.heartbeat)) return;
      last_try = now;
      overtaken = folder_.isOvertaken(job.name, number);
      if (overtaken) throw Stopped();
      try {
        folder_.beat(job.name, number, ++beats);
        last_beat = now;
      } catch (const Error&) {
        // A share that is away for a moment comes back; one that stays away is lost, and the job is another's by then.
        if (now - last_beat >= Seconds(options_.stale)) throw;
      }
    };
    const ChildEnd end = runChild(command, stop_);
    // Whoever took over has moved the run: that it failed here says nothing of the job.
    overtaken = end.code != 0 && folder_.isOvertaken(job.name, number);
    if (overtaken) throw Stopped();
    return {end.code, shortened(printable(error_line.empty() ? end.last : error_line)), worker_};
  }

  void finish(const FarmJob& job, int number, int failures, Failure failure) {
    const fs::path place = folder_.attempt(job.name, number), result = place / "result";
    // A scheduler's signal goes to the whole job, so this worker's own comes, too. One for the training alone, of what
    // watches over memory, say, comes again with each attempt: it counts as a failure.
    if (isStopCode(failure.code)) {
      pause(kSignalDelay);
      if (stop_ != 0) {
        folder_.end(job.name, number, AttemptEnd::released, {failure.code, "stopped", worker_});
        return listener_.say(job.name + ": stopped; open for others");
      }
      failure.words = "the training alone was told to stop";
    }
    // All that it writes is the farm's: where this cannot write there either, not the job is wrong, but the place.
    if (failure.code == static_cast<int>(ErrorKind::cannotWrite)) requireRoom(place, failure.words);
    if (failure.code == static_cast<int>(ErrorKind::cannotRead) && !hasData(job)) {
      listener_.warn(job.name + ": its data set is gone from this machine; open for others: " + failure.words);
      return folder_.end(job.name, number, AttemptEnd::released, failure);
    }
    if (failure.code == 0 && !isFile(result / job.output)) {
      failure = {static_cast<int>(ErrorKind::usage), "ended without a model (a flag that only prints?)", worker_};
    }
    if (failure.code != 0) {
      const bool last = isFinal(failure.code) || failures >= options_.retries;
      listener_.warn(job.name + ": attempt " + std::to_string(number) + " failed with exit code " +
                     std::to_string(failure.code) + (last ? "; given up: " : ", tried again: ") + failure.words);
      if (last) folder_.fail(job.name, failure);
      return folder_.end(job.name, number, AttemptEnd::failed, failure);
    }
    writeTextAtomically(result / "job.json", dumpJson(jsonOf(job), 1) + "\n");
    // Another worker that took the job over meanwhile may have taken the run along: the model counts without it.
    const fs::path metrics = place / "run" / kMetricsName;
    if (isFile(metrics)) copyFileAtomically(metrics, result / kMetricsName);
    const bool first = folder_.publish(job.name, number);
    listener_.say(job.name + (first ? ": done" : ": done by another worker meanwhile"));
    folder_.sweep(job.name);
  }

  // Every job is settled, or others are at work on the rest, or it is for them.
  int conclude() {
    std::size_t done = 0, failed = 0, open = 0, open_here = 0;
    int code = 0;
    for (const FarmJob& job : folder_.jobs()) {
      const JobView view = folder_.look(job.name);
      done += view.state == JobState::done;
      failed += view.state == JobState::failed;
      if (view.state == JobState::failed && code == 0) code = view.failure->code;
      if (view.state != JobState::open) continue;
      ++open;
      open_here += hasData(job);
    }
    const std::size_t taken = jobs() - done - failed - open;
    listener_.say(std::to_string(done) + " of " + std::to_string(jobs()) + " jobs done" +
                  (failed > 0 ? ", " + std::to_string(failed) + " given up" : "") +
                  (open > 0 ? ", " + std::to_string(open) + " left to others" : "") +
                  (taken > 0 ? ", others are at " + std::to_string(taken) : ""));
    if (code == 0 && open > 0 && open_here == 0) code = static_cast<int>(ErrorKind::cannotRead);
    const bool ours = code >= 0 && code <= static_cast<int>(ErrorKind::device);
    return ours ? code : static_cast<int>(ErrorKind::device);
  }

  void pause(Seconds time) const {
    const Clock::time_point end = Clock::now() + std::chrono::duration_cast<Clock::duration>(time);
    while (stop_ == 0 && Clock::now() < end) ::poll(nullptr, 0, kPause);
  }

  const FarmOptions& options_;
  const FarmListener& listener_;
  const std::atomic<int>& stop_;
  const std::string worker_ = workerName(), machine_ = machineOf(worker_);
  const fs::path jobs_folder_ = fs::absolute(options_.jobs).parent_path();
  const FarmFolder folder_;
  BeatWatch watch_;
  std::set<std::string> settled_, passed_over_;
  std::size_t open_ = 0;
};

}  // namespace

int workOnFarm(const FarmOptions& options, const FarmListener& listener, const std::atomic<int>& stop) {
  if (options.prepare && options.join) {
    throw Error(ErrorKind::usage, "--prepare begins a farm, --join expects one (expected one of them)");
  }
  const auto least = static_cast<float>(3 * options.heartbeat), stale = static_cast<float>(options.stale);
  if (stale < least) {
    throw Error(ErrorKind::usage, "--stale must be three heartbeats or more" +
                                      expectedFound("at least " + numberText(least), numberText(stale)));
  }
  Worker worker(options, listener, stop);
  if (!options.prepare) return worker.run();
  listener.say(options.folder.string() + ": " + std::to_string(worker.jobs()) + " jobs");
  return 0;
}

}  // namespace tg
