// SPDX-License-Identifier: Apache-2.0
// The session of a window: what it starts with, what a model brings with it, and what is kept at the end.
#pragma once
#include <glm/glm.hpp>

#include "viewer/view/options.h"
#include "viewer/view/scene.h"
#include "viewer/view/session.h"

namespace tg {

class WindowSession {
 public:
  // Reads options.session where there is one.
  explicit WindowSession(const ViewOptions& options);

  glm::ivec2 windowSize() const { return options_.size.value_or(loaded_.session.window); }
  // A fresh state, as options and session want it.
  void start(ViewerState& state) const;
  // Makes `scene` the one shown, with its bookmarks and the crop box of the options. An empty one: nothing is shown any
  // more.
  void adopt(ViewerState& state, Scene scene);
  // Writes the session; says on stderr when it cannot.
  void keep(const ViewerState& state, glm::ivec2 window);

 private:
  const ViewOptions options_;
  LoadedSession loaded_;
  const Session before_ = loaded_.session;
};

}  // namespace tg
