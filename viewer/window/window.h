// SPDX-License-Identifier: Apache-2.0
// The interactive viewer.
#pragma once
#include <span>

#include "viewer/model/loader.h"
#include "viewer/model/scene_streamer.h"
#include "viewer/script/verb.h"
#include "viewer/view/options.h"
#include "viewer/window/screen.h"

namespace tg {

// What another program than tgview puts into its window.
struct WindowAdditions {
  ScreenWrapper wrap_screen;    // each that opens; empty: as it is
  std::span<const Verb> verbs;  // of scripts, beside the viewer's own
  ModelReader read;             // of the models that are opened; empty: readModel
  LodReaderWrap wrap_levels;    // around the files of streamed scenes; empty: as they are
  double patience = 60;         // [s] of a script or benchmark with a window system that takes no image
};

// Opens the model and a window, and returns when it is closed. Throws Error of every kind; without a display
// Error(device) that names --render.
void runWindow(const ViewOptions& options, const WindowAdditions& additions = {});

}  // namespace tg
