// SPDX-License-Identifier: Apache-2.0
// How the numbers of a model are distributed.
#pragma once
#include <string>
#include <vector>

#include "core/model/model.h"

namespace tg {

struct Distribution {
  std::string name;  // "opacity"
  std::string unit;  // "", "world units", "texels"
  std::size_t count = 0;
  double low = 0, p1 = 0, median = 0, p99 = 0, high = 0, mean = 0;
};

// Positions, scales, shape, opacity, colours and, where there are textures, their sides and texels. Nothing for an
// empty model.
std::vector<Distribution> distributions(const GaussianModel& model);

}  // namespace tg
