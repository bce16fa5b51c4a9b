// SPDX-License-Identifier: Apache-2.0
// PSNR, SSIM and FLIP of the newest picture and what it is compared with, computed beside everything else.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "core/system/worker.h"
#include "viewer/picture/picture.h"

namespace tg {

// Of a photograph as it is measured: the camera that took it. One of more than kMostMeasured pixels is made so many
// times smaller that it has no more: FLIP takes a second for a million.
Camera measuredCamera(const Camera& taken);
constexpr int kMostMeasured = 1 << 22;

class MetricsThread {
 public:
  // `wake` is called in the thread when there is a result.
  explicit MetricsThread(std::function<void()> wake);

  // Two models' pictures are measured as they are shown. A photograph is measured as it was taken, whatever part of it
  // the view shows and however large: the CPU draws the model once more for it, without exposure. hasFigures(picture).
  // What has not begun when the next comes is dropped. Returns its number, higher than all before.
  std::uint64_t ask(const Picture& picture);

  struct Result {
    std::uint64_t number = 0;
    std::optional<PictureMetrics> metrics;  // none: no pixel counts, or no memory for it
  };
  std::optional<Result> take() { return results_.poll(); }

 private:
  struct Asked {
    std::uint64_t number = 0;
    std::shared_ptr<const PicturePair> pair;  // null: of the request and the photograph
    PictureRequest request;
    std::shared_ptr<const Image> photograph;
  };
  static std::optional<PictureMetrics> measure(const Asked& asked);

  std::uint64_t number_ = 0;
  LatestValue<Asked> asked_;
  LatestValue<Result> results_;
  std::jthread thread_;
};

}  // namespace tg
