// SPDX-License-Identifier: Apache-2.0
// The states of a job as files; each change is one call that happens or does not.
#include "training/farm/claims.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "core/file/atomic_files.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/run/live.h"
#include "core/system/assert.h"
#include "core/system/descriptor.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "core/system/shortened.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxFarmBytes = std::uint64_t{256} << 20;
constexpr std::uint64_t kMaxNoteBytes = std::uint64_t{64} << 10;
constexpr const char* kFormat = "tgtrain-farm";
constexpr int kVersion = 1;
constexpr int kMostAttempts = 1'000'000;

void makeFolder(const fs::path& folder) {
  if (::mkdir(folder.c_str(), 0777) == 0) return;
  std::error_code ignored;
  const int reason = errno;
  if (reason == EEXIST && fs::is_directory(folder, ignored)) return;
  errno = reason;
  throw Error(ErrorKind::cannotWrite, folder.string(), "cannot make this folder: " + systemReason());
}

std::string textOf(const fs::path& file, std::uint64_t max_bytes) {
  const std::vector<std::uint8_t> bytes = readRegularFile(file, max_bytes);
  return {bytes.begin(), bytes.end()};
}

// Of a small file that may be missing, or be half there after its writer died.
std::optional<nlohmann::json> noteOf(const fs::path& file) {
  if (!isFile(file)) return std::nullopt;
  try {
    nlohmann::json note = parseJson(textOf(file, kMaxNoteBytes), file.string());
    if (note.is_object()) return note;
  } catch (const Error& error) {
    if (error.kind != ErrorKind::badData && isFile(file)) throw;
  }
  return std::nullopt;
}

std::string textIn(const nlohmann::json& note, const char* key) {
  const auto found = note.find(key);
  return found != note.end() && found->is_string() ? found->get<std::string>() : "";
}

nlohmann::ordered_json jsonOf(const Failure& failure) {
  return {{"code", failure.code}, {"words", failure.words}, {"worker", failure.worker}};
}

Failure failureIn(const nlohmann::json& note) {
  const auto code = note.find("code");
  return {code != note.end() && code->is_number_integer() ? code->get<int>() : 0, textIn(note, "words"),
          textIn(note, "worker")};
}

std::string attemptName(int number) { return formatted("%04d", number); }

// The numbers of the attempts of a job, in order.
std::vector<int> attemptsIn(const fs::path& job) {
  std::vector<int> numbers;
  std::error_code error;
  for (fs::directory_iterator entry(job, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    const std::optional<int> number = parseWhole<int>(name);
    if (number && *number > 0 && *number <= kMostAttempts && attemptName(*number) == name) numbers.push_back(*number);
  }
  if (error && error != std::errc::no_such_file_or_directory) {
    throw Error(ErrorKind::cannotRead, job.string(), "cannot list: " + error.message());
  }
  std::ranges::sort(numbers);
  return numbers;
}

std::string farmText(const std::vector<FarmJob>& jobs, const std::string& version) {
  nlohmann::ordered_json json = {{"format", kFormat}, {"version", kVersion}, {"tgtrain", version}};
  json["jobs"] = nlohmann::ordered_json::array();
  for (const FarmJob& job : jobs) json["jobs"].push_back(jsonOf(job));
  return dumpJson(json, 1) + "\n";
}

struct Farm {
  std::string version;  // of its workers
  std::vector<FarmJob> jobs;
};

Farm readFarm(const fs::path& file) {
  const nlohmann::json json = parseJson(textOf(file, kMaxFarmBytes), file.string());
  const std::string path = file.string();
  const JsonNode root{json, path, ""};
  if (!json.is_object() || textIn(json, "format") != kFormat) {
    throw Error(ErrorKind::badData, path, std::string("is no farm (expected format ") + kFormat + ")");
  }
  if (const std::int64_t version = root.integer("version", 0, 1'000'000); version != kVersion) {
    throw Error(ErrorKind::badData, path,
                "unknown version" + expectedFound(std::uint64_t{kVersion}, static_cast<std::uint64_t>(version)));
  }
  std::string lines;
  for (const nlohmann::json& job : root.list("jobs", kMaxFarmJobs)) lines += dumpJson(job) + "\n";
  return {root.string("tgtrain"), parseJobs(lines, path)};
}

// Which jobs differ, for whoever mixed two folders up.
[[noreturn]] void refuseOtherJobs(const fs::path& folder, const std::vector<FarmJob>& there,
                                  const std::vector<FarmJob>& here) {
  std::size_t i = 0;
  while (i < there.size() && i < here.size() && there[i] == here[i]) ++i;
  const auto shown = [&](const std::vector<FarmJob>& jobs) {
    return i < jobs.size() ? shortened(dumpJson(jsonOf(jobs[i])), 120, 40) : std::string("none");
  };
  throw Error(ErrorKind::usage, folder.string(),
              "is the folder of other jobs: job " + std::to_string(i + 1) + " differs" +
                  expectedFound(shown(there), shown(here)));
}

}  // namespace

