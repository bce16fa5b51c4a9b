// SPDX-License-Identifier: Apache-2.0
// Orders, as the first rank gives them and the others take them.
#include "training/mpi/engine.h"

#include <cmath>
#include <string>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "training/mpi/messages.h"
#include "training/mpi/part.h"

namespace tg {
namespace {

enum class Order : std::uint8_t {
  scatter,
  gather,
  step,
  draw,
  densify,
  relocateAndGrow,
  resetOpacity,
  growShDegree,
  updateFilter,
  end
};

struct StepOrder {
  StepChoices choices;
  Pinhole camera;
  float ssim_weight;
};

Camera cameraOf(const Pinhole& pinhole) {
  Camera camera;
  static_cast<Pinhole&>(camera) = pinhole;
  return camera;
}

struct DrawOrder {
  Pinhole camera;
  glm::vec3 background;
};

template <typename... Values>
void give(Channel& channel, Order order, const Values&... values) {
  MessageWriter writer;
  writer.put(order);
  (writer.put(values), ...);
  fromFirst(channel, writer.take());
}

// The state lies at the ranks; `state` is the whole of it where it was pulled and nothing was done since.
class ShardedEngine final : public TrainingEngine {
 public:
  ShardedEngine(Channel& channel, const Dataset& dataset, float ssim_weight)
      : channel_(channel), ssim_weight_(ssim_weight), part_(channel, dataset) {}

  bool hasPhotograph(std::size_t, bool) const override { return true; }
  void step(RunState& state, const StepInput& input) override {
    change(state);
    give(channel_, Order::step, StepOrder{input, input.camera, ssim_weight_});
    losses_.push_back(part_.step(input, ssim_weight_));
  }
  std::vector<LossValue> losses(RunState&, bool) override { return std::exchange(losses_, {}); }
  DensifyResult densify(RunState& state, const DensifySettings& settings) override {
    change(state);
    give(channel_, Order::densify, settings);
    return part_.densify(settings, &state.densify_random);
  }
  McmcResult relocateAndGrow(RunState& state, const McmcSettings& settings) override {
    change(state);
    give(channel_, Order::relocateAndGrow, settings);
    return part_.relocateAndGrow(settings, &state.densify_random);
  }
  void resetOpacity(RunState& state) override {
    change(state);
    give(channel_, Order::resetOpacity);
    part_.resetOpacity();
  }
  void growShDegree(RunState& state, int degree) override {
    change(state);
    give(channel_, Order::growShDegree, degree);
    part_.growShDegree(degree);
    state.training.model.sh_degree = degree;
  }
  void updateFilter(RunState& state, std::span<const Pinhole> cameras) override {
    change(state);
    give(channel_, Order::updateFilter, cameras.size(), cameras);
    part_.updateFilter(cameras);
  }
  const std::vector<glm::vec3>& picture(RunState& state, const Camera& camera, glm::vec3 background) override {
    scatter(state);
    give(channel_, Order::draw, DrawOrder{camera, background});
    part_.draw(camera, background, picture_);
    return picture_;
  }
  std::size_t gaussians(const RunState& state) const override {
    return scattered_ ? part_.gaussians() : state.training.model.size();
  }
  std::size_t texels(const RunState& state) const override {
    return scattered_ ? part_.texels() : state.training.model.atlas.texels.size();
  }
  void pull(RunState& state) override {
    if (whole_) return;
    give(channel_, Order::gather);
    part_.gather(&state);
    whole_ = true;
  }
  void stateChanged() override {
    TG_ASSERT(whole_, "a state is pulled before it is changed");
    scattered_ = false;
  }

 private:
  void scatter(RunState& state) {
    if (scattered_) return;
    give(channel_, Order::scatter);
    part_.scatter(&state);
    scattered_ = true;
    whole_ = false;
  }
  // Before the shards are changed: a whole state has no use then.
  void change(RunState& state) {
    scatter(state);
    if (whole_) dropArrays(state);
    whole_ = false;
  }

  Channel& channel_;
  const float ssim_weight_;
  Part part_;
  bool whole_ = true;
  bool scattered_ = false;
  std::vector<glm::vec3> picture_;
  std::vector<LossValue> losses_;
};

class ShardedRenderer final : public DifferentiableRenderer {
 public:
  ShardedRenderer(Channel& channel, const Dataset& dataset)
      : channel_(channel), dataset_(dataset), own_(makeCpuDifferentiableRenderer()) {}

  using DifferentiableRenderer::forward;
  void setModel(const GaussianModel& model) override { own_->setModel(model); }
  const std::vector<glm::vec3>& forward(const Camera& camera, const RenderSettings& settings) override {
    return own_->forward(camera, settings);
  }
  void backward(std::span<const glm::vec3> v_color, ModelGradient& gradient, const GradientOptions& options) override {
    own_->backward(v_color, gradient, options);
  }
  std::span<const PhaseTime> phaseTimes() const override { return own_->phaseTimes(); }
  std::string deviceName() const override {
    return own_->deviceName() + ", " + std::to_string(channel_.size()) + " processes";
  }
  std::unique_ptr<TrainingEngine> makeTrainingEngine(float ssim_weight) override {
    return std::make_unique<ShardedEngine>(channel_, dataset_, ssim_weight);
  }

 private:
  Channel& channel_;
  const Dataset& dataset_;
  const std::unique_ptr<DifferentiableRenderer> own_;
};

}  // namespace

std::unique_ptr<DifferentiableRenderer> makeShardedRenderer(Channel& channel, const Dataset& dataset) {
  TG_ASSERT(channel.rank() == 0, "the first rank's");
  return std::make_unique<ShardedRenderer>(channel, dataset);
}

int serveRank(Channel& channel, const Dataset& dataset) {
  TG_ASSERT(channel.rank() > 0, "the others' part");
  Part part(channel, dataset);
  std::vector<glm::vec3> no_picture;
  for (;;) {
    const Message message = fromFirst(channel, {});
    MessageReader reader(message);
    switch (reader.get<Order>()) {
      case Order::scatter:
        part.scatter(nullptr);
        break;
      case Order::gather:
        part.gather(nullptr);
        break;
      case Order::step: {
        const auto order = reader.get<StepOrder>();
        const Camera camera = cameraOf(order.camera);
        part.step({order.choices, camera, nullptr}, order.ssim_weight);
        break;
      }
      case Order::draw: {
        const auto order = reader.get<DrawOrder>();
        part.draw(cameraOf(order.camera), order.background, no_picture);
        break;
      }
      case Order::densify:
        part.densify(reader.get<DensifySettings>(), nullptr);
        break;
      case Order::relocateAndGrow:
        part.relocateAndGrow(reader.get<McmcSettings>(), nullptr);
        break;
      case Order::resetOpacity:
        part.resetOpacity();
        break;
      case Order::growShDegree:
        part.growShDegree(reader.get<int>());
        break;
      case Order::updateFilter:
        part.updateFilter(reader.get<Pinhole>(reader.get<std::size_t>()));
        break;
      case Order::end:
        return reader.get<int>();
    }
  }
}

void endRanks(Channel& channel, int code) { give(channel, Order::end, code); }

}  // namespace tg
