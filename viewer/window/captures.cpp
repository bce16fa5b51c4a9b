// SPDX-License-Identifier: Apache-2.0
// Pictures, windows and cameras to files.
#include "viewer/window/captures.h"

#include <string>
#include <utility>

#include "core/bundle/camera_file.h"
#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/system/error.h"

namespace tg {
namespace {

// As --render with the same comparison writes it.
Image pictureOnScreen(const Picture& picture, const Comparison& how, Screen& screen) {
  if (picture.pair) return composed(picture.pair->first, picture.pair->other, picture.pair->mask, how);
  return screen.read(*picture.image);
}

}  // namespace

std::filesystem::path writeCaptures(ViewerState& state, const Picture* picture, glm::ivec2 size, Screen& screen) {
  const CaptureRequest capture = std::exchange(state.capture, {});
  std::filesystem::path saved;
  if (!capture.picture.empty()) {
    if (!picture) throw Error(ErrorKind::usage, "there is no picture to save: open a model");
    state.capture.dialog = capture.dialog;  // of what is being written
    writeDrawn(capture.picture, pictureOnScreen(*picture, state.compare.how, screen));
    state.capture.dialog.reset();
    saved = capture.picture;
  }
  if (!capture.window.empty()) {
    writeDrawn(capture.window, screen.readWindow());
    saved = capture.window;
  }
  if (!capture.camera.empty()) {
    Camera camera = toCamera(state.camera.pose, state.camera.lens, size.x, size.y);
    camera.name = state.scene.path.stem().string();
    writeTextAtomically(capture.camera, formatCameras({camera}));
    saved = capture.camera;
  }
  return saved;
}

}  // namespace tg
