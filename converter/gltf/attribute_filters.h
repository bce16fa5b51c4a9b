// SPDX-License-Identifier: Apache-2.0
// How many bits of each attribute a packed file keeps.
#pragma once
#include <array>

#include "converter/gltf/builder.h"
#include "core/model/model.h"

namespace tg {

struct AttributeFilters {
  MeshoptFilter position, rotation, scale, opacity, dc;
  std::array<MeshoptFilter, 16> sh;     // of coefficient l^2 + n; [0] is unused
  MeshoptFilter base_opacity, base_dc;  // of what other readers show in place of textures
};

// No filter, or with `quantize` what it stands for.
AttributeFilters wholeFilters(bool quantize);
// For numbers in steps, at 1 about as near to the model as SOG's (docs/lab/converter.md). The model has Gaussians.
AttributeFilters filtersInSteps(const GaussianModel& model, double steps);

}  // namespace tg
