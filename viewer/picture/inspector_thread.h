// SPDX-License-Identifier: Apache-2.0
// Answers what the state asks about a pixel, beside everything else.
#pragma once
#include <memory>
#include <thread>
#include <vector>

#include "core/system/worker.h"
#include "viewer/view/state.h"

namespace tg {

// Inspects in a thread of its own, one pixel at a time.
class InspectorThread {
 public:
  InspectorThread();

  // Takes up what the state asks for, as a picture of that size, and hands over what is finished; true when that is
  // new. Throws what stopped the thread. Call once a frame.
  bool update(ViewerState& state, glm::ivec2 size);

 private:
  struct Inspection {
    Camera camera;
    glm::ivec2 pixel{0};
    std::shared_ptr<const GaussianModel> model;
    RenderSettings settings;
    std::vector<PixelHit> hits;
    bool turns = false;  // asked for a pivot
  };
  LatestValue<Inspection> asked_, answers_;
  bool busy_ = false;
  std::jthread thread_;
};

}  // namespace tg
