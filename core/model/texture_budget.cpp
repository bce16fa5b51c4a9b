// SPDX-License-Identifier: Apache-2.0
// A texture size for every Gaussian.
#include "core/model/texture_budget.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/model/fallback.h"
#include "core/model/texture_fit.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr int kLargestClass = 512;      // [texels] a side
constexpr double kUnseenWeight = 1e-3;  // [px] what no view shows counts a little: other views may

// What is left of one axis's texels at a smaller size, as values at the old texels: n x n, row-major. Size 0: the mean
// by the Gaussian's weight.
class Projection {
 public:
  Projection(int from, int to) : n_(from), matrix_(static_cast<std::size_t>(from) * from, 0.0) {
    if (to == 0) {
      double sum = 0.0;
      std::vector<double> weights(static_cast<std::size_t>(from));
      for (int k = 0; k < from; ++k) sum += weights[k] = std::exp(-0.5 * position(k) * position(k));
      for (int row = 0; row < from; ++row) {
        for (int k = 0; k < from; ++k) matrix_[row * from + k] = weights[k] / sum;
      }
      return;
    }
    const AxisFit down(from, to), up(to, from);  // up is exact at the nodes it shares and linear between
    for (int row = 0; row < from; ++row) {
      for (int k = 0; k < from; ++k) {
        for (int c = 0; c < to; ++c) matrix_[row * from + k] += up.at(row, c) * down.at(c, k);
      }
    }
  }
  double at(int row, int column) const { return matrix_[row * n_ + column]; }
  double position(int k) const {  // [sigma]
    return n_ == 1 ? 0.0 : double{kTextureExtent} * (2.0 * k / (n_ - 1) - 1.0);
  }
  int size() const { return n_; }

 private:
  int n_;
  std::vector<double> matrix_;
};

struct Choice {
  glm::ivec2 size{0};
  double error = 0.0;  // weighted mean square times opacity^2
  int texels() const { return size.x * size.y; }
};

// Sides that a texture of n texels may have.
std::vector<int> sidesFor(int n) {
  std::vector<int> sides;
  for (int side = 1; side < n && side <= kLargestClass; side *= 2) sides.push_back(side);
  sides.push_back(n);
  return sides;
}

class Sizes {
 public:
  explicit Sizes(const GaussianModel& model) : model_(model) {
    for (const TextureRect& rect : model.atlas.rects) {
      if (rect.texelCount() == 0) continue;
      for (const int n : {int{rect.width}, int{rect.height}}) {
        if (projections_.count({n, 0}) != 0) continue;
        projections_[{n, 0}] = std::make_unique<Projection>(n, 0);
        for (const int side : sidesFor(n)) projections_[{n, side}] = std::make_unique<Projection>(n, side);
      }
    }
  }

  // All sizes of a Gaussian's texture, the fewest texels first; the first is none, the last its own.
  std::vector<Choice> choices(std::size_t i) const {
    const TextureRect& rect = model_.atlas.rects[i];
    std::vector<Choice> out = {choice(i, 0, 0)};
    for (const int w : sidesFor(rect.width)) {
      for (const int h : sidesFor(rect.height)) {
        if (w * h > 1) out.push_back(choice(i, w, h));
      }
    }
    if (rect.texelCount() == 1) out.push_back({{1, 1}, 0.0});
    std::sort(out.begin(), out.end(), [](const Choice& a, const Choice& b) {
      if (a.texels() != b.texels()) return a.texels() < b.texels();
      return a.error != b.error ? a.error < b.error : a.size.x < b.size.x;
    });
    return out;
  }

 private:
  Choice choice(std::size_t i, int w, int h) const {
    const TextureRect& rect = model_.atlas.rects[i];
    if (w == rect.width && h == rect.height) return {{w, h}, 0.0};
    const Projection& pu = *projections_.at({rect.width, w});
    const Projection& pv = *projections_.at({rect.height, h});
    const glm::vec4* texels = model_.atlas.texels.data() + rect.offset;
    const int nu = rect.width, nv = rect.height;
    std::vector<glm::dvec4> rows(static_cast<std::size_t>(nu) * nv, glm::dvec4(0.0));
    for (int v = 0; v < nv; ++v) {
      for (int u = 0; u < nu; ++u) {
        for (int k = 0; k < nu; ++k) rows[v * nu + u] += pu.at(u, k) * glm::dvec4(texels[v * nu + k]);
      }
    }
    double sum = 0.0, weights = 0.0;
    for (int v = 0; v < nv; ++v) {
      for (int u = 0; u < nu; ++u) {
        glm::dvec4 left = -glm::dvec4(texels[v * nu + u]);
        for (int k = 0; k < nv; ++k) left += pv.at(v, k) * rows[k * nu + u];
        const double weight = std::exp(-pu.position(u) * pu.position(u) - pv.position(v) * pv.position(v));
        double square = 0.0;
        if (hasColor(model_.texture_mode)) square += (left.r * left.r + left.g * left.g + left.b * left.b) / 3.0;
        if (hasAlpha(model_.texture_mode)) square += left.a * left.a;
        sum += weight * square;
        weights += weight;
      }
    }
    const double opacity = opacityOf(model_, i);
    return {{w, h}, opacity * opacity * sum / weights};
  }