FarmFolder::FarmFolder(fs::path folder) : folder_(std::move(folder)), jobs_(readFarm(folder_ / "farm.json").jobs) {
  requireResults(ErrorKind::cannotRead);
}

FarmFolder::FarmFolder(fs::path folder, const std::vector<FarmJob>& jobs, const std::string& version, bool join)
    : folder_(std::move(folder)), jobs_(jobs) {
  const fs::path file = folder_ / "farm.json";
  std::error_code ignored;
  if (!isFile(file)) {
    if (join) {
      throw Error(ErrorKind::cannotRead, folder_.string(),
                  "holds no farm (expected the share to be there, and --prepare before --join)");
    }
    makeFolder(folder_);
    if (!fs::is_empty(folder_, ignored)) {
      for (const fs::directory_entry& entry : fs::directory_iterator(folder_, ignored)) {
        const std::string name = entry.path().filename().string();
        if (name == "jobs" || name == "results" || name == "farm.json" || name.starts_with(".tg-")) continue;
        throw Error(ErrorKind::cannotWrite, folder_.string(),
                    "holds other files (expected a farm's folder, or an empty one)");
      }
    }
    makeFolder(folder_ / "jobs");
    makeFolder(folder_ / "results");
    try {
      const KeepExisting first_wins;
      writeTextAtomically(file, farmText(jobs_, version));
    } catch (const Error&) {
      if (!isFile(file)) throw;
    }
  }
  const Farm found = readFarm(file);
  if (found.version != version) {
    throw Error(ErrorKind::usage, file.string(),
                "is of workers of another version" + expectedFound(shortened(found.version, 40, 10), version));
  }
  if (found.jobs != jobs_) refuseOtherJobs(folder_, found.jobs, jobs_);
  requireResults();
}

fs::path FarmFolder::attempt(const std::string& job, int number) const {
  return folder_ / "jobs" / job / attemptName(number);
}

void FarmFolder::requireResults(ErrorKind kind) const {
  const fs::path results = folder_ / "results";
  std::error_code error;
  if (fs::status(results, error).type() != fs::file_type::not_found || !isFile(folder_ / "farm.json")) return;
  throw Error(kind, results.string(),
              "is gone, and with it what is done (expected it back, or an empty folder to do all again)");
}

JobView FarmFolder::look(const std::string& job) const {
  JobView view;
  std::error_code error;
  const std::vector<int> attempts = attemptsIn(folder_ / "jobs" / job);
  bool ended = false;
  for (const int number : attempts) {
    const std::optional<nlohmann::json> note = noteOf(attempt(job, number) / "end.json");
    const bool failed = note && textIn(*note, "end") == name(AttemptEnd::failed);
    view.failures += failed;
    if (failed) view.failed_at.push_back(textIn(*note, "worker"));
    view.deaths += !note && number != attempts.back();
    ended = note.has_value();
  }
  if (!attempts.empty()) {
    view.attempts = attempts.back();
    const fs::path newest = attempt(job, view.attempts);
    if (const std::optional<nlohmann::json> note = noteOf(newest / "worker.json"))
      view.worker = textIn(*note, "worker");
    if (!ended && isFile(newest / "beat")) view.beat = textOf(newest / "beat", kMaxNoteBytes);
    if (!ended) view.state = JobState::taken;
  }
  if (const std::optional<nlohmann::json> note = noteOf(folder_ / "jobs" / job / "failed.json")) {
    view.state = JobState::failed;
    view.failure = failureIn(*note);
  }
  if (fs::is_directory(result(job), error)) view.state = JobState::done;
  return view;
}

bool FarmFolder::claim(const std::string& job, int number, const std::string& worker) const {
  requireResults();
  makeFolder(folder_ / "jobs" / job);
  const fs::path taken = attempt(job, number);
  if (::mkdir(taken.c_str(), 0777) != 0) {
    if (errno == EEXIST) return false;
    throw Error(ErrorKind::cannotWrite, taken.string(), "cannot make this folder: " + systemReason());
  }
  std::error_code ignored;
  if (fs::is_directory(result(job), ignored)) return false;  // done since the last look
  beat(job, number, 0);
  writeTextAtomically(taken / "worker.json", dumpJson(nlohmann::ordered_json{{"worker", worker}}) + "\n");
  return true;
}

