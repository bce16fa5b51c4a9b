// SPDX-License-Identifier: Apache-2.0
// Two small files, looked at again and again.
#include "viewer/model/run_watch.h"

#include <chrono>
#include <string>
#include <utility>

#include "core/file/file.h"
#include "core/run/curves.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::chrono::milliseconds kPause(300);
constexpr int kUnsettledLooks = 7;              // a run looks for watchers after each step
constexpr std::uint64_t kMaxStatus = 64 << 10;  // [bytes]

std::string textOf(const std::filesystem::path& file) {
  if (!isFile(file)) return "";
  try {
    const std::vector<std::uint8_t> bytes = readRegularFile(file, kMaxStatus);
    return {bytes.begin(), bytes.end()};
  } catch (const Error&) {
    return "";
  }
}

}  // namespace

RunWatch::RunWatch(std::filesystem::path folder, std::function<void()> wake)
    : folder_(std::move(folder)),
      news_(std::move(wake)),
      thread_(startWorker(news_, [this](const std::stop_token& stop) { run(stop); })) {}

void RunWatch::run(const std::stop_token& stop) {
  MetricsFile metrics(folder_ / kMetricsName);
  auto lines = std::make_shared<const std::vector<RunMetrics>>();
  std::string shown = "none yet";
  std::unique_ptr<WatchLock> lock;
  int looks = 0;
  do {
    if (!lock || !lock->holds(folder_)) lock = std::make_unique<WatchLock>(folder_);
    const bool more = metrics.update();
    if (more) lines = std::make_shared<const std::vector<RunMetrics>>(metrics.lines());
    const std::string text = textOf(folder_ / kLiveStatusName);
    const bool settled = ++looks == kUnsettledLooks;
    if (!more && text == shown && !settled) continue;
    shown = text;
    news_.give({lines, parseStatus(text), looks >= kUnsettledLooks});
  } while (sleepUnlessStopped(stop, kPause));
}

}  // namespace tg
