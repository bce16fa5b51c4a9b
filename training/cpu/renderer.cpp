// SPDX-License-Identifier: Apache-2.0
// The CPU's DifferentiableRenderer: the render stages forward, then sums per (tile, splat) pair, then per Gaussian.
#include <algorithm>
#include <chrono>
#include <ctime>
#include <string>

#include "core/system/error.h"
#include "core/system/parallel.h"
#include "render/cpu/blend.h"
#include "render/cpu/project.h"
#include "render/cpu/tiles.h"
#include "training/cpu/pairs.h"
#include "training/step/gradient.h"

namespace tg {
namespace {

constexpr std::int64_t kGrain = 128;  // splats per grab

class CpuDifferentiableRenderer final : public DifferentiableRenderer {
 public:
  explicit CpuDifferentiableRenderer(std::size_t texels_in_flight) : texels_in_flight_(texels_in_flight) {}

  void setModel(const GaussianModel& model) override {
    model_ = &model;
    picture_.clear();
  }

  const std::vector<glm::vec3>& forward(const Camera& camera, const RenderSettings& settings) override {
    if (model_ == nullptr) throw Error(ErrorKind::usage, "forward", "no model (expected setModel first)");
    const GaussianModel& model = *model_;
    requireBlendingDefaults(settings, settings.outputs, "training");
    view_ = cpu::makeView(model, camera, settings);
    times_.clear();
    timed("order", [&] { cpu::findDepthOrder(view_, model, depth_order_); });
    timed("project", [&] { cpu::projectSplats(view_, model, depth_order_.gaussians, screen_); });
    timed("lists", [&] { cpu::buildTileLists(view_, screen_, depth_order_.order, true, lists_); });
    timed("blend forward",
          [&] { cpu::blendPicture(view_, screen_, lists_, model.atlas.texels.data(), picture_, record_); });
    return picture_;
  }

  void backward(std::span<const glm::vec3> v_color, ModelGradient& gradient, const GradientOptions& options) override {
    if (picture_.empty()) throw Error(ErrorKind::usage, "backward", "no forward pass (expected forward first)");
    if (v_color.size() != picture_.size()) {
      throw Error(ErrorKind::usage, "backward",
                  "wrong number of pixels (expected " + std::to_string(picture_.size()) + ", found " +
                      std::to_string(v_color.size()) + ")");
    }
    requireDifferentiable(view_.outside, "the backward pass");
    times_.erase(std::find_if(times_.begin(), times_.end(), [](const PhaseTime& t) { return t.name == kBackward; }),
                 times_.end());
    const cpu::BackwardInput input{view_, screen_, lists_, record_, model_->atlas.texels.data(), v_color, options};
    timed(kBackward, [&] {
      if (view_.textured()) gradient.texels.assign(model_->atlas.texels.size(), glm::vec4(0.0f));
      cpu::backwardPairs(input, texels_in_flight_, pairs_, [&] { gatherTexels(gradient); });
    });
    timed("finish", [&] { finish(gradient); });
  }

  std::span<const PhaseTime> phaseTimes() const override { return times_; }
  std::string deviceName() const override { return cpuName(); }

 private:
  static constexpr const char* kBackward = "blend backward";  // backward()'s first phase

  template <typename Body>
  void timed(const char* phase, const Body& body) {
    const auto wall = std::chrono::steady_clock::now();
    const std::clock_t processor = std::clock();
    body();
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - wall;
    times_.push_back({phase, elapsed.count(), 1e3 * static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC});
  }

  void finish(ModelGradient& gradient) {
    cpu::finishModel(
        view_, *model_, depth_order_.gaussians, screen_,
        [this](std::uint32_t k, cpu::SplatSums& sums) { return gather(k, sums); }, splat_of_, gradient);
  }

  // Adds the slots to the texels' gradients.
  void gatherTexels(ModelGradient& gradient) const {
    parallelFor(static_cast<std::int64_t>(screen_.splats.size()), kGrain, [&](std::int64_t k) {
      const cpu::Splat& s = screen_.splats[k];
      if (s.texture_width == 0) return;
      cpu::addSlots(pairs_.slots, lists_.pair_begin[k], lists_.pair_begin[k + 1],
                    gradient.texels.data() + s.texel_offset);
    });
  }

  // Adds up a splat's pairs. Returns whether it shows anywhere.
  bool gather(std::uint32_t k, cpu::SplatSums& sums) const {
    bool shows = false;
    const cpu::Splat& splat = screen_.splats[k];
    for (std::uint32_t pair = lists_.pair_begin[k]; pair < lists_.pair_begin[k + 1]; ++pair) {
      if (pairs_.shows[pair] == 0) continue;
      if (!shows) sums = {&splat, {}, {}, 0.0f};
      shows = true;
      cpu::addPair(pairs_, pair, splat.texture_width > 0, sums);
    }
    return shows;
  }

  std::size_t texels_in_flight_;
  const GaussianModel* model_ = nullptr;
  cpu::View view_;
  cpu::DepthOrder depth_order_;
  cpu::ScreenSplats screen_;
  cpu::TileLists lists_;
  std::vector<glm::vec3> picture_;
  cpu::BlendRecord record_;
  cpu::PairBuffers pairs_;
  std::vector<std::uint32_t> splat_of_;  // scratch
  std::vector<PhaseTime> times_;
};

}  // namespace

std::unique_ptr<DifferentiableRenderer> makeCpuDifferentiableRenderer(std::size_t texels_in_flight) {
  return std::make_unique<CpuDifferentiableRenderer>(texels_in_flight);
}

}  // namespace tg
