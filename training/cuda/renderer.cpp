// SPDX-License-Identifier: Apache-2.0
// The stages of a frame and of its gradient, one after the other.
#include "training/cuda/renderer.h"

#include <string>

#include "core/system/error.h"
#include "training/cuda/engine.h"
#include "training/cuda/frame.h"

namespace tg {
namespace {

class CudaDifferentiableRenderer final : public DifferentiableRenderer {
 public:
  CudaDifferentiableRenderer() : device_(cuda::openDevice()) {}

  void setModel(const GaussianModel& model) override {
    model_.upload(model);
    host_model_ = &model;
    picture_.clear();
  }

  const std::vector<glm::vec3>& forward(const Camera& camera, const RenderSettings& settings) override {
    if (host_model_ == nullptr) throw Error(ErrorKind::usage, "forward", "no model (expected setModel first)");
    requireBlendingDefaults(settings, settings.outputs, "training");
    const cuda::View view = cuda::makeView(*host_model_, camera, settings);
    frame_.forward(view, model_.parameters());
    outside_ = static_cast<TextureOutside>(view.outside);
    picture_.resize(static_cast<std::size_t>(view.size.x) * view.size.y);
    frame_.picture().download(picture_);
    return picture_;
  }

  void backward(std::span<const glm::vec3> v_color, ModelGradient& gradient, const GradientOptions& options) override {
    if (picture_.empty()) throw Error(ErrorKind::usage, "backward", "no forward pass (expected forward first)");
    if (v_color.size() != picture_.size()) {
      throw Error(ErrorKind::usage, "backward",
                  "wrong number of pixels (expected " + std::to_string(picture_.size()) + ", found " +
                      std::to_string(v_color.size()) + ")");
    }
    requireDifferentiable(outside_, "the backward pass");
    v_picture_.upload(v_color);
    gradient_.resizeLike(model_);
    frame_.backward(v_picture_.data(), options, model_.parameters(), gradient_.parameters());
    gradient_.download(gradient);
    const std::size_t n = model_.parameters().count;
    gradient.screen_gradient.resize(n);
    gradient.screen_gradient_abs.resize(n);
    gradient.screen_radius.resize(n);
    frame_.screenGradient().download(gradient.screen_gradient);
    frame_.screenGradientAbs().download(gradient.screen_gradient_abs);
    frame_.screenRadius().download(gradient.screen_radius);
  }

  std::span<const PhaseTime> phaseTimes() const override { return {}; }
  std::string deviceName() const override { return device_; }
  std::unique_ptr<TrainingEngine> makeTrainingEngine(float ssim_weight) override {
    return cuda::makeTrainingEngine(ssim_weight);
  }

 private:
  std::string device_;
  const GaussianModel* host_model_ = nullptr;
  cuda::DeviceModel model_;
  cuda::DeviceModel gradient_;
  cuda::Frame frame_;
  cuda::Buffer<float> v_picture_;
  std::vector<glm::vec3> picture_;
  TextureOutside outside_ = TextureOutside::base;  // of it
};

}  // namespace

std::unique_ptr<DifferentiableRenderer> makeCudaDifferentiableRenderer() {
  return std::make_unique<CudaDifferentiableRenderer>();
}

}  // namespace tg
