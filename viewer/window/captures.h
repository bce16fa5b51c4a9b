// SPDX-License-Identifier: Apache-2.0
// Writes what the state asks to be captured of a frame.
#pragma once
#include <filesystem>
#include <glm/glm.hpp>

#include "viewer/picture/picture.h"
#include "viewer/view/state.h"
#include "viewer/window/screen.h"

namespace tg {

// Between the screen's draw and present; clears state.capture, but for the dialog of a picture that
// could not be written. `picture`: the one on screen, may be null.
// `size`: of its camera [px]. Returns the file written last; empty: none. Throws Error: usage where there is no picture
// to save, cannotWrite, device.
std::filesystem::path writeCaptures(ViewerState& state, const Picture* picture, glm::ivec2 size, Screen& screen);

}  // namespace tg
