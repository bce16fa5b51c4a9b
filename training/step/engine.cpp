// SPDX-License-Identifier: Apache-2.0
// The host's engine: everything in place.
#include "training/step/engine.h"

#include <cmath>
#include <utility>

#include "render/contribution.h"
#include "training/step/update.h"

namespace tg {
namespace {

class HostTrainingEngine final : public TrainingEngine {
 public:
  HostTrainingEngine(DifferentiableRenderer& renderer, float ssim_weight) : renderer_(renderer), loss_(ssim_weight) {}

  bool sharesTextures() const override { return true; }
  void step(RunState& state, const StepInput& input) override {
    TrainingState& training = state.training;
    {
      const DrawnModel drawn(training.model, effective_, state.min_sigma);
      RenderSettings render;
      render.background = input.background;
      const std::vector<glm::vec3>& picture = renderer_.forward(training.model, input.camera, render);
      v_picture_.resize(picture.size());
      losses_.push_back(loss_.evaluate(input.camera.size.x, input.camera.size.y, picture, input.photograph->rgb,
                                       v_picture_, input.photograph->mask));
      if (!std::isfinite(losses_.back().total)) return;
      renderer_.backward(v_picture_, gradient_, input.gradient);
    }
    updateParameters(training, state.min_sigma, state.statistics, input, {0, training.model.size()}, gradient_);
  }
  std::vector<LossValue> losses(RunState&, bool) override { return std::exchange(losses_, {}); }
  DensifyResult densify(RunState& state, const DensifySettings& settings) override {
    return tg::densify(state.training, state.statistics, settings, state.densify_random);
  }
  McmcResult relocateAndGrow(RunState& state, const McmcSettings& settings) override {
    const McmcResult result = tg::relocateAndGrow(state.training, settings, state.densify_random);
    state.statistics.reset(state.training.model.size());
    return result;
  }
  void resetOpacity(RunState& state) override { tg::resetOpacity(state.training); }
  void growShDegree(RunState& state, int degree) override { tg::growShDegree(state.training, degree); }
  void updateFilter(RunState& state, std::span<const Pinhole> cameras) override {
    state.min_sigma = minSigmas(cameras, state.training.model);
  }
  std::size_t gaussians(const RunState& state) const override { return state.training.model.size(); }
  const std::vector<glm::vec3>& picture(RunState& state, const Camera& camera, glm::vec3 background) override {
    const DrawnModel drawn(state.training.model, effective_, state.min_sigma);
    RenderSettings render;
    render.background = background;
    return renderer_.forward(state.training.model, camera, render);
  }
  void pull(RunState&) override {}
  void stateChanged() override {}

 private:
  DifferentiableRenderer& renderer_;
  PhotometricLoss loss_;
  EffectiveParameters effective_;
  ModelGradient gradient_;
  std::vector<glm::vec3> v_picture_;
  std::vector<LossValue> losses_;
};

}  // namespace

std::unique_ptr<TrainingEngine> makeHostTrainingEngine(DifferentiableRenderer& renderer, float ssim_weight) {
  return std::make_unique<HostTrainingEngine>(renderer, ssim_weight);
}

std::vector<double> DifferentiableRenderer::seenWeights(const GaussianModel& model, std::span<const Camera> views) {
  return blendWeights(model, views);
}

std::unique_ptr<TrainingEngine> DifferentiableRenderer::makeTrainingEngine(float ssim_weight) {
  return makeHostTrainingEngine(*this, ssim_weight);
}

}  // namespace tg
