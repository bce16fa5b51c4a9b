// SPDX-License-Identifier: Apache-2.0
// The CPU's DifferentiableRenderer: the render stages forward, then sums per (tile, splat) pair, then per Gaussian.
#include <algorithm>
#include <array>
#include <chrono>
#include <ctime>
#include <string>

#include "core/system/error.h"
#include "core/system/parallel.h"
#include "render/cpu/blend.h"
#include "render/cpu/project.h"
#include "render/cpu/tiles.h"
#include "training/cpu/backward.h"
#include "training/cpu/finish.h"
#include "training/step/gradient.h"

namespace tg {
namespace {

constexpr std::size_t kGrain = 128;  // Gaussians per grab
constexpr std::uint32_t kNoSplat = ~std::uint32_t{0};

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
    shows_.assign(lists_.splats.size(), 0);
    sums_.resize(lists_.splats.size());
    screen_abs_.resize(options.statistics ? lists_.splats.size() : 0);
    texture_sums_.resize(view_.textured() ? lists_.splats.size() : 0);
    const cpu::BackwardInput input{view_, screen_, lists_, record_, model_->atlas.texels.data(), v_color, options};
    timed(kBackward, [&] {
      if (view_.textured()) gradient.texels.assign(model_->atlas.texels.size(), glm::vec4(0.0f));
      for (int first = 0; first < lists_.tiles();) {
        const int end = view_.textured() ? makeSlots(first) : lists_.tiles();
        cpu::backwardTiles(input, first, end, {shows_, sums_, screen_abs_, texture_sums_, slots_});
        if (view_.textured()) gatherTexels(gradient);
        first = end;
      }
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

  // Gaussians in their own order, so that the gradient is written as one stream.
  void finish(ModelGradient& gradient) {
    const std::size_t n = model_->size();
    forEachField([](const Field&, auto& v, const auto& values) { v.resize(values.size()); }, gradient, *model_);
    if (!view_.textured()) gradient.texels.assign(model_->atlas.texels.size(), glm::vec4(0.0f));
    gradient.screen_gradient.resize(n);
    gradient.screen_gradient_abs.resize(n);
    gradient.screen_radius.resize(n);
    splat_of_.assign(n, kNoSplat);
    const auto& gaussians = depth_order_.gaussians;
    for (std::size_t k = 0; k < gaussians.size(); ++k) splat_of_[gaussians[k]] = static_cast<std::uint32_t>(k);

    const auto batch = static_cast<std::size_t>(cpu::finishBatchSize());
    parallelFor(static_cast<std::int64_t>((n + kGrain - 1) / kGrain), 1, [&](std::int64_t chunk) {
      std::array<cpu::SplatSums, cpu::kMaxFinishBatch> sums;
      std::size_t filled = 0;
      const std::size_t begin = static_cast<std::size_t>(chunk) * kGrain;
      const std::size_t end = std::min(n, begin + kGrain);
      for (std::size_t i = begin; i < end; ++i) {
        const std::uint32_t k = splat_of_[i];
        gradient.screen_radius[i] = k == kNoSplat ? 0.0f : screen_.screen_radius[k];
        if (k == kNoSplat || !gather(k, sums[filled])) {
          clear(i, gradient);
          continue;
        }
        maskAlphaTexels(*sums[filled].splat, gradient);
        if (++filled == batch) {
          cpu::finishSplats(view_, *model_, std::span(sums).first(filled), gradient);
          filled = 0;
        }
      }
      if (filled > 0) cpu::finishSplats(view_, *model_, std::span(sums).first(filled), gradient);
    });
  }

  void clear(std::size_t i, ModelGradient& gradient) const {
    forEachField(
        [&]<typename T>(const Field& field, std::vector<T>& v) {
          const std::size_t count = field.values(model_->shCount());
          std::fill_n(v.data() + i * count, count, T{});
        },
        gradient);
    gradient.screen_gradient[i] = 0.0f;
    gradient.screen_gradient_abs[i] = 0.0f;
  }

  // Lays out the texel slots of as many tiles from `first` on as fit, at least one. Returns the tile after the last.
  int makeSlots(int first) {
    slots_.begin.assign(lists_.splats.size(), cpu::TexelSlots::kNone);
    slots_.written.resize(lists_.splats.size());
    std::size_t texels = 0;
    int tile = first;
    for (; tile < lists_.tiles(); ++tile) {
      std::size_t next = texels;
      for (std::uint32_t at = lists_.begin[tile]; at < lists_.begin[tile + 1]; ++at) next += texelsAt(at);
      if (tile > first && next > texels_in_flight_) break;
      for (std::uint32_t at = lists_.begin[tile]; at < lists_.begin[tile + 1]; ++at) {
        if (texelsAt(at) == 0) continue;
        slots_.begin[lists_.pairs[at]] = texels;
        texels += texelsAt(at);
      }
    }
    if (slots_.texels.size() < texels) slots_.texels.resize(texels);
    return tile;
  }

  // Texels of the splat at a position of the tile lists, 0 if it does not show there.
  std::size_t texelsAt(std::uint32_t position) const {
    const cpu::Splat& s = screen_.splats[lists_.splats[position]];
    return record_.shows(position) ? std::size_t{s.texture_width} * s.texture_height : 0;
  }

  // Adds the slots to the texels' gradients.
  void gatherTexels(ModelGradient& gradient) const {
    parallelFor(static_cast<std::int64_t>(screen_.splats.size()), static_cast<std::int64_t>(kGrain),
                [&](std::int64_t k) {
                  const cpu::Splat& s = screen_.splats[k];
                  if (s.texture_width == 0) return;
                  glm::vec4* v_texels = gradient.texels.data() + s.texel_offset;
                  for (std::uint32_t pair = lists_.pair_begin[k]; pair < lists_.pair_begin[k + 1]; ++pair) {
                    if (slots_.begin[pair] == cpu::TexelSlots::kNone) continue;
                    const glm::vec4* slot = slots_.texels.data() + slots_.begin[pair];
                    const auto [first, end] = slots_.written[pair];
                    for (std::uint32_t i = first; i < end; ++i) v_texels[i] += slot[i];
                  }
                });
  }

  // Sums is a row of floats.
  template <typename Sums>
  static void add(const Sums& from, Sums& to) {
    static_assert(sizeof(Sums) % sizeof(float) == 0);
    const auto* a = reinterpret_cast<const float*>(&from);
    auto* b = reinterpret_cast<float*>(&to);
    for (std::size_t i = 0; i < sizeof(Sums) / sizeof(float); ++i) b[i] += a[i];
  }

  // Adds up a splat's pairs. Returns whether it shows anywhere.
  bool gather(std::uint32_t k, cpu::SplatSums& sums) const {
    bool shows = false;
    const cpu::Splat& splat = screen_.splats[k];
    for (std::uint32_t pair = lists_.pair_begin[k]; pair < lists_.pair_begin[k + 1]; ++pair) {
      if (shows_[pair] == 0) continue;
      if (!shows) sums = {&splat, {}, {}, 0.0f};
      shows = true;
      add(sums_[pair], sums.pairs);
      if (!screen_abs_.empty()) sums.screen_abs += screen_abs_[pair];
      if (splat.texture_width > 0) add(texture_sums_[pair], sums.texture);
    }
    return shows;
  }

  // An alpha texel outside [0, 1] is about to be clamped by its owner: no gradient pushes it further.
  void maskAlphaTexels(const cpu::Splat& s, ModelGradient& gradient) const {
    const std::size_t texels = std::size_t{s.texture_width} * s.texture_height;
    for (std::size_t i = s.texel_offset; i < s.texel_offset + texels; ++i) {
      const float alpha = model_->atlas.texels[i].a;
      if (!(alpha >= 0.0f && alpha <= 1.0f)) gradient.texels[i].a = 0.0f;
    }
  }

  std::size_t texels_in_flight_;
  const GaussianModel* model_ = nullptr;
  cpu::View view_;
  cpu::DepthOrder depth_order_;
  cpu::ScreenSplats screen_;
  cpu::TileLists lists_;
  std::vector<glm::vec3> picture_;
  cpu::BlendRecord record_;
  std::vector<std::uint8_t> shows_;
  std::vector<cpu::PairSums> sums_;
  std::vector<float> screen_abs_;
  std::vector<cpu::PairTextureSums> texture_sums_;
  cpu::TexelSlots slots_;
  std::vector<std::uint32_t> splat_of_;  // [Gaussians] kNoSplat: not before the camera
  std::vector<PhaseTime> times_;
};

}  // namespace

std::unique_ptr<DifferentiableRenderer> makeCpuDifferentiableRenderer(std::size_t texels_in_flight) {
  return std::make_unique<CpuDifferentiableRenderer>(texels_in_flight);
}

}  // namespace tg