  const GaussianModel& model_;
  std::map<std::pair<int, int>, std::unique_ptr<Projection>> projections_;
};

// Resizes; textures that go leave their mean in colour and opacity.
void giveSizes(GaussianModel& model, const std::vector<glm::ivec2>& sizes) {
  const GaussianModel base = bakeFallback(model, FallbackScale::kept);
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (model.atlas.rects[i].texelCount() == 0 || sizes[i].x != 0) continue;
    model.opacity_logit[i] = base.opacity_logit[i];
    model.sh[i * model.shCount()] = base.sh[i * model.shCount()];
  }
  const TextureAtlas from = std::move(model.atlas);
  model.atlas = resizedAtlas(from, sizes);
}

}  // namespace

void resizeTextures(GaussianModel& model, int width, int height) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  constexpr int kMaxSide = 1024;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
    throw Error(ErrorKind::usage, "wrong texture size (expected 1 to " + std::to_string(kMaxSide) + " a side, found " +
                                      std::to_string(width) + " x " + std::to_string(height) + ")");
  }
  const TextureAtlas from = std::move(model.atlas);
  std::vector<glm::ivec2> sizes(from.rects.size());
  for (std::size_t i = 0; i < from.rects.size(); ++i) {
    if (from.rects[i].texelCount() != 0) sizes[i] = {width, height};
  }
  model.atlas = resizedAtlas(from, sizes);
}

void fitTexturesToError(GaussianModel& model, double error) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  if (!(error >= 0.0)) throw Error(ErrorKind::usage, "wrong texture error (expected a number from 0 on)");
  if (!isTextured(model)) return;
  const Sizes sizes(model);
  std::vector<glm::ivec2> chosen(model.size(), glm::ivec2(0));
  parallelFor(static_cast<std::int64_t>(model.size()), 64, [&](std::int64_t item) {
    const std::size_t i = static_cast<std::size_t>(item);
    if (model.atlas.rects[i].texelCount() == 0) return;
    for (const Choice& choice : sizes.choices(i)) {
      if (choice.error > error * error) continue;
      chosen[i] = choice.size;
      break;
    }
  });
  giveSizes(model, chosen);
}

void fitTexturesToBudget(GaussianModel& model, std::uint64_t texels, std::span<const double> weights) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  TG_ASSERT(weights.size() == model.size(), "a weight a Gaussian");
  if (!isTextured(model)) return;
  const Sizes sizes(model);
  // Steps up the hull of (texels, error) of every texture, each better per texel than the next.
  struct Step {
    double gain = 0.0;  // per texel
    std::uint32_t gaussian = 0;
    std::uint32_t rank = 0;  // in the texture's hull
    glm::ivec2 size{0};
    int texels = 0;  // more than the step before
  };
  std::vector<std::vector<Step>> hulls(model.size());
  parallelFor(static_cast<std::int64_t>(model.size()), 64, [&](std::int64_t item) {
    const std::size_t i = static_cast<std::size_t>(item);
    if (model.atlas.rects[i].texelCount() == 0) return;
    const std::vector<Choice> choices = sizes.choices(i);
    for (std::size_t at = 0; at + 1 < choices.size();) {
      Step best;
      std::size_t next = choices.size();
      for (std::size_t k = at + 1; k < choices.size(); ++k) {
        const int more = choices[k].texels() - choices[at].texels();
        const double gain = (weights[i] + kUnseenWeight) * (choices[at].error - choices[k].error) / std::max(more, 1);
        if (more == 0 || gain <= 0.0 || gain < best.gain) continue;
        best = {gain, static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(hulls[i].size()), choices[k].size,
                more};
        next = k;
      }
      if (next == choices.size()) break;
      hulls[i].push_back(best);
      at = next;
    }
  });
  std::vector<Step> steps;
  for (const std::vector<Step>& hull : hulls) steps.insert(steps.end(), hull.begin(), hull.end());
  std::sort(steps.begin(), steps.end(), [](const Step& a, const Step& b) {
    if (a.gain != b.gain) return a.gain > b.gain;
    return a.gaussian != b.gaussian ? a.gaussian < b.gaussian : a.rank < b.rank;
  });
  std::vector<glm::ivec2> chosen(model.size(), glm::ivec2(0));
  std::vector<std::uint32_t> taken(model.size(), 0);
  std::uint64_t used = 0;
  for (const Step& step : steps) {
    // A step that does not fit ends its texture: the ones after it stand on it.
    if (taken[step.gaussian] != step.rank || used + static_cast<std::uint64_t>(step.texels) > texels) continue;
    used += static_cast<std::uint64_t>(step.texels);
    ++taken[step.gaussian];
    chosen[step.gaussian] = step.size;
  }
  giveSizes(model, chosen);
}

}  // namespace tg
