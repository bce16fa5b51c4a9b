// SPDX-License-Identifier: Apache-2.0
// --timings: from the start of the program to the pictures of the first model.
#pragma once
#include <chrono>

#include "viewer/model/open_models.h"

namespace tg {

class LoadTimings {
 public:
  explicit LoadTimings(std::chrono::steady_clock::time_point started) : started_(started) {}

  // Once per picture that has come. `whole`: it shows all of the model at full size; the first such one is printed to
  // stdout, with the first of all.
  void take(bool whole, const Scene& scene, const OpenModels& documents);

 private:
  const std::chrono::steady_clock::time_point started_;
  double first_ = 0;      // [s] from the start to the first picture; 0: not yet
  double first_cpu_ = 0;  // [s] of the process until then
  bool printed_ = false;
};

}  // namespace tg
