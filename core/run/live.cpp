// SPDX-License-Identifier: Apache-2.0
// Small files and a lock.
#include "core/run/live.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/run/metrics_json.h"
#include "core/system/error.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

constexpr int kMostSteps = 1'000'000;

}  // namespace

std::string formatSeconds(double seconds) {
  constexpr double kMost = 1e12;  // no long is too short for it
  const long whole = std::isfinite(seconds) ? std::lround(std::clamp(seconds, 0.0, kMost)) : 0;
  if (whole < 60) return formatted("%ld s", whole);
  if (whole < 3600) return formatted("%ld min %02ld s", whole / 60, whole % 60);
  return formatted("%ld h %02ld min", whole / 3600, whole % 3600 / 60);
}

std::string formatStatus(const RunStatus& status) {
  nlohmann::ordered_json json = {
      {"format", "tgtrain-live"}, {"version", 1}, {"phase", name(status.phase)}, {"name", status.name}};
  addMetrics(json, status.now);
  return dumpJson(json) + "\n";
}

std::optional<RunStatus> parseStatus(std::string_view text) {
  try {
    const nlohmann::json json = parseJson(text, std::string(kLiveStatusName));
    std::optional<RunMetrics> now = metricsIn(json);
    const JsonNode node{json, "", ""};
    const std::optional<RunPhase> phase = parse<RunPhase>(node.string("phase"));
    if (!now || !phase || node.string("format") != "tgtrain-live") return std::nullopt;
    return RunStatus{*phase, node.string("name"), std::move(*now)};
  } catch (const Error&) {
    return std::nullopt;
  }
}

std::string describe(const RunStatus& status) {
  const RunMetrics& now = status.now;
  const bool ended = status.phase == RunPhase::finished || status.phase == RunPhase::interrupted;
  std::string text(name(status.phase));
  if (status.phase != RunPhase::finished) {
    text += (status.phase == RunPhase::interrupted ? " at " : ": ") + now.stage + " " + std::to_string(now.iteration) +
            " / " + std::to_string(now.iterations);
  }
  if (!ended && now.train_psnr) text += formatted(", %.2f dB", *now.train_psnr);
  if (ended && now.test_psnr) text += formatted(", %.2f dB held out", *now.test_psnr);
  if (!ended && now.seconds_left) text += ", " + formatSeconds(*now.seconds_left) + " left";
  return text;
}

std::string formatOrder(const RunOrder& order) {
  std::string text(name(order.command));
  if (order.command == RunCommand::step) text += " " + std::to_string(order.steps);
  return text + "\n";
}

std::optional<RunOrder> parseOrder(std::string_view text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r' || text.back() == ' ')) text.remove_suffix(1);
  const std::size_t space = text.find(' ');
  const std::optional<RunCommand> command = parse<RunCommand>(text.substr(0, space));
  if (!command) return std::nullopt;
  if (space == std::string_view::npos) return RunOrder{*command, 1};
  const std::optional<int> steps = parseWhole<int>(text.substr(space + 1));
  if (*command != RunCommand::step || !steps || *steps < 1 || *steps > kMostSteps) return std::nullopt;
  return RunOrder{*command, *steps};
}

void giveOrder(const std::filesystem::path& folder, const RunOrder& order) {
  writeTextAtomically(folder / kControlName, formatOrder(order));
}

WatchLock::WatchLock(const std::filesystem::path& folder) {
  descriptor_ = ::open((folder / kMetricsName).c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor_ < 0) return;
  if (::flock(descriptor_, LOCK_SH | LOCK_NB) == 0) return;
  ::close(descriptor_);
  descriptor_ = -1;
}

WatchLock::~WatchLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

bool WatchLock::holds(const std::filesystem::path& folder) const {
  struct stat own{}, there{};
  return descriptor_ >= 0 && ::fstat(descriptor_, &own) == 0 && ::stat((folder / kMetricsName).c_str(), &there) == 0 &&
         own.st_dev == there.st_dev && own.st_ino == there.st_ino;
}

bool isWatched(int descriptor) {
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) return errno == EWOULDBLOCK;
  ::flock(descriptor, LOCK_UN);
  return false;
}

}  // namespace tg
