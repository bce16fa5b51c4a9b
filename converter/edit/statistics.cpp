// SPDX-License-Identifier: Apache-2.0
// How the numbers of a model are distributed.
#include "converter/edit/statistics.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "shared/limits.h"

namespace tg {
namespace {

Distribution distributionOf(std::string name, std::string unit, std::vector<float> values) {
  Distribution d;
  d.name = std::move(name);
  d.unit = std::move(unit);
  d.count = values.size();
  if (values.empty()) return d;
  d.mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  std::sort(values.begin(), values.end());
  // The value at or below which the fraction of all lies.
  const auto at = [&](double fraction) {
    const double rank = std::ceil(fraction * static_cast<double>(values.size()));
    return static_cast<double>(values[static_cast<std::size_t>(std::max(rank, 1.0)) - 1]);
  };
  d.low = values.front();
  d.p1 = at(0.01);
  d.median = at(0.5);
  d.p99 = at(0.99);
  d.high = values.back();
  return d;
}

}  // namespace

std::vector<Distribution> distributions(const GaussianModel& model) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  std::vector<Distribution> out;
  const std::size_t n = model.size();
  if (n == 0) return out;
  const auto add = [&](const char* name, const char* unit, auto value) {
    std::vector<float> values(n);
    for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<float>(value(i));
    out.push_back(distributionOf(name, unit, std::move(values)));
  };
  const auto scale = [&](std::size_t i, int rank) {  // 0: the shortest
    glm::vec3 s = model.log_scale[i];
    std::sort(&s[0], &s[0] + 3);
    return std::exp(static_cast<double>(s[rank]));
  };
  constexpr const char* kWorld = "world units";
  add("x", kWorld, [&](std::size_t i) { return model.mean[i].x; });
  add("y", kWorld, [&](std::size_t i) { return model.mean[i].y; });
  add("z", kWorld, [&](std::size_t i) { return model.mean[i].z; });
  add("shortest scale", kWorld, [&](std::size_t i) { return scale(i, 0); });
  add("middle scale", kWorld, [&](std::size_t i) { return scale(i, 1); });
  add("longest scale", kWorld, [&](std::size_t i) { return scale(i, 2); });
  add("opacity", "", [&](std::size_t i) { return opacityOf(model, i); });
  const std::size_t coefficients = model.shCount();
  const char* channels[] = {"red", "green", "blue"};
  for (int c = 0; c < 3; ++c) {
    add(channels[c], "", [&](std::size_t i) { return 0.5f + kShC0 * model.sh[i * coefficients][c]; });
  }
  if (coefficients > 1) {
    add("largest SH coefficient", "", [&](std::size_t i) {
      float largest = 0.0f;
      for (std::size_t k = 1; k < coefficients; ++k) {
        for (int c = 0; c < 3; ++c) largest = std::max(largest, std::abs(model.sh[i * coefficients + k][c]));
      }
      return largest;
    });
  }
  if (!isTextured(model)) return out;

  std::vector<float> width, height;
  for (const TextureRect& rect : model.atlas.rects) {
    if (rect.texelCount() == 0) continue;
    width.push_back(rect.width);
    height.push_back(rect.height);
  }
  out.push_back(distributionOf("texture width", "texels", std::move(width)));
  out.push_back(distributionOf("texture height", "texels", std::move(height)));
  const char* terms[] = {"texel red", "texel green", "texel blue", "texel alpha"};
  for (int c = 0; c < 4; ++c) {
    if (!(c == 3 ? hasAlpha(model.texture_mode) : hasColor(model.texture_mode))) continue;
    std::vector<float> values;
    for (const TextureRect& rect : model.atlas.rects) {
      for (std::uint32_t t = 0; t < rect.texelCount(); ++t) values.push_back(model.atlas.texels[rect.offset + t][c]);
    }
    out.push_back(distributionOf(terms[c], "", std::move(values)));
  }
  return out;
}

}  // namespace tg
