// SPDX-License-Identifier: Apache-2.0
// The part of a run's folder that is there while somebody watches: live.json, live.tgz and the orders in `control`.
#pragma once
#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "core/bundle/bundle.h"
#include "core/run/live.h"
#include "core/system/worker.h"

namespace tg {

// All members cost next to nothing: files are looked for a few times a second, and the model is written by a thread
// that gives way to the training.
class LiveFolder {
 public:
  // `metrics`: descriptor of the run's metrics.jsonl. Both outlive this.
  LiveFolder(std::filesystem::path folder, int metrics);
  ~LiveFolder();  // its files are gone then
  LiveFolder& operator=(LiveFolder&&) = delete;

  // Looks at lock and orders; what the others say is of that moment.
  void look();
  bool watched() const { return watched_; }
  // None, or what was ordered. What is no order is named on stderr.
  std::optional<RunOrder> takeOrder();
  // A newer model may be written: once a second, but so that it takes a thirtieth of the time at most.
  bool wantsModel() const;

  void show(const RunStatus& status);
  // `cost` [s]: what making it has taken already.
  void show(std::shared_ptr<const Bundle> model, double cost);

 private:
  struct Task {
    std::shared_ptr<const Bundle> model;
    double cost = 0;
  };
  void write(const std::stop_token& stop);

  const std::filesystem::path folder_;
  const int metrics_;
  bool watched_ = false;
  std::optional<RunOrder> order_;
  std::string shown_;  // live.json
  std::atomic<bool> busy_{false};
  std::atomic<std::int64_t> next_{0};  // [ns]
  LatestValue<Task> tasks_;
  std::jthread thread_;
};

}  // namespace tg
