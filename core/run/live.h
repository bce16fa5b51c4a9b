// SPDX-License-Identifier: Apache-2.0
// What a run that is watched leaves in its folder beside the checkpoint, and what it is told there (docs/training.md).
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/run/metrics.h"
#include "core/system/names.h"

namespace tg {

enum class RunPhase { training, scoring, paused, finished, interrupted };
constexpr auto namesOf(RunPhase) { return enumNames("training", "scoring", "paused", "finished", "interrupted"); }

// live.json, and what the page in a browser gets.
struct RunStatus {
  RunPhase phase = RunPhase::training;
  std::string name;  // of the data set
  RunMetrics now;    // test scores: the newest there are
};
std::string formatStatus(const RunStatus& status);
// None for what is no such object.
std::optional<RunStatus> parseStatus(std::string_view text);
// "finished, 30.55 dB held out", "paused: plain 1200 / 7000, 24.31 dB, 3 min 05 s left".
std::string describe(const RunStatus& status);

// "12 s", "3 min 05 s", "2 h 07 min"
std::string formatSeconds(double seconds);

// In a run's folder.
inline constexpr std::string_view kMetricsName = "metrics.jsonl";
inline constexpr std::string_view kLiveModelName = "live.tgz";
inline constexpr std::string_view kLiveStatusName = "live.json";
inline constexpr std::string_view kControlName = "control";

// What a run is told by its file `control`: one of the words, `step` with a number of iterations behind it or none.
enum class RunCommand { pause, go, step, stop };
constexpr auto namesOf(RunCommand) { return enumNames("pause", "go", "step", "stop"); }
struct RunOrder {
  RunCommand command = RunCommand::go;
  int steps = 1;  // of RunCommand::step
};
std::string formatOrder(const RunOrder& order);  // with the end of the line
std::optional<RunOrder> parseOrder(std::string_view text);
// Into `folder`; the run takes it away when it obeys. Throws Error(cannotWrite).
void giveOrder(const std::filesystem::path& folder, const RunOrder& order);

// Somebody watches a run: holds a shared lock (flock) on its metrics.jsonl while this lives. Where the file is missing
// or the run is just looking (isWatched), nothing is held: try again.
class WatchLock {
 public:
  explicit WatchLock(const std::filesystem::path& folder);
  ~WatchLock();
  WatchLock& operator=(WatchLock&&) = delete;
  // Whether it is held, and on the file that is there now.
  bool holds(const std::filesystem::path& folder) const;

 private:
  int descriptor_ = -1;
};
// Whether somebody else holds one; `descriptor` is of metrics.jsonl.
bool isWatched(int descriptor);

}  // namespace tg
