// SPDX-License-Identifier: Apache-2.0
// The sections of the panel, and what lies over the picture; one function each, called once a frame.
#pragma once
#include "viewer/panels/panels.h"

namespace tg {

// model.cpp
void modelSection(ViewerState& state);
// documents.cpp
void documentsSection(ViewerState& state);
// compare.cpp
void compareSection(ViewerState& state);
// display.cpp
void outputSection(ViewerState& state);
void textureSection(ViewerState& state);
void intersectionSection(ViewerState& state);
void blendSection(ViewerState& state);
void scaleSection(ViewerState& state);
void backgroundSection(ViewerState& state);
void cropSection(ViewerState& state);
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
// time.cpp
void timeSection(ViewerState& state, const FrameStatistics& statistics);
// scene_overlay.cpp
void sceneOverlay(const ViewerState& state);
// overlays.cpp
void overlays(ViewerState& state);

}  // namespace tg
