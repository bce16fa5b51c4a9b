// SPDX-License-Identifier: Apache-2.0
// Changes of a model's Gaussians that can be taken back: what they do is the converter's, what they keep is no more
// than the numbers that they replace.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "converter/edit/transform.h"
#include "core/model/camera.h"
#include "core/model/model.h"

namespace tg {

struct ModelEdit {
  bool erases = false;               // else it moves, turns and scales
  std::vector<std::uint32_t> which;  // ascending, at least one
  Similarity similarity;
  bool moves_cameras = false;  // with the whole model
  // Filled by applied(), read by takenBack().
  GaussianModel erased;
  GaussianFields<Values> before;  // rows of `which`; empty columns: not changed
};
using ModelPtr = std::shared_ptr<const GaussianModel>;

// The model after the edit; `known`: that model, where it was made before by transformGaussians(). Throws
// Error(badData) when floats cannot hold it.
ModelPtr applied(const GaussianModel& model, ModelEdit& edit, const ModelPtr& known = nullptr);
// The same once more, of the model that it was made for.
ModelPtr appliedAgain(const GaussianModel& model, const ModelEdit& edit);
// The model before it, bit for bit. `model`: what applied() returned.
ModelPtr takenBack(const GaussianModel& model, const ModelEdit& edit);
std::uint64_t bytesOf(const ModelEdit& edit);

}  // namespace tg
