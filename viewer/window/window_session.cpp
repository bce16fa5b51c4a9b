// SPDX-License-Identifier: Apache-2.0
// Between the session's file and the state.
#include "viewer/window/window_session.h"

#include <cstdio>
#include <utility>

#include "core/system/error.h"

namespace tg {

WindowSession::WindowSession(const ViewOptions& options) : options_(options), loaded_(loadSession(options.session)) {}

void WindowSession::start(ViewerState& state) const {
  const Session& session = loaded_.session;
  const bool kept = !options_.session.empty();
  state.ui.panel = session.panel;
  state.ui.panel_width = session.panel_width;
  state.desktop.bookmarks_kept = kept;
  state.ui.tab = session.tab;
  state.camera.speed = session.speed;
  state.camera.fly = session.fly;
  state.camera.up = options_.up;
  state.recent = session.recent;
  state.messages.error = loaded_.problem;
  state.display.settings = options_.settings;
  state.display.settings.crop.reset();  // set with the model
  // A benchmark's figures are of what its command line asks for.
  const bool as_left = kept && !options_.benchmark;
  state.display.output = as_left && !options_.show_given ? session.output : options_.show;
  if (as_left && !options_.textures_given) state.display.settings.textures = session.textures;
}

void WindowSession::adopt(ViewerState& state, Scene scene) {
  Session& session = loaded_.session;
  if (!state.scene.path.empty()) keepBookmarks(session, state.scene.path, state.camera.bookmarks);
  setScene(state, std::move(scene));
  if (state.scene.path.empty()) return;
  state.camera.bookmarks = bookmarksOf(session, state.scene.path);
  noteBookmarksKept(state);
  session.recent = state.recent;  // which the user may have cleared
  noteRecent(session, state.scene.path);
  if (!options_.session.empty()) state.recent = session.recent;
  if (!options_.settings.crop) return;
  state.display.box = *options_.settings.crop;
  state.display.crop = true;
}

void WindowSession::keep(const ViewerState& state, glm::ivec2 window) {
  if (options_.session.empty()) return;
  Session& session = loaded_.session;
  if (!state.scene.path.empty()) keepBookmarks(session, state.scene.path, state.camera.bookmarks);
  session.window = window;
  session.panel = state.ui.panel;
  session.panel_width = state.ui.panel_width;
  session.recent = state.recent;
  session.tab = state.ui.tab;
  if (!options_.benchmark) {
    session.output = state.display.output;
    session.textures = state.display.settings.textures;
  }
  session.speed = state.camera.speed;
  session.fly = state.camera.fly;
  try {
    const LoadedSession now = loadSession(options_.session);
    saveSession(now.problem.empty() ? withOthers(session, before_, now.session) : session, options_.session);
  } catch (const Error& error) {
    std::fprintf(stderr, "tgview: %s\n", error.what());  // the work is done: no reason to fail
  }
}

}  // namespace tg
