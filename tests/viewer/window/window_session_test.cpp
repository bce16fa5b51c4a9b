// SPDX-License-Identifier: Apache-2.0
// What a window begins with, without one.
#include "viewer/window/window_session.h"

#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace tg;

TEST_CASE("a benchmark draws what its command line asks for, not what the session was left with, and leaves that") {
  const TemporaryFolder folder;
  ViewOptions options;
  options.session = folder / "session.json";
  Session left;
  left.output = Output::depth;
  left.textures = TextureMode::alpha;
  left.panel = false;
  saveSession(left, options.session);
  for (const bool benchmark : {false, true}) {
    CAPTURE(benchmark);
    options.benchmark = benchmark;
    WindowSession session(options);
    ViewerState state;
    session.start(state);
    CHECK(state.display.output == (benchmark ? options.show : left.output));
    CHECK(state.display.settings.textures == (benchmark ? options.settings.textures : left.textures));
    CHECK_FALSE(state.ui.panel);
    session.keep(state, {640, 480});
    const LoadedSession kept = loadSession(options.session);
    CHECK(kept.problem.empty());
    CHECK(kept.session.output == left.output);
    CHECK(kept.session.textures == left.textures);
  }
}
