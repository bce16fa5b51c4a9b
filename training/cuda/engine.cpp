// SPDX-License-Identifier: Apache-2.0
// Steps are launched without waiting for any; every kStepsAhead of them, their losses and numbers of pairs come back. A
// whole state travels where the trainer starts a stage, or looks at it.
#include "training/cuda/engine.h"

#include <algorithm>
#include <deque>
#include <limits>
#include <type_traits>
#include <utility>

#include "training/cuda/density.h"
#include "training/cuda/frame.h"
#include "training/cuda/photographs.h"
#include "training/cuda/state.h"
#include "training/cuda/step.h"

namespace tg::cuda {
namespace {

// Steps that the device may be behind. A launch queue holds about a thousand kernels, some 30 steps; fewer where
// gradients are finished in parts, and then launches wait.
constexpr std::size_t kStepsAhead = 32;

class CudaTrainingEngine final : public TrainingEngine {
 public:
  CudaTrainingEngine(float ssim_weight, StepParts parts) : ssim_weight_(ssim_weight), parts_(parts) {}

  bool hasPhotograph(std::size_t view, bool background_varies) const override {
    return photographs_.has(view, background_varies);
  }
  bool sharesTextures() const override { return true; }
  void step(RunState& state, const StepInput& input) override {
    if (holds_ && !input.texture_groups.empty() && device_.shared_rects.empty()) {  // it was looked at before
      pull(state);
      holds_ = false;
    }
    hold(state, input.texture_groups);
    ahead_ = true;
    steps_.push_back({input});
    records_.resize(kStepsAhead);
    begin(state, steps_.size() - 1);
    // The first one says how much room others need, and what progress starts from.
    const bool full = steps_.size() == kStepsAhead || photographBytes() >= parts_.photographs;
    if (full || input.iteration == 1 || peak_ == 0) settle(state);
  }
  std::vector<LossValue> losses(RunState& state, bool wait) override {
    if (wait) settle(state);
    return std::exchange(losses_, {});
  }

  DensifyResult densify(RunState& state, const DensifySettings& settings) override {
    return inRound(state, [&](DensityScratch& scratch) {
      return cuda::densify(device_, settings, state.densify_random, scratch);
    });
  }
  McmcResult relocateAndGrow(RunState& state, const McmcSettings& settings) override {
    return inRound(state, [&](DensityScratch& scratch) {
      return cuda::relocateAndGrow(device_, settings, state.densify_random, scratch);
    });
  }
  void resetOpacity(RunState& state) override { cuda::resetOpacity(changing(state)); }
  void growShDegree(RunState& state, int degree) override {
    cuda::growShDegree(changing(state), degree);
    state.training.model.sh_degree = degree;
  }
  void updateFilter(RunState& state, std::span<const Pinhole> cameras) override {
    if (cameras_.size() == 0) cameras_.upload(cameras);
    cuda::updateFilter(changing(state), cameras_, number_);
  }
  bool mayHaveWide(RunState& state, std::span<const glm::dvec3> eyes, double bound) override {
    if (!holds_) return true;  // the host has the state, after a swap: sending it costs more than looking there
    hold(state);
    settle(state);
    if (eyes_.size() == 0) eyes_.upload(eyes);
    return cuda::mayHaveWide(device_.model.parameters(), eyes_, bound, number_);
  }

  const std::vector<glm::vec3>& picture(RunState& state, const Camera& camera, glm::vec3 background) override {
    hold(state);
    settle(state);
    frame_.forward(viewOf(state, camera, background), drawn());
    host_picture_.resize(frame_.picture().size() / 3);
    frame_.picture().download(host_picture_);
    return host_picture_;
  }

  std::size_t gaussians(const RunState& state) const override {
    return holds_ ? device_.model.count : state.training.model.size();
  }
  void pull(RunState& state) override {
    settle(state);
    if (ahead_) download(device_, state);
    ahead_ = false;
  }
  void stateChanged() override { holds_ = false; }

 private:
  struct Step {
    StepInput input;
    double counted = 0;  // values that count in its photograph
  };

