// SPDX-License-Identifier: Apache-2.0
// PSNR, SSIM and FLIP of the newest pair of pictures, computed beside everything else.
#pragma once
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "viewer/view/compare.h"

namespace tg {

class MetricsThread {
 public:
  // `wake` is called in the thread when there is a result.
  explicit MetricsThread(std::function<void()> wake);
  ~MetricsThread();
  MetricsThread(const MetricsThread&) = delete;
  MetricsThread& operator=(const MetricsThread&) = delete;

  // A pair that has not begun when the next comes is dropped.
  void ask(std::shared_ptr<const PicturePair> pair);

  struct Result {
    std::shared_ptr<const PicturePair> pair;
    std::optional<PictureMetrics> metrics;  // none: no pixel counts, or no memory for it
  };
  std::optional<Result> take();

 private:
  void run();

  const std::function<void()> wake_;
  std::mutex mutex_;  // guards all below but the thread
  std::condition_variable changed_;
  std::shared_ptr<const PicturePair> asked_;
  std::optional<Result> result_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace tg
