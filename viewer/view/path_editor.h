// SPDX-License-Identifier: Apache-2.0
// The camera path in the window: keys from the view at hand, playing, files; and what moves the camera by itself.
#pragma once
#include <filesystem>

#include "viewer/view/state.h"

namespace tg {

// A key at the view at hand, key_seconds after the last one. Throws Error(usage) when the path is full.
void addKey(ViewerState& state);
// The next four: `index` below the number of keys.
void replaceKey(ViewerState& state, std::size_t index);  // by the view at hand; its time stays
void deleteKey(ViewerState& state, std::size_t index);
void showKey(ViewerState& state, std::size_t index);
void changeKeySeconds(ViewerState& state, std::size_t index, double seconds);  // of the last key: the way back; 0: open
void clearPath(ViewerState& state);

// From where it stands, or from the start when it stands at the end. Says so when there are fewer than two keys.
void togglePlaying(ViewerState& state);
void seekPath(ViewerState& state, double seconds);  // shows the view there

void setUp(ViewerState& state, UpAxis axis);  // keeps position and pivot

// What time does: the turntable turns, the path plays. Returns whether the camera moved.
bool advance(ViewerState& state, double seconds);
// Whether it would: the path plays, or the turntable is on.
bool movesByItself(const ViewerState& state);

// Begins a recording, or cancels the one that goes on. A video that is there is replaced only when asked twice.
void toggleRecording(ViewerState& state);

// Throw Error: cannotWrite; cannotRead, badData. Reading replaces the path.
void savePath(const ViewerState& state, const std::filesystem::path& file);
void saveKeyCameras(const ViewerState& state, const std::filesystem::path& file);  // as a cameras.json
void readPathFile(ViewerState& state, const std::filesystem::path& file);
void loadPath(ViewerState& state, const std::filesystem::path& file);  // and says of how many keys

// What a recording of the state would draw: the path where it has two keys, else a turn around the pivot.
bool recordsPath(const ViewerState& state);
std::vector<Camera> recordCameras(const ViewerState& state, glm::ivec2 size);

}  // namespace tg
