// SPDX-License-Identifier: Apache-2.0
// Edits of the path keep what is shown and what is played in step with it.
#include "viewer/view/path_editor.h"

#include <algorithm>
#include <cmath>

#include "core/bundle/camera_file.h"
#include "core/file/file.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "viewer/view/bookmarks.h"

namespace tg {
namespace {

constexpr int kKeyRows = 720;  // [px] of the cameras that stand for keys: any, the lens is what counts

PathKey currentKey(const ViewerState& state) {
  const Camera camera = currentCamera(state, kKeyRows);
  // The path's first key sets its aspect; later ones are seen as the window at that shape would show them.
  return state.path.path.keys.empty() ? keyOf(camera, 0) : keyOf(camera, 0, state.path.path.aspect);
}

void show(ViewerState& state, const PathKey& key) {
  // As keyCameras: the lens is kept although the pixels miss the aspect by a little.
  const int width = std::max(static_cast<int>(kKeyRows * state.path.path.aspect), 1);
  setCamera(state, toCamera(key, static_cast<double>(width) / kKeyRows, width, kKeyRows));
}

}  // namespace

void addKey(ViewerState& state) {
  PathState& editor = state.path;
  if (editor.path.keys.empty()) editor.path.aspect = state.camera.aspect;
  appendKey(editor.path, currentKey(state), editor.key_seconds);
  editor.key = static_cast<int>(editor.path.keys.size()) - 1;
  editor.at = editor.path.keys.back().time - editor.path.keys.front().time;
  editor.playing = false;
  notify(state, "Key " + std::to_string(editor.key) + " of the path");
}

void replaceKey(ViewerState& state, std::size_t index) {
  TG_ASSERT(index < state.path.path.keys.size(), "the path has this key");
  PathKey& key = state.path.path.keys.at(index);
  const double time = key.time;
  key = currentKey(state);
  key.time = time;
  state.path.playing = false;
}

void deleteKey(ViewerState& state, std::size_t index) {
  TG_ASSERT(index < state.path.path.keys.size(), "the path has this key");
  PathState& editor = state.path;
  removeKey(editor.path, index);
  if (editor.key > static_cast<int>(index)) --editor.key;
  editor.key = std::min(editor.key, static_cast<int>(editor.path.keys.size()) - 1);
  editor.at = std::clamp(editor.at, 0.0, duration(editor.path));
  editor.playing = false;
}

void showKey(ViewerState& state, std::size_t index) {
  TG_ASSERT(index < state.path.path.keys.size(), "the path has this key");
  seekPath(state, state.path.path.keys.at(index).time - state.path.path.keys.front().time);
  state.path.key = static_cast<int>(index);
}

void changeKeySeconds(ViewerState& state, std::size_t index, double seconds) {
  TG_ASSERT(index < state.path.path.keys.size(), "the path has this key");
  if (!(seconds <= kMaxPathSeconds)) seconds = kMaxPathSeconds;
  setKeySeconds(state.path.path, index, seconds);
  state.path.at = std::clamp(state.path.at, 0.0, duration(state.path.path));
}

void clearPath(ViewerState& state) {
  state.path.path = {};
  state.path.playing = false;
  state.path.at = 0;
  state.path.key = -1;
}

void togglePlaying(ViewerState& state) {
  PathState& editor = state.path;
  if (editor.path.keys.size() < 2) return notify(state, "A path needs two keys: K adds one at the view");
  editor.playing = !editor.playing;
  if (!editor.playing) return;
  state.camera.turntable = false;
  if (editor.path.closing == 0 && editor.at >= duration(editor.path)) editor.at = 0;
}

void seekPath(ViewerState& state, double seconds) {
  PathState& editor = state.path;
  if (editor.path.keys.empty()) return;
  editor.at = std::clamp(seconds, 0.0, duration(editor.path));
  editor.playing = false;
  show(state, at(editor.path, editor.at));
}

void setUp(ViewerState& state, UpAxis axis) {
  state.camera.up = axis;
  state.camera.pose = leveled(state.camera.pose, upOf(state));
  leaveCamera(state.camera);
}

bool advance(ViewerState& state, double seconds) {
  TG_ASSERT(seconds >= 0, "time goes on");
  PathState& editor = state.path;
  if (editor.playing) {
    const double whole = duration(editor.path);
    editor.at += seconds;
    if (editor.path.closing > 0) {
      editor.at = std::fmod(editor.at, whole);
    } else if (editor.at >= whole) {
      editor.at = whole;
      editor.playing = false;
    }
    show(state, at(editor.path, editor.at));
    return true;
  }
  if (state.camera.turntable && seconds > 0) {
    orbit(state.camera.pose, state.camera.turntable_speed * seconds, 0);
    leaveCamera(state.camera);
    return true;
  }
  return false;
}

bool movesByItself(const ViewerState& state) { return state.camera.turntable || state.path.playing; }

void toggleRecording(ViewerState& state) {
  RecordState& record = state.record;
  record.wanted = !record.wanted && mayReplace(state, record.out, "recording");
}

void savePath(const ViewerState& state, const std::filesystem::path& file) {
  if (state.path.path.keys.empty()) throw Error(ErrorKind::usage, "there is no path to save (expected a key or more)");
  writeTextAtomically(file, formatPath(state.path.path));
}

void saveKeyCameras(const ViewerState& state, const std::filesystem::path& file) {
  if (state.path.path.keys.empty()) throw Error(ErrorKind::usage, "there is no path to save (expected a key or more)");
  writeTextAtomically(file, formatCameras(keyCameras(state.path.path, kKeyRows)));
}

void readPathFile(ViewerState& state, const std::filesystem::path& file) {
  CameraPath path = readPath(file);
  clearPath(state);
  state.path.path = std::move(path);
  notePathKept(state);
}

void loadPath(ViewerState& state, const std::filesystem::path& file) {
  readPathFile(state, file);
  const std::size_t count = state.path.path.keys.size();
  notify(state, std::to_string(count) + (count == 1 ? " key" : " keys") + " from " + file.filename().string());
}

bool recordsPath(const ViewerState& state) { return state.path.path.keys.size() >= 2; }

std::vector<Camera> recordCameras(const ViewerState& state, glm::ivec2 size) {
  if (recordsPath(state)) return pathCameras(state.path.path, state.record.fps, size.x, size.y);
  const Lens lens = lensOf(currentCamera(state), static_cast<double>(size.x) / size.y);
  return turntableCameras(state.camera.pose, lens, state.record.turntable_frames, size.x, size.y);
}

}  // namespace tg
