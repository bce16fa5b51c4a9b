// SPDX-License-Identifier: Apache-2.0
// A benchmark in the window: each picture of options.path as it is shown.
#pragma once
#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "viewer/picture/benchmark.h"
#include "viewer/picture/run.h"

namespace tg {

class BenchmarkRun final : public PictureRun {
 public:
  using Clock = std::chrono::steady_clock;

  // At that picture size. `started`: when the program was. Throws what shotCameras throws.
  BenchmarkRun(const ViewOptions& options, const Scene& scene, glm::ivec2 size, Clock::time_point started);

  const Camera* due() override;
  void take(const Picture& picture, const std::function<Image()>& read) override;
  std::size_t done() const override { return benchmark_.frames.size(); }
  std::size_t frames() const override { return cameras_.size(); }
  std::string finish() override;  // prints the JSON to stdout

 private:
  Benchmark benchmark_;
  std::vector<Camera> cameras_;
  const Clock::time_point started_;
  std::optional<Clock::time_point> asked_;  // when the picture that is due was asked for
  double cpu_ = 0;                          // [ms] of the process then
  bool warm_ = false;
};

}  // namespace tg
