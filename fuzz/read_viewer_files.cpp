// SPDX-License-Identifier: Apache-2.0
// Any text is one of the viewer's files or an Error, and what was read survives being written: the session, a camera
// path (also from a cameras.json), a script, which also runs. The first byte chooses the reader.
#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>

#include "core/system/error.h"
#include "viewer/script/script.h"
#include "viewer/view/camera_path.h"
#include "viewer/view/path_editor.h"
#include "viewer/view/scene_lines.h"
#include "viewer/view/session.h"

namespace {

void readSession(const std::string& text) {
  const std::string written = tg::formatSession(tg::parseSession(text, "session.json"));
  if (tg::formatSession(tg::parseSession(written, "again.json")) != written) std::abort();
}

void readPath(const std::string& text) {
  const tg::CameraPath path = tg::parsePath(text, "path.json");
  const tg::CameraPath again = tg::parsePath(tg::formatPath(path), "again.json");
  if (again.keys.size() != path.keys.size()) std::abort();
  const double seconds = tg::duration(path);
  for (const double part : {0.0, 0.3, 1.0}) {
    const tg::PathKey key = tg::at(path, part * seconds);
    for (int k = 0; k < 3; ++k) {
      if (!std::isfinite(key.position[k])) std::abort();
    }
    tg::toCamera(key, path.aspect, 64, 48);
  }
}

// Would read or write files, or wait for one.
bool touchesFiles(const tg::ScriptCommand& command) {
  const std::string& verb = command.verb;
  return verb.starts_with("save-") || verb.starts_with("load-") || verb == "await-file" ||
         (verb == "camera" && command.words[0].find_first_not_of("0123456789") != std::string::npos);
}

// A hundred frames of a window with two models, as far as the state goes.
void runScript(const std::string& text) {
  tg::Script script = tg::parseScript(text, "script.txt");
  std::erase_if(script.commands, touchesFiles);
  tg::GaussianModel model;
  model.mean.emplace_back(0.0f);
  model.rotation.emplace_back(1.0f, 0.0f, 0.0f, 0.0f);
  model.log_scale.emplace_back(-3.0f);
  model.opacity_logit.push_back(1.0f);
  model.sh.resize(model.shCount());
  tg::Scene scene;
  scene.bounds = tg::sceneBounds(model);
  scene.model = std::make_shared<const tg::GaussianModel>(std::move(model));
  scene.cameras.assign(2, tg::lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48));
  tg::ViewerState state;
  tg::setScene(state, scene);
  for (const char* path : {"a.tgz", "b.tgz"}) {
    tg::Document& document = state.documents.open.emplace_back();
    document.path = path;
    document.scene = scene;
  }
  state.documents.shown = 0;
  for (int frame = 0; frame < 100 && !state.quit; ++frame) {
    state.time += 1;
    (void)tg::step(script, state);
    (void)tg::advance(state, 0.1);
    (void)tg::toCamera(state.camera.pose, state.camera.lens, 64, 48);
    (void)tg::sceneLines(state);
    tg::checkSettings(tg::effectiveSettings(state));
    // What the window takes up.
    state.documents.open_requests.clear();
    state.capture = {};
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data + 1), size - 1);
  try {
    switch (data[0]) {
      case 0:
        readSession(text);
        break;
      case 1:
        readPath(text);
        break;
      case 2:
        runScript(text);
        break;
      default:
        break;
    }
  } catch (const tg::Error&) {
  }
  return 0;
}
