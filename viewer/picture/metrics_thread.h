// SPDX-License-Identifier: Apache-2.0
// PSNR, SSIM and FLIP of the newest pair of pictures, computed beside everything else.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "core/system/worker.h"
#include "viewer/view/compare.h"

namespace tg {

class MetricsThread {
 public:
  // `wake` is called in the thread when there is a result.
  explicit MetricsThread(std::function<void()> wake);

  // A pair that has not begun when the next comes is dropped.
  void ask(std::shared_ptr<const PicturePair> pair);

  struct Result {
    std::shared_ptr<const PicturePair> pair;
    std::optional<PictureMetrics> metrics;  // none: no pixel counts, or no memory for it
  };
  std::optional<Result> take() { return results_.poll(); }

 private:
  LatestValue<std::shared_ptr<const PicturePair>> asked_;
  LatestValue<Result> results_;
  std::jthread thread_;
};

}  // namespace tg