  void hold(const RunState& state, std::span<const std::uint32_t> texture_groups = {}) {
    if (holds_) return;
    // Another stage may need less.
    const std::size_t room = std::exchange(frame_, Frame()).room();
    gradient_ = {};
    upload(state, texture_groups, device_);
    frame_.makeRoom(room);
    holds_ = true;
  }
  DeviceState& changing(const RunState& state) {
    hold(state);
    settle(state);
    ahead_ = true;
    return device_;
  }

  // A round of densification has the memory in which frames and gradients are made.
  template <typename Change>
  std::invoke_result_t<Change, DensityScratch&> inRound(const RunState& state, const Change& change) {
    changing(state);
    const std::size_t room = std::exchange(frame_, Frame()).room();
    gradient_ = {};
    DensityScratch scratch;
    const auto result = change(scratch);
    frame_.makeRoom(room);
    return result;
  }

  View viewOf(const RunState& state, const Camera& camera, glm::vec3 background) const {
    RenderSettings render;
    render.background = background;
    return makeView(state.training.model, camera, render);
  }
  // The model through the 3D filter.
  Parameters drawn() {
    Parameters drawn = device_.model.parameters();
    if (device_.min_sigma.size() == 0) return drawn;
    effective_log_scale_.resize(3 * drawn.count);
    effective_opacity_logit_.resize(drawn.count);
    applyFilter(drawn, device_.min_sigma.data(), effective_log_scale_.data(), effective_opacity_logit_.data());
    drawn.log_scale = effective_log_scale_.data();
    drawn.opacity_logit = effective_opacity_logit_.data();
    return drawn;
  }

  // Of those that steps_ hold.
  std::size_t photographBytes() const {
    std::size_t bytes = 0;
    for (const Step& step : steps_) {
      if (step.input.photograph) bytes += step.input.photograph->rgb.size() + step.input.photograph->mask.size();
    }
    return bytes;
  }

  // Launches steps_[index], the one after device_.step + index others, and its verdict.
  void begin(const RunState& state, std::size_t index) {
    Step& step = steps_[index];
    const StepInput& input = step.input;
    const Parameters stored = device_.model.parameters();
    const Parameters drawn = this->drawn();
    frame_.forwardAhead(viewOf(state, input.camera, input.background), drawn);

    const DevicePhotographs::OnDevice photograph =
        photographs_.get(input.view, input.photograph, input.background_varies);
    step.counted = photograph.counted;
    if (photographs_.has(input.view, input.background_varies)) step.input.photograph.reset();
    v_picture_.resize(frame_.picture().size());
    evaluateLoss({input.camera.size.x, input.camera.size.y, ssim_weight_, photograph.counted, frame_.picture().data(),
                  photograph.rgb, photograph.mask},
                 loss_, v_picture_.data());
    photographs_.release();
    if (stop_.size() == 0) clearStop();
    judgeStep({loss_.sums.data(), frame_.pairs(), frame_.room(), stop_.data(), records_.data() + index});

    const AdamScales scales = adamScales(device_.step + static_cast<std::int64_t>(index) + 1);
    const bool textured = state.training.model.texture_mode != TextureMode::none;
    // What a range of depths has moved no nearer one reads.
    const Buffer<std::uint32_t>& owners = device_.owners;
    const std::size_t at_a_time = owners.size() > 0 ? std::max(parts_.texels, stored.texel_count) : parts_.texels;
    frame_.backward(v_picture_.data(), input.gradient, drawn, at_a_time, [&](const TexelSums& sums) {
      if (!textured) return;
      moveTexels(sums,
                 {stored, device_.moments.texels, input.rates.texels, input.rates.texels * input.rates.texel_decay,
                  scales, input.clamp_colors, stop_.data(), owners.data(), owners.size()});
    });
    moveParameters(stored, drawn, input, scales);
    if (input.gather_statistics) {
      addStatistics(frame_.screenGradient().data(), frame_.screenGradientAbs().data(), frame_.screenRadius().data(),
                    stored.count, device_.statistics, stop_.data());
    }
    if (input.mcmc) addNoise(stored, input.noise, input.noise_seed, input.iteration, stop_.data());
  }

