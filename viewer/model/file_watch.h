// SPDX-License-Identifier: Apache-2.0
// Which of some files have been written again.
#pragma once
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <thread>

#include "core/file/identity.h"
#include "core/system/worker.h"

namespace tg {

// Looks at the files a few times a second, in a thread of its own. A file that is gone is no news, nor is one that is
// still being written.
class FileWatch {
 public:
  using Files = std::map<std::filesystem::path, FileIdentity>;

  // `wake` is called in that thread whenever there is news.
  explicit FileWatch(std::function<void()> wake);

  // These from now on, with what was read of each.
  void watch(const Files& files);
  // A file that is another one now: once for each time that it was written.
  std::optional<std::filesystem::path> take() { return changed_.poll(); }

 private:
  void run(const std::stop_token& stop);

  Files asked_;  // the other thread's
  LatestValue<Files> watched_;
  Queue<std::filesystem::path> changed_;
  std::jthread thread_;
};

}  // namespace tg
