// SPDX-License-Identifier: Apache-2.0
// An iteration copies 28 bytes back: the number of pairs and the loss. Whole states travel when the trainer changes
// them.
#include "training/cuda/engine.h"

#include <algorithm>
#include <unordered_map>

#include "training/cuda/frame.h"
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

struct StateMoments {
  DeviceMoments mean, rotation, log_scale, opacity_logit, sh, texels;
};
// Calls visit(a.member, b.member) for each parameter.
template <typename A, typename B, typename Visit>
void forEachMoments(A& a, B& b, const Visit& visit) {
  visit(a.mean, b.mean);
  visit(a.rotation, b.rotation);
  visit(a.log_scale, b.log_scale);
  visit(a.opacity_logit, b.opacity_logit);
  visit(a.sh, b.sh);
  visit(a.texels, b.texels);
}

class CudaTrainingEngine final : public TrainingEngine {
 public:
  explicit CudaTrainingEngine(float ssim_weight) : ssim_weight_(ssim_weight) {}

  LossValue step(RunState& state, const StepInput& input) override {
    if (!holds_) uploadState(state);
    const bool filtered = !state.min_sigma.empty();
    const Parameters stored = model_.parameters();
    Parameters drawn = stored;
    if (filtered) {
      drawn.log_scale = effective_log_scale_.data();
      drawn.opacity_logit = effective_opacity_logit_.data();
      applyFilter(stored, min_sigma_.data(), drawn.log_scale, drawn.opacity_logit);
    }
    RenderSettings render;
    render.background = input.background;
    frame_.forward(makeView(state.training.model, input.camera, render), drawn);

    const DevicePhotograph& photograph = photographOf(input);
    v_picture_.resize(frame_.picture().size());
    evaluateLoss({input.camera.width, input.camera.height, ssim_weight_, photograph.counted, frame_.picture().data(),
                  photograph.rgb.data(), photograph.mask.data()},
                 loss_, v_picture_.data());

    gradient_.resizeLike(model_);
    const Parameters gradient = gradient_.parameters();
    frame_.backward(v_picture_.data(), input.gradient, drawn, gradient);
    const auto count = static_cast<double>(stored.count);
    chainGradients({stored, filtered ? min_sigma_.data() : nullptr, input.mcmc, input.opacity_weight / count,
                    input.scale_weight / count},
                   gradient);
    if (input.gather_statistics) {
      addStatistics(frame_.screenGradient().data(), frame_.screenGradientAbs().data(), frame_.screenRadius().data(),
                    stored.count, statistics_);
    }
    update(state.training.model, stored, gradient, input);
    ahead_ = true;
    return readLoss(photograph.counted);
  }

  void pull(RunState& state) override {
    if (!ahead_) return;
    TrainingState& training = state.training;
    model_.download(training.model);
    forEachMoments(moments_, training, [](const DeviceMoments& from, Moments& to) {
      from.first.download(to.first);
      from.second.download(to.second);
    });
    training.step = step_;
    statistics_.score_sum.download(state.statistics.score_sum);
    statistics_.magnitude_sum.download(state.statistics.magnitude_sum);
    statistics_.max_radius.download(state.statistics.max_radius);
    statistics_.view_count.download(state.statistics.view_count);
    ahead_ = false;
  }

  void stateChanged() override { holds_ = false; }

 private:
  void uploadState(const RunState& state) {
    const TrainingState& training = state.training;
    model_.upload(training.model);
    forEachMoments(moments_, training, [](DeviceMoments& to, const Moments& from) {
      to.first.upload(from.first);
      to.second.upload(from.second);
    });
    step_ = training.step;
    min_sigma_.upload(state.min_sigma);
    effective_log_scale_.resize(3 * state.min_sigma.size());
    effective_opacity_logit_.resize(state.min_sigma.size());
    statistics_.score_sum.upload(state.statistics.score_sum);
    statistics_.magnitude_sum.upload(state.statistics.magnitude_sum);
    statistics_.max_radius.upload(state.statistics.max_radius);
    statistics_.view_count.upload(state.statistics.view_count);
    holds_ = true;
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
    const AdamScales scales = adamScales(++step_);
    const auto uniform = [&](float* value, const float* v_value, const DeviceMoments& moments, float rate) {
      cuda::adamStep({value, v_value, moments, moments.first.size(), 1, 0, 0, rate, scales});
    };
    uniform(stored.mean, gradient.mean, moments_.mean, rates.mean);
    uniform(stored.rotation, gradient.rotation, moments_.rotation, rates.rotation);
    uniform(stored.log_scale, gradient.log_scale, moments_.log_scale, rates.log_scale);
    uniform(stored.opacity_logit, gradient.opacity_logit, moments_.opacity_logit, rates.opacity_logit);
    cuda::adamStep({stored.sh, gradient.sh, moments_.sh, moments_.sh.first.size(),
                    3 * static_cast<unsigned>(stored.sh_count), 3, rates.sh_dc, rates.sh_rest, scales});
    if (model.texture_mode != TextureMode::none) {
      uniform(stored.texels, gradient.texels, moments_.texels, rates.texels);
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
  std::int64_t step_ = 0;
  DeviceModel model_, gradient_;
  StateMoments moments_;
  DeviceStatistics statistics_;
  Buffer<float> min_sigma_, effective_log_scale_, effective_opacity_logit_;
  Frame frame_;
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
