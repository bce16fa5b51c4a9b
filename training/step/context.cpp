// SPDX-License-Identifier: Apache-2.0
// Both models in one, the context behind; what comes back is cut where it begins.
#include "training/step/context.h"

#include <utility>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "training/step/engine.h"

namespace tg {
namespace {

class ContextRenderer final : public DifferentiableRenderer {
 public:
  ContextRenderer(std::unique_ptr<DifferentiableRenderer> renderer, GaussianModel context)
      : renderer_(std::move(renderer)), context_(std::move(context)), fitted_(context_) {
    TG_ASSERT(!isTextured(context_) && context_.atlas.rects.empty(), "a context has no textures");
  }

  using DifferentiableRenderer::forward;
  void setModel(const GaussianModel& model) override {
    join(model);
    renderer_->setModel(joined_);
  }
  std::vector<double> seenWeights(const GaussianModel& model, std::span<const Camera> views) override {
    join(model);
    std::vector<double> weights = renderer_->seenWeights(joined_, views);
    weights.resize(count_);
    return weights;
  }
  const std::vector<glm::vec3>& forward(const Camera& camera, const RenderSettings& settings) override {
    return renderer_->forward(camera, settings);
  }
  void backward(std::span<const glm::vec3> v_color, ModelGradient& gradient, const GradientOptions& options) override {
    renderer_->backward(v_color, gradient, options);
    const std::size_t k = joined_.shCount();
    forEachField([&](const Field& field, auto& values) { values.resize(count_ * field.values(k)); }, gradient);
    for (auto* values : {&gradient.screen_gradient, &gradient.screen_gradient_abs, &gradient.screen_radius}) {
      values->resize(count_);
    }
  }
  std::span<const PhaseTime> phaseTimes() const override { return renderer_->phaseTimes(); }
  std::string deviceName() const override { return renderer_->deviceName(); }

 private:
  void join(const GaussianModel& model) {
    if (fitted_.sh_degree != model.sh_degree) {
      fitted_ = context_;
      setShDegree(fitted_, model.sh_degree);
    }
    count_ = model.size();
    joined_.sh_degree = model.sh_degree;
    joined_.texture_mode = model.texture_mode;
    joined_.intersection = model.intersection;
    joined_.outside = model.outside;
    forEachField(
        [](const Field&, auto& both, const auto& first, const auto& second) {
          both.assign(first.begin(), first.end());
          both.insert(both.end(), second.begin(), second.end());
        },
        joined_, model, fitted_);
    joined_.atlas.texels.assign(model.atlas.texels.begin(), model.atlas.texels.end());
    joined_.atlas.rects.assign(model.atlas.rects.begin(), model.atlas.rects.end());
    if (!model.atlas.rects.empty()) joined_.atlas.rects.resize(joined_.size());
  }

  const std::unique_ptr<DifferentiableRenderer> renderer_;
  const GaussianModel context_;
  GaussianModel fitted_;  // the context with as many SH as the model has
  GaussianModel joined_;
  std::size_t count_ = 0;  // of the model
};

}  // namespace

std::unique_ptr<DifferentiableRenderer> withContext(std::unique_ptr<DifferentiableRenderer> renderer,
                                                    GaussianModel context) {
  return std::make_unique<ContextRenderer>(std::move(renderer), std::move(context));
}

}  // namespace tg
