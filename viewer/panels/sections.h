// SPDX-License-Identifier: Apache-2.0
// The sections of the panel, and what lies over the picture; one function each, called once a frame.
#pragma once
#include <cstddef>
#include <string_view>

#include "viewer/panels/panels.h"

namespace tg {

// model.cpp
void modelSection(ViewerState& state);
// training.cpp
void trainingSection(ViewerState& state);
// documents.cpp
void documentsSection(ViewerState& state);
// The models opened before, each by `item`, whose click opens it.
void recentModels(ViewerState& state, bool (*item)(const char* label));
// compare.cpp
void compareSection(ViewerState& state);
// display.cpp
void outputSection(ViewerState& state);
void textureSection(ViewerState& state);
void settingSection(ViewerState& state, const char* title);
// The render settings of that heading: buttons for names, as many as go into a line, then sliders, two in a line where
// there are several. Returns the number of sliders.
std::size_t settingWidgets(ViewerState& state, std::string_view heading);
void scaleSection(ViewerState& state);
void backgroundSection(ViewerState& state);
void cropSection(ViewerState& state);
void levelSection(ViewerState& state);  // nothing where the scene has no levels
// camera.cpp
void cameraSection(ViewerState& state);
void motionSection(ViewerState& state);
void bookmarkSection(ViewerState& state);
// path.cpp
void keySection(ViewerState& state);
void pathFileSection(ViewerState& state);
void recordSection(ViewerState& state);
// inspect.cpp
void inspectSection(ViewerState& state);
// edit.cpp
void historySection(ViewerState& state);
void selectSection(ViewerState& state);
void valueSection(ViewerState& state);
void changeSection(ViewerState& state);
void saveSection(ViewerState& state);
// time.cpp
void timeSection(ViewerState& state, const FrameStatistics& statistics);
// edit_overlay.cpp
void editOverlay(const ViewerState& state, const PictureOnScreen& picture);
void toolOverlay(const ViewerState& state);
// menu.cpp: as the first line of the panel, and over the picture while that is hidden
void panelMenu(ViewerState& state);
void hiddenMenu(ViewerState& state);
bool closeInnermostList();  // false: none is open
// file_dialog.cpp; `escape`: it was pressed, and closes a dialog
void dialogs(ViewerState& state, bool escape);
// scene_overlay.cpp
void sceneOverlay(const ViewerState& state);
// What is drawn behind the panels until PopClipRect() stays within the picture.
void pushClipRect(const PictureOnScreen& picture);
// overlays.cpp
void overlays(ViewerState& state);

}  // namespace tg
