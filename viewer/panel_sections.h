// SPDX-License-Identifier: Apache-2.0
// The sections of the panel, and what lies over the picture; one function each, called once a frame.
#pragma once
#include "viewer/panels.h"

namespace tg {

// panels_model.cpp
void modelSection(ViewerState& state);
// panels_documents.cpp
void documentsSection(ViewerState& state);
// panels_compare.cpp
void compareSection(ViewerState& state);
// panels_display.cpp
void outputSection(ViewerState& state);
void textureSection(ViewerState& state);
void intersectionSection(ViewerState& state);
void backgroundSection(ViewerState& state);
// panels_camera.cpp
void cameraSection(ViewerState& state);
// panels_time.cpp
void timeSection(ViewerState& state, const FrameStatistics& statistics);
// overlays.cpp
void overlays(ViewerState& state);

}  // namespace tg
