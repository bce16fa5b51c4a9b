// SPDX-License-Identifier: Apache-2.0
// The CUDA engine runs ahead of what it knows: steps that had no room are done again, divergence is found later, and
// nothing else is read back meanwhile.
#include "training/step/engine.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/catch.h"
#include "support/cuda_orders.h"
#include "training/cuda/engine.h"
#include "training/cuda/memory.h"
#include "training/cuda/renderer.h"
#include "training/run/init.h"
#include "training/sample_dataset.h"

using namespace tg;

namespace {

class Run {
 public:
  explicit Run(cuda::StepParts parts = {})
      : dataset_(
            test::sampleDataset({.size = 24, .train_views = 2, .test_views = 0, .points = 400, .supersampling = 1})),
        engine_(cuda::makeTrainingEngine(0.2f, parts)) {
    state_.training.model = gaussiansFromPoints(dataset_.points);
    for (glm::vec3& log_scale : state_.training.model.log_scale) log_scale += 2.0f;
    resetMoments(state_.training);
    state_.statistics.reset(state_.training.model.size());
    near_ = far_ = dataset_.views[0];
    far_.translation.z += 100;
  }

  // Far away every splat lies in one tile, near in several.
  void step(bool near, float background = 0.0f, bool varies = false) {
    const auto photograph = std::make_shared<const ViewPixels>(*dataset_.pixels(0));
    photographs_.push_back(photograph);
    StepInput input{{.view = 0,
                     .background = glm::vec3(background),
                     .background_varies = varies,
                     .iteration = ++iteration_,
                     .gradient = {},
                     .gather_statistics = true,
                     .rates = {.mean = 1e-3f},
                     .mcmc = true,
                     .opacity_weight = 0.01f,
                     .scale_weight = 0.01f,
                     .noise = 0.1f,
                     .noise_seed = 3,
                     .clamp_colors = false},
                    near ? near_ : far_,
                    photograph};
    engine_->step(state_, input);
  }
  // How many photographs of steps the engine has in the host's memory.
  std::ptrdiff_t held() const {
    return std::ranges::count_if(photographs_, [](const auto& photograph) { return !photograph.expired(); });
  }
  std::vector<LossValue> losses(bool wait) { return engine_->losses(state_, wait); }
  const RunState& state() {
    engine_->pull(state_);
    return state_;
  }

 private:
  Dataset dataset_;
  Camera near_, far_;
  std::unique_ptr<DifferentiableRenderer> renderer_ = makeCudaDifferentiableRenderer();  // opens the device
  std::unique_ptr<TrainingEngine> engine_;
  std::vector<std::weak_ptr<const ViewPixels>> photographs_;
  RunState state_;
  int iteration_ = 0;
};

void checkSame(const RunState& a, const RunState& b) {
  CHECK(a.training.model.mean == b.training.model.mean);
  CHECK(a.training.model.sh == b.training.model.sh);
  CHECK(a.training.moments.log_scale.first == b.training.moments.log_scale.first);
  CHECK(a.training.moments.opacity_logit.second == b.training.moments.opacity_logit.second);
  CHECK(a.training.step == b.training.step);
  CHECK(a.statistics.score_sum == b.statistics.score_sum);
  CHECK(a.statistics.view_count == b.statistics.view_count);
}

}  // namespace

TEST_CASE("CUDA's steps whose pairs had no room are done again, to the same bytes") {
  Run ahead, careful;
  std::vector<double> found, expected;
  const bool steps[] = {false, false, false, true, false, true};
  for (const bool near : steps) {
    careful.step(near);
    for (const LossValue& loss : careful.losses(true)) expected.push_back(loss.total);
  }
#ifndef TG_CUDA_ON_DEVICE
  const std::size_t launches = cuda::launchCount();
#endif
  for (const bool near : steps) ahead.step(near);
  for (const LossValue& loss : ahead.losses(false)) found.push_back(loss.total);
  CHECK(found.size() == 1);  // the first step is waited for
#ifndef TG_CUDA_ON_DEVICE
  const std::size_t without = cuda::launchCount() - launches;
  for (const LossValue& loss : ahead.losses(true)) found.push_back(loss.total);
  CHECK(cuda::launchCount() - launches > without + without / 3);  // three of six again
#else
  for (const LossValue& loss : ahead.losses(true)) found.push_back(loss.total);
#endif
  CHECK(found == expected);
  CHECK(found.size() == 6);
  CHECK(ahead.state().training.step == 6);
  checkSame(ahead.state(), careful.state());
}

TEST_CASE("after a loss that is not finite, CUDA's later steps change nothing") {
  Run diverging, stopped;
  for (int k = 0; k < 2; ++k) {
    diverging.step(true);
    stopped.step(true);
  }
  diverging.step(true, std::numeric_limits<float>::quiet_NaN());
  diverging.step(true);
  const std::vector<LossValue> losses = diverging.losses(true);
  REQUIRE(losses.size() == 3);
  CHECK(std::isfinite(losses[1].total));
  CHECK_FALSE(std::isfinite(losses[2].total));
  checkSame(diverging.state(), stopped.state());
}

TEST_CASE("CUDA's steps read nothing back but 40 bytes each, every 32 steps") {
  Run run;
  run.step(true);
  run.step(true);
  run.losses(true);
  const std::size_t before = cuda::bytesToHost();
  for (int k = 0; k < 31; ++k) run.step(k % 2 == 0);
  CHECK(cuda::bytesToHost() == before);
  CHECK(run.losses(false).empty());
  run.step(true);
  CHECK(cuda::bytesToHost() == before + 32 * 40);
  CHECK(run.losses(false).size() == 32);
}

TEST_CASE("CUDA's steps hold no photograph that stays on the device, and others up to a limit") {
  constexpr std::size_t kPhotograph = 3 * 24 * 24;  // [bytes]
  Run kept, bounded({.photographs = 4 * kPhotograph}), whole;
  std::ptrdiff_t most = 0;
  for (int k = 0; k < 20; ++k) {
    const bool near = k % 7 == 6;  // these have no room at first, and are done again
    kept.step(near);
    CHECK(kept.held() == 0);
    bounded.step(near, 0.0f, true);
    whole.step(near, 0.0f, true);
    most = std::max(most, bounded.held());
  }
  CHECK(most == 3);
  CHECK(whole.held() == 19);
  CHECK(whole.losses(true).size() == 20);
  CHECK(whole.held() == 0);
  checkSame(bounded.state(), whole.state());
  checkSame(kept.state(), whole.state());
}
