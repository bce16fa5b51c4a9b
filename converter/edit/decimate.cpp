// SPDX-License-Identifier: Apache-2.0
// Fewer Gaussians for nearly the same pictures.
#include "converter/edit/decimate.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "converter/edit/contribution.h"
#include "converter/edit/select.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

// Opacity times the area of the two longer axes [world units^2].
double solidArea(const GaussianModel& model, std::size_t i) {
  glm::dvec3 s(model.log_scale[i]);
  std::sort(&s[0], &s[0] + 3);
  return sigmoid(model.opacity_logit[i], std::exp(s.y + s.z));
}

}  // namespace

void decimate(GaussianModel& model, std::size_t count, std::span<const Camera> views) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  if (count == 0) throw Error(ErrorKind::usage, "decimation to no Gaussians at all (expected at least 1)");
  if (count >= model.size()) return;
  struct Rank {
    double weight, area;
    std::uint32_t gaussian;
  };
  const std::vector<double> weights = blendWeights(model, views);
  std::vector<Rank> ranks(model.size());
  for (std::size_t i = 0; i < ranks.size(); ++i) {
    ranks[i] = {weights[i], solidArea(model, i), static_cast<std::uint32_t>(i)};
  }
  const auto before = [](const Rank& a, const Rank& b) {
    if (a.weight != b.weight) return a.weight > b.weight;
    if (a.area != b.area) return a.area > b.area;
    return a.gaussian < b.gaussian;
  };
  std::nth_element(ranks.begin(), ranks.begin() + static_cast<std::ptrdiff_t>(count), ranks.end(), before);
  std::vector<std::uint8_t> keep(model.size(), 0);
  for (std::size_t r = 0; r < count; ++r) keep[ranks[r].gaussian] = 1;
  keepGaussians(model, keep);
}

}  // namespace tg