void FarmFolder::beat(const std::string& job, int number, std::uint64_t count) const {
  // Opened and closed every time: that is when NFS brings bytes to its server, and when it says what is wrong.
  const fs::path file = attempt(job, number) / "beat";
  Descriptor descriptor(::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666));
  const std::string text = formatted("%020ju\n", static_cast<std::uintmax_t>(count));
  const bool written = descriptor.get() >= 0 &&
                       ::pwrite(descriptor.get(), text.data(), text.size(), 0) == static_cast<ssize_t>(text.size());
  if (!written || ::close(descriptor.release()) != 0) {
    throw Error(ErrorKind::cannotWrite, file.string(), "cannot write: " + systemReason());
  }
}

bool FarmFolder::isOvertaken(const std::string& job, int number) const {
  std::error_code ignored;
  return fs::is_directory(attempt(job, number + 1), ignored);
}

bool FarmFolder::carryOver(const std::string& job, int number) const {
  const fs::path mine = attempt(job, number), part = mine / "run.part";
  std::vector<int> attempts = attemptsIn(folder_ / "jobs" / job);
  std::erase_if(attempts, [&](int other) { return other >= number; });
  bool found = false;
  for (auto other = attempts.rbegin(); other != attempts.rend() && !found; ++other) {
    const fs::path run = attempt(job, *other) / "run";
    if (!isFile(run / "checkpoint")) continue;
    makeFolder(part);
    std::error_code error;
    fs::create_hard_link(run / "checkpoint", part / "checkpoint", error);
    if (error) copyFileAtomically(run / "checkpoint", part / "checkpoint");
    if (isFile(run / kMetricsName)) copyFileAtomically(run / kMetricsName, part / kMetricsName);
    found = true;
  }
  if (found && ::rename(part.c_str(), (mine / "run").c_str()) != 0) {
    throw Error(ErrorKind::cannotWrite, part.string(), "cannot rename: " + systemReason());
  }
  std::error_code ignored;
  for (const int other : attempts) fs::remove_all(attempt(job, other) / "run", ignored);
  return found;
}

void FarmFolder::end(const std::string& job, int number, AttemptEnd end, const Failure& failure) const {
  nlohmann::ordered_json json = {{"end", name(end)}};
  json.update(jsonOf(failure));
  writeTextAtomically(attempt(job, number) / "end.json", dumpJson(json) + "\n");
}

void FarmFolder::fail(const std::string& job, const Failure& failure) const {
  writeTextAtomically(folder_ / "jobs" / job / "failed.json", dumpJson(jsonOf(failure)) + "\n");
}

bool FarmFolder::publish(const std::string& job, int number) const {
  const fs::path from = attempt(job, number) / "result", to = result(job);
  const int renamed = ::rename(from.c_str(), to.c_str());
  const int reason = errno;
  std::error_code ignored;
  const Descriptor results(::open(to.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (results.get() >= 0) (void)::fsync(results.get());  // some file systems cannot
  if (renamed == 0) return true;
  if (fs::is_directory(to, ignored)) return !fs::exists(from, ignored);  // gone: only the server's answer was lost
  requireResults();
  errno = reason;
  throw Error(ErrorKind::cannotWrite, to.string(), "cannot rename the finished result: " + systemReason());
}

void FarmFolder::sweep(const std::string& job) const {
  std::error_code ignored;
  if (!fs::is_directory(result(job), ignored)) return;
  for (const int number : attemptsIn(folder_ / "jobs" / job)) {
    for (const char* left : {"run", "run.part", "result"}) fs::remove_all(attempt(job, number) / left, ignored);
  }
}

bool BeatWatch::isDead(const std::string& job, const JobView& view, Clock::time_point now) {
  const auto [entry, fresh] = seen_.try_emplace(job);
  Seen& seen = entry->second;
  if (fresh || seen.attempt != view.attempts || seen.beat != view.beat) {
    seen = {view.attempts, view.beat, now, std::chrono::duration<double>(0)};
    return false;
  }
  seen.unchanged += std::min(std::chrono::duration<double>(now - seen.last), longest_look_);
  seen.last = now;
  return seen.unchanged >= stale_;
}

}  // namespace tg