  // Waits for the steps that were begun. Those whose pairs had no room, and with them all later ones, changed nothing:
  // they are done again with more.
  void settle(const RunState& state) {
    while (!steps_.empty()) {
      std::vector<StepRecord> records(steps_.size());
      copyToHost(records.data(), records_.data(), records.size() * sizeof(StepRecord));
      PairCount most = 0;
      for (const StepRecord& record : records) most = std::max(most, record.pairs);
      std::size_t done = 0;
      for (; done < records.size() && records[done].applied != 0; ++done) {
        losses_.push_back(lossOf(records[done], steps_.front().counted));
        steps_.pop_front();
      }
      device_.step += static_cast<std::int64_t>(done);
      if (done < records.size() && records[done].pairs <= frame_.room()) {
        losses_.push_back(lossOf(records[done], steps_.front().counted));
        losses_.back().total = std::numeric_limits<double>::quiet_NaN();
        steps_.clear();
      }
      fitRoom(most);
      if (done < records.size()) clearStop();
      for (std::size_t index = 0; index < steps_.size(); ++index) begin(state, index);
    }
  }
  // Sorting takes time for the whole room: it follows what the last thousand steps or so needed.
  void fitRoom(PairCount most) {
    peak_ = std::max({most, peak_ - peak_ / 32, PairCount{1}});
    const std::size_t room = roomFor(peak_);
    if (most + most / 16 > frame_.room() || 2 * room < frame_.room()) frame_.makeRoom(room);
  }
  void clearStop() {
    stop_.resize(1);
    stop_.zero();
  }

  // From the sums of pairs to Adam's step.
  void moveParameters(const Parameters& stored, const Parameters& drawn, const StepInput& input, AdamScales scales) {
    const std::size_t rows = std::min(stored.count, parts_.gaussians);
    for (std::size_t first = 0; first < stored.count; first += rows) {
      gradient_.resizeLike(device_.model, std::min(rows, stored.count - first), 0);
      const Parameters gradient = gradient_.parameters();
      frame_.finish(drawn, first, gradient);
      moveGaussians(stored, first, gradient, input, scales);
    }
  }

  void moveGaussians(const Parameters& stored, std::size_t first, const Parameters& gradient, const StepInput& input,
                     AdamScales scales) {
    const Parameters moved = slice(stored, first, gradient.count);
    const auto all = static_cast<double>(stored.count);
    const float* min_sigma = device_.min_sigma.size() > 0 ? device_.min_sigma.data() + first : nullptr;
    chainGradients({moved, min_sigma, input.mcmc, input.opacity_weight / all, input.scale_weight / all, stop_.data()},
                   gradient);
    const auto move = [&](const Field& field, float* value, float* v_value, const DeviceMoments& moments, Rate rate) {
      const auto floats = static_cast<unsigned>(field.row(stored.sh_count));
      cuda::adamStep({value, v_value, moments, floats * moved.count, field.harmonic ? floats : 1,
                      field.harmonic ? field.floats : 0, rate.first, rate.rest, scales, stop_.data(), floats * first});
    };
    forEachField(move, moved, gradient, device_.moments, input.rates);
  }

  LossValue lossOf(const StepRecord& record, double counted) const {
    const double* sums = record.sums;
    return tg::lossOf({.l1 = sums[0], .ssim = sums[1], .squared = sums[2]}, counted, ssim_weight_);
  }

  const float ssim_weight_;
  const StepParts parts_;
  bool holds_ = false;  // the device has the state
  bool ahead_ = false;  // and has moved on from it
  DeviceState device_;
  DeviceModel gradient_;  // of some Gaussians
  Buffer<Pinhole> cameras_;
  Buffer<glm::dvec3> eyes_;
  Buffer<std::uint32_t> number_;  // [1] scratch
  Buffer<float> effective_log_scale_, effective_opacity_logit_;
  Frame frame_;
  std::deque<Step> steps_;  // begun, and not known to be done
  Buffer<StepRecord> records_;
  Buffer<std::uint32_t> stop_;  // [1] judgeStep()
  std::vector<LossValue> losses_;
  PairCount peak_ = 0;  // that steps needed, fading
  std::vector<glm::vec3> host_picture_;
  LossBuffers loss_;
  Buffer<float> v_picture_;
  DevicePhotographs photographs_;
};

}  // namespace

std::unique_ptr<TrainingEngine> makeTrainingEngine(float ssim_weight, StepParts parts) {
  return std::make_unique<CudaTrainingEngine>(ssim_weight, parts);
}

}  // namespace tg::cuda
