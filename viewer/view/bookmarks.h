// SPDX-License-Identifier: Apache-2.0
// Views to come back to, of the model at hand. Their file is a cameras.json.
#pragma once
#include <filesystem>

#include "viewer/view/state.h"

namespace tg {

constexpr std::size_t kMaxBookmarks = 1000;

// The view at hand as a camera of that image height [px].
Camera currentCamera(const ViewerState& state, int height = 720);

// Adds the view at hand, named by a number that is free. Throws Error(usage) beyond kMaxBookmarks.
void addBookmark(ViewerState& state);
void removeBookmark(ViewerState& state, std::size_t index);
void goToBookmark(ViewerState& state, std::size_t index);  // below the number of bookmarks
// With names and splits, which Camera's own == leaves out.
bool sameBookmarks(const std::vector<Camera>& a, const std::vector<Camera>& b);
void stepBookmark(ViewerState& state, int step);  // the next, or the one before; says so when there is none

// Throw Error: cannotWrite; cannotRead, badData. Reading replaces what there is.
void saveBookmarks(const ViewerState& state, const std::filesystem::path& file);
void readBookmarks(ViewerState& state, const std::filesystem::path& file);
void loadBookmarks(ViewerState& state, const std::filesystem::path& file);  // and says how many they are
// `file`, with .json behind it where it ends otherwise.
std::string withJson(const std::filesystem::path& file);

}  // namespace tg
