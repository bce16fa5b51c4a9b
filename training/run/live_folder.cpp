// SPDX-License-Identifier: Apache-2.0
// Files that nobody needs after a crash: none is synced.
#include "training/run/live_folder.h"

#include <algorithm>
#include <cstdio>
#include <span>
#include <utility>

#include "core/bundle/quick_bundle.h"
#include "core/file/file.h"
#include "core/file/quick_file.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/system/serial_loops.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr double kLivePause = 0.9;                      // [s] between two models at least
constexpr double kLiveShare = 1.0 / 30;                 // of the time for them
constexpr std::uint64_t kMaxOrder = 64;                 // [bytes]
constexpr std::string_view kTakenName = ".tg-control";  // while it is read; RunFolder removes such names at its start

std::int64_t nanoseconds() { return std::chrono::steady_clock::now().time_since_epoch().count(); }

}  // namespace

LiveFolder::LiveFolder(fs::path folder, int metrics)
    : folder_(std::move(folder)),
      metrics_(metrics),
      thread_(startWorker(tasks_, [this](const std::stop_token& stop) { write(stop); })) {}

LiveFolder::~LiveFolder() {
  thread_.request_stop();
  thread_.join();
  std::error_code ignored;
  for (const std::string_view name : {kLiveModelName, kLiveStatusName, kControlName, kTakenName}) {
    fs::remove(folder_ / name, ignored);
  }
}

void LiveFolder::look() {
  watched_ = isWatched(metrics_);
  const fs::path file = folder_ / kControlName, taken = folder_ / kTakenName;
  std::error_code error;
  const bool waited = isFile(taken);
  if (!waited) {
    if (!isFile(file)) return;
    // Under a name of our own: another one that comes meanwhile is not removed with it.
    fs::rename(file, taken, error);
    if (error) return;
  }
  try {
    std::string text = "\n";
    if (fs::file_size(taken, error) <= kMaxOrder) {
      const std::vector<std::uint8_t> bytes = readRegularFile(taken, kMaxOrder);
      text.assign(bytes.begin(), bytes.end());
    }
    const bool whole = text.ends_with('\n');
    if (!whole && !waited) return;  // it may be still being written
    if (!whole) throw Error(ErrorKind::badData, file.string(), "is no whole line (expected its end after the order)");
    order_ = parseOrder(text);
    if (!order_) throw Error(ErrorKind::badData, file.string(), "is no order (expected pause, go, step N or stop)");
  } catch (const Error& failure) {
    std::fprintf(stderr, "tgtrain: %s\n", failure.what());
  }
  fs::remove(taken, error);
}

std::optional<RunOrder> LiveFolder::takeOrder() { return std::exchange(order_, std::nullopt); }

bool LiveFolder::wantsModel() const { return watched_ && !busy_ && nanoseconds() >= next_; }

void LiveFolder::show(const RunStatus& status) {
  std::string text = formatStatus(status);
  if (text == shown_) return;
  try {
    writeFileQuickly(folder_ / kLiveStatusName, [&](const fs::path& temporary) {
      FileWriter(temporary, folder_ / kLiveStatusName)
          .write(0, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
    });
    shown_ = std::move(text);
  } catch (const Error&) {  // the checkpoint says it
  }
}

void LiveFolder::show(std::shared_ptr<const Bundle> model, double cost) {
  busy_ = true;
  tasks_.give({std::move(model), cost});
}

void LiveFolder::write(const std::stop_token& stop) {
  runInBackground();
  const SerialLoops alone;
  while (const std::optional<Task> task = tasks_.take(stop)) {
    const double start = threadSeconds();
    try {
      writeBundleQuickly(folder_ / kLiveModelName, *task->model);
    } catch (const std::exception&) {  // as above
    }
    // What another thread does takes its share of the training's threads.
    const double cost = task->cost + (threadSeconds() - start) / threadCount();
    next_ = nanoseconds() + static_cast<std::int64_t>(std::max(kLivePause, cost / kLiveShare) * 1e9);
    busy_ = false;
  }
}

}  // namespace tg
