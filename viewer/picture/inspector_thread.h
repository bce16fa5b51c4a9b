// SPDX-License-Identifier: Apache-2.0
// Answers what the state asks about a pixel, beside everything else.
#pragma once
#include <future>
#include <memory>
#include <vector>

#include "viewer/view/state.h"

namespace tg {

// Inspects in a thread of its own, one pixel at a time.
class InspectorThread {
 public:
  // Takes up what the state asks for, as a picture of that size, and hands over what is finished; true when that is
  // new. Call once a frame.
  bool update(ViewerState& state, glm::ivec2 size);

 private:
  struct Answer {
    Camera camera;
    glm::ivec2 pixel{0};
    std::shared_ptr<const GaussianModel> model;
    std::vector<PixelHit> hits;
  };
  std::future<Answer> answer_;
};

}  // namespace tg
