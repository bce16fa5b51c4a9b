// SPDX-License-Identifier: Apache-2.0
// The CPU's DifferentiableRenderer: the render stages forward, then sums per (tile, splat) pair, then per Gaussian.
#include <algorithm>
#include <chrono>
#include <ctime>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "render/cpu/blend.h"
#include "render/cpu/project.h"
#include "render/cpu/tiles.h"
#include "training/cpu/backward.h"
#include "training/cpu/finish.h"
#include "training/gradient.h"

namespace tg {
namespace {

// Texels of all pairs that are in flight at once. 16 Mi texels are 256 MiB: a million pairs of 4 x 4 textures. Tiles
// beyond that follow in further rounds; the order of every sum stays the same.
constexpr std::size_t kMaxSlotTexels = std::size_t{16} << 20;
constexpr int kGrain = 64;  // Gaussians per grab

class CpuDifferentiableRenderer final : public DifferentiableRenderer {
 public:
  const std::vector<glm::vec3>& forward(const GaussianModel& model, const Camera& camera,
                                        const RenderSettings& settings) override {
    model_ = &model;
    view_ = cpu::makeView(model, camera, settings);
    times_.clear();
    timed("order", [&] { order_ = cpu::depthOrder(view_, model); });
    timed("project", [&] { cpu::projectSplats(view_, model, order_, screen_); });
    timed("lists", [&] { cpu::buildTileLists(view_, screen_, true, lists_); });
    timed("blend forward",
          [&] { cpu::blendPicture(view_, screen_, lists_, model.atlas.texels.data(), picture_, record_); });
    return picture_;
  }

  void backward(std::span<const glm::vec3> v_color, ModelGradient& gradient, const GradientOptions& options) override {
    if (model_ == nullptr) throw Error(ErrorKind::usage, "backward", "no forward pass (expected forward first)");
    if (v_color.size() != picture_.size()) {
      throw Error(ErrorKind::usage, "backward",
                  "wrong number of pixels (expected " + std::to_string(picture_.size()) + ", found " +
                      std::to_string(v_color.size()) + ")");
    }
    times_.erase(std::find_if(times_.begin(), times_.end(), [](const PhaseTime& t) { return t.name == kBackward; }),
                 times_.end());
    sums_.resize(lists_.splats.size());
    screen_abs_.resize(options.statistics ? lists_.splats.size() : 0);
    texture_sums_.resize(view_.textured() ? lists_.splats.size() : 0);
    const cpu::BackwardInput input{view_, screen_, lists_, record_, model_->atlas.texels.data(), v_color, options};
    timed(kBackward, [&] {
      if (view_.textured()) gradient.v_texels.assign(model_->atlas.texels.size(), glm::vec4(0.0f));
      for (int first = 0; first < lists_.tiles();) {
        const int end = makeSlots(first);
        cpu::backwardTiles(input, first, end, {sums_, screen_abs_, texture_sums_, slots_});
        if (!slots_.texels.empty()) gatherTexels(first, end, gradient);
        first = end;
      }
    });
    timed("finish", [&] {
      clear(gradient);
      parallelFor(static_cast<std::int64_t>(screen_.splats.size()), kGrain,
                  [&](std::int64_t k) { gatherSplat(static_cast<std::size_t>(k), gradient); });
    });
  }

  std::span<const PhaseTime> phaseTimes() const override { return times_; }

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

  void clear(ModelGradient& gradient) const {
    const std::size_t n = model_->size();
    gradient.v_mean.assign(n, glm::vec3(0.0f));
    gradient.v_rotation.assign(n, glm::vec4(0.0f));
    gradient.v_log_scale.assign(n, glm::vec3(0.0f));
    gradient.v_opacity_logit.assign(n, 0.0f);
    gradient.v_sh.assign(model_->sh.size(), glm::vec3(0.0f));
    if (!view_.textured()) gradient.v_texels.assign(model_->atlas.texels.size(), glm::vec4(0.0f));
    gradient.screen_gradient.assign(n, 0.0f);
    gradient.screen_gradient_abs.assign(n, 0.0f);
    gradient.screen_radius.assign(n, 0.0f);
  }

