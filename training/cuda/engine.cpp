// SPDX-License-Identifier: Apache-2.0
// An iteration copies 28 bytes back: the number of pairs and the loss. A whole state travels where the trainer starts a
// stage, or looks at it.
#include "training/cuda/engine.h"

#include <algorithm>
#include <unordered_map>

#include "training/cuda/density.h"
#include "training/cuda/frame.h"
#include "training/cuda/state.h"
#include "training/cuda/step.h"

namespace tg::cuda {
namespace {

struct DevicePhotograph {
  Buffer<std::uint8_t> rgb, mask;
  double counted = 0;
};
DevicePhotograph upload(const ViewPixels& photograph) {
  DevicePhotograph result;
  const auto ignored = std::count(photograph.mask.begin(), photograph.mask.end(), 0);
  const std::size_t pixels = photograph.rgb.size() / 3 - static_cast<std::size_t>(ignored);
  result.counted = static_cast<double>(3 * std::max<std::size_t>(pixels, 1));
  result.rgb.upload(photograph.rgb);
  if (ignored > 0) result.mask.upload(photograph.mask);
  return result;
}

class CudaTrainingEngine final : public TrainingEngine {
 public:
  explicit CudaTrainingEngine(float ssim_weight) : ssim_weight_(ssim_weight) {}

  LossValue step(RunState& state, const StepInput& input) override {
    DeviceState& device = changing(state);
    const bool filtered = device.min_sigma.size() > 0;
    const Parameters stored = device.model.parameters();
    const Parameters drawn = forward(state, input.camera, input.background);

    const DevicePhotograph& photograph = photographOf(input);
    v_picture_.resize(frame_.picture().size());
    evaluateLoss({input.camera.width, input.camera.height, ssim_weight_, photograph.counted, frame_.picture().data(),
                  photograph.rgb.data(), photograph.mask.data()},
                 loss_, v_picture_.data());

    device.gradient.resizeLike(device.model);
    const Parameters gradient = device.gradient.parameters();
    frame_.backward(v_picture_.data(), input.gradient, drawn, gradient);
    const auto count = static_cast<double>(stored.count);
    chainGradients({stored, filtered ? device.min_sigma.data() : nullptr, input.mcmc, input.opacity_weight / count,
                    input.scale_weight / count},
                   gradient);
    if (input.gather_statistics) {
      addStatistics(frame_.screenGradient().data(), frame_.screenGradientAbs().data(), frame_.screenRadius().data(),
                    stored.count, device.statistics);
    }
    update(state.training.model, stored, gradient, input);
    return readLoss(photograph.counted);
  }

  DensifyResult densify(RunState& state, const DensifySettings& settings) override {
    return cuda::densify(changing(state), settings, state.densify_random, density_);
  }
  McmcResult relocateAndGrow(RunState& state, const McmcSettings& settings) override {
    return cuda::relocateAndGrow(changing(state), settings, state.densify_random, density_);
  }
  void resetOpacity(RunState& state) override { cuda::resetOpacity(changing(state)); }
  void growShDegree(RunState& state, int degree) override {
    cuda::growShDegree(changing(state), degree);
    state.training.model.sh_degree = degree;
  }
  void updateFilter(RunState& state, std::span<const FilterCamera> cameras) override {
    if (cameras_.size() == 0) cameras_.upload(cameras);
    cuda::updateFilter(changing(state), cameras_, density_);
  }

  const std::vector<glm::vec3>& picture(RunState& state, const Camera& camera, glm::vec3 background) override {
    if (!holds_) upload(state, device_);
    holds_ = true;
    forward(state, camera, background);
    host_picture_.resize(frame_.picture().size() / 3);
    frame_.picture().download(host_picture_);
    return host_picture_;
  }

  std::size_t gaussians(const RunState& state) const override {
    return holds_ ? device_.model.count : state.training.model.size();
  }
  void pull(RunState& state) override {
    if (ahead_) download(device_, state);
    ahead_ = false;
  }
  void stateChanged() override { holds_ = false; }

