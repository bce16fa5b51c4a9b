// SPDX-License-Identifier: Apache-2.0
// The CPU backend behind Renderer: the stages in order, timed.
#include <hwy/targets.h>

#include <chrono>

#include "core/error.h"
#include "core/parallel.h"
#include "render/cpu/blend.h"
#include "render/cpu/project.h"
#include "render/cpu/tiles.h"
#include "render/renderer.h"

namespace tg {
namespace {

class CpuRenderer final : public Renderer {
 public:
  void setModel(const GaussianModel& model) override {
    model_ = model;
    has_model_ = true;
  }

  Frame render(const Camera& camera, const RenderSettings& settings) override {
    if (!has_model_) throw Error(ErrorKind::usage, "render", "no model set (expected setModel before render)");
    const cpu::View view = cpu::makeView(model_, camera, settings);
    Frame frame(camera.width, camera.height);
    times_.clear();
    timed("sort", [&] { cpu::findDepthOrder(view, model_, depth_order_); });
    timed("project", [&] { cpu::projectSplats(view, model_, depth_order_.gaussians, screen_); });
    timed("tiles", [&] { cpu::buildTileLists(view, screen_, depth_order_.order, false, lists_); });
    timed("blend", [&] { cpu::blendFrame(view, screen_, lists_, model_.atlas.texels.data(), frame); });
    return frame;
  }

  std::vector<PassTime> passTimes() const override { return times_; }

  std::string deviceName() const override {
    const std::int64_t best = hwy::SupportedTargets() & -hwy::SupportedTargets();  // lower bits are better targets
    return std::string("CPU, ") + hwy::TargetName(best) + ", " + std::to_string(threadCount()) + " threads";
  }

 private:
  template <typename Body>
  void timed(const char* name, const Body& body) {
    const auto start = std::chrono::steady_clock::now();
    body();
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - start;
    times_.push_back({name, elapsed.count()});
  }

  GaussianModel model_;
  bool has_model_ = false;
  cpu::DepthOrder depth_order_;
  cpu::ScreenSplats screen_;
  cpu::TileLists lists_;
  std::vector<PassTime> times_;
};

}  // namespace

std::unique_ptr<Renderer> makeCpuRenderer() { return std::make_unique<CpuRenderer>(); }

}  // namespace tg
