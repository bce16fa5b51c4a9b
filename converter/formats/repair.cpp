// SPDX-License-Identifier: Apache-2.0
// A model of a file that holds more than models do.
#include "converter/formats/repair.h"

#include <cstdint>
#include <span>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

// Of a quaternion with finite members, not all of them 0.
glm::vec4 withLength(glm::vec4 q) {
  if (hasLength(q)) return q;
  return q / std::max({std::abs(q.x), std::abs(q.y), std::abs(q.z), std::abs(q.w)});
}

}  // namespace

static_assert(kFieldCount == 5, "mendSplats() does not know it");

void mendSplats(GaussianModel& model, const std::string& path, std::vector<std::string>& repairs) {
  TG_ASSERT(lengthsAgree(model) && model.atlas.rects.empty(), "a model without textures");
  std::vector<std::uint32_t> kept;
  std::size_t directionless = 0;
  const std::size_t sh_count = model.shCount();
  for (std::size_t i = 0; i < model.size(); ++i) {
    glm::vec4& q = model.rotation[i];
    float& logit = model.opacity_logit[i];
    if (std::isinf(logit)) logit = std::copysign(static_cast<float>(kLogitLimit), logit);
    model.log_scale[i] = withoutZeroScales(model.log_scale[i]);
    const std::span sh = std::span(model.sh).subspan(i * sh_count, sh_count);
    if (!allFinite(model.mean[i]) || !allFinite(model.log_scale[i]) || !allFinite(glm::vec3(q)) ||
        !std::isfinite(q.w) || !std::isfinite(logit) || !std::ranges::all_of(sh, allFinite)) {
      continue;
    }
    if (q == glm::vec4(0.0f)) {
      ++directionless;
      q.x = 1.0f;
    }
    q = withLength(q);
    kept.push_back(static_cast<std::uint32_t>(i));
  }
  if (kept.empty()) throw Error(ErrorKind::badData, path, "no splat is left: none had finite values");
  addSplatCount(repairs, model.size() - kept.size(), kDroppedSplat);
  addSplatCount(repairs, directionless, kDirectionlessSplat);
  if (kept.size() < model.size()) model = select(model, kept);
}

}  // namespace tg