 private:
  DeviceState& changing(const RunState& state) {
    if (!holds_) upload(state, device_);
    holds_ = ahead_ = true;
    return device_;
  }

  // Leaves the picture in frame_; returns what it was drawn of, the 3D filter applied.
  Parameters forward(const RunState& state, const Camera& camera, glm::vec3 background) {
    const Parameters stored = device_.model.parameters();
    Parameters drawn = stored;
    if (device_.min_sigma.size() > 0) {
      effective_log_scale_.resize(3 * stored.count);
      effective_opacity_logit_.resize(stored.count);
      drawn.log_scale = effective_log_scale_.data();
      drawn.opacity_logit = effective_opacity_logit_.data();
      applyFilter(stored, device_.min_sigma.data(), drawn.log_scale, drawn.opacity_logit);
    }
    RenderSettings render;
    render.background = background;
    frame_.forward(makeView(state.training.model, camera, render), drawn);
    return drawn;
  }

  // Photographs stay on the device while a quarter of its memory is free.
  const DevicePhotograph& photographOf(const StepInput& input) {
    const auto found = photographs_.find(input.view);
    if (found != photographs_.end()) return found->second;
    const DeviceMemory memory = deviceMemory();
    if (!input.background_varies && memory.free > memory.total / 4 + input.photograph.rgb.size() * 2) {
      return photographs_.emplace(input.view, upload(input.photograph)).first->second;
    }
    passing_ = upload(input.photograph);
    return passing_;
  }

  void update(const GaussianModel& model, const Parameters& stored, const Parameters& gradient,
              const StepInput& input) {
    const LearningRates& rates = input.rates;
    const AdamScales scales = adamScales(++device_.step);
    const StateMoments& moments = device_.moments;
    const auto uniform = [&](float* value, const float* v_value, const DeviceMoments& of, float rate) {
      cuda::adamStep({value, v_value, of, of.first.size(), 1, 0, 0, rate, scales});
    };
    uniform(stored.mean, gradient.mean, moments.mean, rates.mean);
    uniform(stored.rotation, gradient.rotation, moments.rotation, rates.rotation);
    uniform(stored.log_scale, gradient.log_scale, moments.log_scale, rates.log_scale);
    uniform(stored.opacity_logit, gradient.opacity_logit, moments.opacity_logit, rates.opacity_logit);
    cuda::adamStep({stored.sh, gradient.sh, moments.sh, moments.sh.first.size(),
                    3 * static_cast<unsigned>(stored.sh_count), 3, rates.sh_dc, rates.sh_rest, scales});
    if (model.texture_mode != TextureMode::none) {
      uniform(stored.texels, gradient.texels, moments.texels, rates.texels);
      clampTexels(stored.texels, stored.texel_count, input.clamp_colors);
    }
    if (input.mcmc) addNoise(stored, input.noise, input.noise_seed, input.iteration);
  }

  LossValue readLoss(double counted) const {
    double sums[3];
    copyToHost(sums, loss_.sums.data(), sizeof(sums));
    LossValue loss;
    loss.l1 = sums[0] / counted;
    loss.ssim = sums[1] / counted;
    loss.mean_squared_error = sums[2] / counted;
    loss.total = (1 - ssim_weight_) * loss.l1 + ssim_weight_ * (1 - loss.ssim);
    return loss;
  }

  const float ssim_weight_;
  bool holds_ = false;  // the device has the state
  bool ahead_ = false;  // and has moved on from it
  DeviceState device_;
  DensityScratch density_;
  Buffer<FilterCamera> cameras_;
  Buffer<float> effective_log_scale_, effective_opacity_logit_;
  Frame frame_;
  std::vector<glm::vec3> host_picture_;
  LossBuffers loss_;
  Buffer<float> v_picture_;
  std::unordered_map<std::size_t, DevicePhotograph> photographs_;  // by view
  DevicePhotograph passing_;
};

}  // namespace

std::unique_ptr<TrainingEngine> makeTrainingEngine(float ssim_weight) {
  return std::make_unique<CudaTrainingEngine>(ssim_weight);
}

}  // namespace tg::cuda
