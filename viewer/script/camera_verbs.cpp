// SPDX-License-Identifier: Apache-2.0
// Script commands of cameras, bookmarks, paths and recordings.
#include <array>
#include <cmath>

#include "core/system/error.h"
#include "viewer/script/verb.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/parse.h"
#include "viewer/view/path_editor.h"

namespace tg {
namespace {

std::size_t parseKeyIndex(const ViewerState& state, const std::string& text, const std::string& what) {
  return parseIndex(text, state.path.path.keys.size(), what);
}

constexpr std::array kCameraVerbs = {
    Verb{"fov", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           s.camera.lens.fov_y = std::clamp(parseNumber(w[0], at) * kDegrees, kMinFov, kMaxFov);
           s.camera.index = -1;
         }},
    Verb{"camera", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           setCamera(s, cameraOf(w[0], s.scene.cameras, at));
         }},
    Verb{"orbit", 2, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           orbit(s.camera.pose, parseNumber(w[0], at) * kDegrees, parseNumber(w[1], at) * kDegrees);
           s.camera.index = -1;
         }},
    Verb{"dolly", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           dolly(s.camera.pose, parseNumber(w[0], at));
           s.camera.index = -1;
         }},
    Verb{"fly", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { s.camera.fly = parseSwitch(w[0], at); }},
    Verb{"up", 1, 0, [](ViewerState& s, const Words& w, const std::string& at) { setUp(s, parse<UpAxis>(w[0], at)); }},
    Verb{"turntable", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { s.camera.turntable = parseSwitch(w[0], at); }},
    Verb{"bookmark", 0, 0, [](ViewerState& s, const Words&, const std::string&) { addBookmark(s); }},
    Verb{"go-bookmark", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           goToBookmark(s, parseIndex(w[0], s.camera.bookmarks.size(), at));
         }},
    Verb{"save-bookmarks", 1, 0, [](ViewerState& s, const Words& w, const std::string&) { saveBookmarks(s, w[0]); }},
    Verb{"load-bookmarks", 1, 0, [](ViewerState& s, const Words& w, const std::string&) { readBookmarks(s, w[0]); }},
    Verb{"add-key", 0, 0, [](ViewerState& s, const Words&, const std::string&) { addKey(s); }},
    Verb{"replace-key", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { replaceKey(s, parseKeyIndex(s, w[0], at)); }},
    Verb{"delete-key", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { deleteKey(s, parseKeyIndex(s, w[0], at)); }},
    Verb{"show-key", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { showKey(s, parseKeyIndex(s, w[0], at)); }},
    Verb{"key-seconds", 2, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           const std::size_t key = parseKeyIndex(s, w[0], at);
           changeKeySeconds(s, key, parseNumber(w[1], 0, kMaxPathSeconds, at));
         }},
    Verb{"clear-path", 0, 0, [](ViewerState& s, const Words&, const std::string&) { clearPath(s); }},
    Verb{"play", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           if (parseSwitch(w[0], at) != s.path.playing) togglePlaying(s);
         }},
    Verb{"seek", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           seekPath(s, parseNumber(w[0], 0, kMaxPathSeconds, at));
         }},
    Verb{"path-lines", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { s.path.drawn = parseSwitch(w[0], at); }},
    Verb{"save-path", 1, 0, [](ViewerState& s, const Words& w, const std::string&) { savePath(s, w[0]); }},
    Verb{"save-keys", 1, 0, [](ViewerState& s, const Words& w, const std::string&) { saveKeyCameras(s, w[0]); }},
    Verb{"load-path", 1, 0, [](ViewerState& s, const Words& w, const std::string&) { readPathFile(s, w[0]); }},
    Verb{"record-size", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) { s.record.size = parseSize(w[0], at); }},
    Verb{"record-fps", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           s.record.fps = parseNumber(w[0], kMinFps, kMaxFps, at);
         }},
    Verb{"record-frames", 1, 0,
         [](ViewerState& s, const Words& w, const std::string& at) {
           s.record.turntable_frames = static_cast<int>(parseNumber(w[0], 1, double{kMaxPathFrames}, at));
         }},
    Verb{"record", 1, 1,
         [](ViewerState& s, const Words& w, const std::string&) {
           s.record.out = w[0];
           s.record.wanted = true;
         }},
    Verb{"cancel-recording", 0, 1, [](ViewerState& s, const Words&, const std::string&) { s.record.wanted = false; }},
    Verb{"await-recording", 0, 1, [](ViewerState&, const Words&, const std::string&) {},
         [](const ViewerState& s) { return !s.record.wanted; }},
};

}  // namespace

std::span<const Verb> cameraVerbs() { return kCameraVerbs; }

}  // namespace tg
