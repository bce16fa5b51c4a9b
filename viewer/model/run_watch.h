// SPDX-License-Identifier: Apache-2.0
// --follow of a run folder: its curves, how far it is, and what it is told to do.
#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "core/run/live.h"
#include "core/run/metrics.h"
#include "core/system/worker.h"

namespace tg {

// Looks a few times a second, in a thread of its own. While this lives the run knows that it is watched, and leaves a
// newer model in its folder every second.
class RunWatch {
 public:
  struct News {
    std::shared_ptr<const std::vector<RunMetrics>> lines;  // of metrics.jsonl; never null
    std::optional<RunStatus> status;                       // none: nothing trains in the folder
    bool settled = true;                                   // false: a run that trains may not have noticed yet
  };

  // `wake` is called in that thread whenever there is news.
  RunWatch(std::filesystem::path folder, std::function<void()> wake);

  // What came since the last call.
  std::optional<News> take() { return news_.poll(); }
  // Throws Error(cannotWrite).
  void order(const RunOrder& order) const { giveOrder(folder_, order); }

 private:
  void run(const std::stop_token& stop);

  const std::filesystem::path folder_;
  LatestValue<News> news_;
  std::jthread thread_;
};

}  // namespace tg