  std::span<const std::uint32_t> pairsOf(std::size_t k) const {
    return std::span(lists_.pairs).subspan(lists_.pair_begin[k], lists_.pair_begin[k + 1] - lists_.pair_begin[k]);
  }

  // Lays out the texel slots of as many tiles from `first` on as fit, at least one. Returns the tile after the last.
  int makeSlots(int first) {
    slots_.first = lists_.begin[first];
    slots_.begin.clear();
    std::size_t texels = 0;
    int tile = first;
    if (!view_.textured()) {
      tile = lists_.tiles();
    } else {
      for (; tile < lists_.tiles(); ++tile) {
        const std::size_t before = texels;
        const std::size_t pairs = slots_.begin.size();
        for (const std::uint32_t k : lists_.list(tile)) {
          slots_.begin.push_back(texels);
          texels += std::size_t{screen_.splats[k].texture_width} * screen_.splats[k].texture_height;
        }
        if (tile > first && texels > kMaxSlotTexels) {
          texels = before;
          slots_.begin.resize(pairs);
          break;
        }
      }
    }
    if (slots_.texels.size() < texels || texels == 0) slots_.texels.resize(texels);
    return tile;
  }

  void gatherTexels(int first_tile, int end_tile, ModelGradient& gradient) const {
    const std::uint32_t first = lists_.begin[first_tile];
    const std::uint32_t end = lists_.begin[end_tile];
    parallelFor(static_cast<std::int64_t>(screen_.splats.size()), kGrain, [&](std::int64_t k) {
      const cpu::Splat& s = screen_.splats[k];
      const std::size_t count = std::size_t{s.texture_width} * s.texture_height;
      if (count == 0) return;
      glm::vec4* v_texels = gradient.v_texels.data() + s.texel_offset;
      for (const std::uint32_t pair : pairsOf(k)) {
        if (pair < first || pair >= end || !record_.shows(pair)) continue;
        const glm::vec4* slot = slots_.texels.data() + slots_.begin[pair - first];
        for (std::size_t i = 0; i < count; ++i) v_texels[i] += slot[i];
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

  void gatherSplat(std::size_t k, ModelGradient& gradient) const {
    const cpu::Splat& s = screen_.splats[k];
    gradient.screen_radius[s.gaussian] = screen_.screen_radius[k];
    const auto pairs = pairsOf(k);
    if (pairs.empty()) return;
    cpu::PairSums total{};
    cpu::PairTextureSums texture_total{};
    float screen_abs = 0.0f;
    for (const std::uint32_t pair : pairs) {
      if (!record_.shows(pair)) continue;
      add(sums_[pair], total);
      if (!screen_abs_.empty()) screen_abs += screen_abs_[pair];
      if (s.texture_width > 0) add(texture_sums_[pair], texture_total);
    }
    cpu::SplatSums sums(total, screen_abs);
    sums.set(texture_total);
    cpu::finishGaussian(view_, *model_, s.gaussian, sums, gradient);
    // An alpha texel outside [0, 1] is about to be clamped by its owner: no gradient pushes it further.
    const std::size_t texels = std::size_t{s.texture_width} * s.texture_height;
    for (std::size_t i = s.texel_offset; i < s.texel_offset + texels; ++i) {
      const float alpha = model_->atlas.texels[i].a;
      if (!(alpha >= 0.0f && alpha <= 1.0f)) gradient.v_texels[i].a = 0.0f;
    }
  }

  const GaussianModel* model_ = nullptr;
  cpu::View view_;
  std::vector<std::uint32_t> order_;
  cpu::ScreenSplats screen_;
  cpu::TileLists lists_;
  std::vector<glm::vec3> picture_;
  cpu::BlendRecord record_;
  std::vector<cpu::PairSums> sums_;
  std::vector<float> screen_abs_;
  std::vector<cpu::PairTextureSums> texture_sums_;
  cpu::TexelSlots slots_;
  std::vector<PhaseTime> times_;
};

}  // namespace

std::unique_ptr<DifferentiableRenderer> makeCpuDifferentiableRenderer() {
  return std::make_unique<CpuDifferentiableRenderer>();
}

}  // namespace tg
