// SPDX-License-Identifier: Apache-2.0
// tgview beside this program: on a run folder while it trains (--watch), or on a model.
#pragma once
#include <filesystem>

namespace tg {

// Before hours of training. Throws Error(device) when there is no tgview beside this program or no display to open its
// window on.
void requireViewer();

// Starts `tgview --follow FOLDER --photos DATASET` and returns at once. The window belongs to itself: Ctrl-C in the
// terminal does not close it, nor does the end of the training. Throws what requireViewer does.
void startViewer(const std::filesystem::path& folder, const std::filesystem::path& dataset);

// The same with a model that is there.
void showModel(const std::filesystem::path& model);
// Whether there is a tgview beside this program and a display.
bool canShow();

}  // namespace tg
