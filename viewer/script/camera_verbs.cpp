// SPDX-License-Identifier: Apache-2.0
// Script commands of cameras, bookmarks, paths and recordings.
#include <array>
#include <cmath>

#include "core/system/error.h"
#include "viewer/script/verb.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/path_editor.h"

namespace tg {
namespace {

constexpr std::array kCameraVerbs = {
    Verb{"fov", 1, 0,
         [](const Call& c) {
           c.state.camera.lens.fov_y = std::clamp(c.number(0) * kDegrees, kMinFov, kMaxFov);
           leaveCamera(c.state.camera);
         }},
    Verb{"camera", 1, 0, [](const Call& c) { goToCamera(c.state, c[0], c.what); }},
    Verb{"orbit", 2, 0,
         [](const Call& c) {
           orbit(c.state.camera.pose, c.number(0) * kDegrees, c.number(1) * kDegrees);
           leaveCamera(c.state.camera);
         }},
    Verb{"dolly", 1, 0,
         [](const Call& c) {
           dolly(c.state.camera.pose, c.number(0, 1e-3, 1e3));
           leaveCamera(c.state.camera);
         }},
    Verb{"fly", 1, 0, [](const Call& c) { c.state.camera.fly = c.on(); }},
    Verb{"up", 1, 0, [](const Call& c) { setUp(c.state, c.named<UpAxis>()); }},
    Verb{"turntable", 1, 0, [](const Call& c) { c.state.camera.turntable = c.on(); }},
    Verb{"bookmark", 0, 0, [](const Call& c) { addBookmark(c.state); }},
    Verb{"go-bookmark", 1, 0, [](const Call& c) { goToBookmark(c.state, c.index(c.state.camera.bookmarks.size())); }},
    Verb{"save-bookmarks", 1, 0, [](const Call& c) { saveBookmarks(c.state, c[0]); }},
    Verb{"load-bookmarks", 1, 0, [](const Call& c) { readBookmarks(c.state, c[0]); }},
    Verb{"add-key", 0, 0, [](const Call& c) { addKey(c.state); }},
    Verb{"replace-key", 1, 0, [](const Call& c) { replaceKey(c.state, c.index(c.state.path.path.keys.size())); }},
    Verb{"delete-key", 1, 0, [](const Call& c) { deleteKey(c.state, c.index(c.state.path.path.keys.size())); }},
    Verb{"show-key", 1, 0, [](const Call& c) { showKey(c.state, c.index(c.state.path.path.keys.size())); }},
    Verb{"key-seconds", 2, 0,
         [](const Call& c) {
           const std::size_t key = c.index(c.state.path.path.keys.size());
           changeKeySeconds(c.state, key, c.number(1, 0, kMaxPathSeconds));
         }},
    Verb{"clear-path", 0, 0, [](const Call& c) { clearPath(c.state); }},
    Verb{"play", 1, 0,
         [](const Call& c) {
           if (c.on() != c.state.path.playing) togglePlaying(c.state);
         }},
    Verb{"seek", 1, 0, [](const Call& c) { seekPath(c.state, c.number(0, 0, kMaxPathSeconds)); }},
    Verb{"path-lines", 1, 0, [](const Call& c) { c.state.path.drawn = c.on(); }},
    Verb{"save-path", 1, 0, [](const Call& c) { savePath(c.state, c[0]); }},
    Verb{"save-keys", 1, 0, [](const Call& c) { saveKeyCameras(c.state, c[0]); }},
    Verb{"load-path", 1, 0, [](const Call& c) { readPathFile(c.state, c[0]); }},
    Verb{"record-size", 1, 0, [](const Call& c) { c.state.record.size = parseSize(c[0], c.what); }},
    Verb{"record-fps", 1, 0, [](const Call& c) { c.state.record.fps = c.number(0, kMinFps, kMaxFps); }},
    Verb{"record-frames", 1, 0,
         [](const Call& c) { c.state.record.turntable_frames = static_cast<int>(c.count(0, 1, kMaxPathFrames)); }},
    Verb{"record", 1, 1,
         [](const Call& c) {
           if (c.state.record.wanted) {
             throw Error(ErrorKind::usage, c.what + ": a recording goes on (expected await-recording or " +
                                               "cancel-recording before it)");
           }
           c.state.record.out = c[0];
           c.state.record.wanted = true;
         }},
    Verb{"cancel-recording", 0, 1, [](const Call& c) { c.state.record.wanted = false; }},
    Verb{"await-recording", 0, 1, [](const Call&) {}, [](const ViewerState& s) { return !s.record.wanted; }},
};

}  // namespace

std::span<const Verb> cameraVerbs() { return kCameraVerbs; }

}  // namespace tg
