// SPDX-License-Identifier: Apache-2.0
// Bookmarks are cameras: they go to files and back without loss.
#include "viewer/view/bookmarks.h"

#include <algorithm>

#include "core/bundle/camera_file.h"
#include "core/file/file.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"

namespace tg {

Camera currentCamera(const ViewerState& state, int height) {
  TG_ASSERT(height > 0 && state.camera.aspect > 0, "a picture has pixels");
  // Rounded down: coming back to it in the same window then changes nothing, lensOf sees to the rest.
  const int width = std::max(static_cast<int>(height * state.camera.aspect), 1);
  return toCamera(state.camera.pose, state.camera.lens, width, height);
}

void addBookmark(ViewerState& state) {
  std::vector<Camera>& bookmarks = state.camera.bookmarks;
  if (bookmarks.size() >= kMaxBookmarks) {
    throw Error(ErrorKind::usage,
                "there are too many bookmarks (expected at most " + std::to_string(kMaxBookmarks) + ")");
  }
  Camera camera = currentCamera(state);
  const auto taken = [&bookmarks](const std::string& name) {
    return std::any_of(bookmarks.begin(), bookmarks.end(), [&](const Camera& b) { return b.name == name; });
  };
  std::size_t number = bookmarks.size() + 1;
  while (taken("view " + std::to_string(number))) ++number;
  camera.name = "view " + std::to_string(number);
  bookmarks.push_back(camera);
  state.camera.bookmark = static_cast<int>(bookmarks.size()) - 1;
  notify(state, "Bookmark: " + camera.name);
}

void removeBookmark(ViewerState& state, std::size_t index) {
  TG_ASSERT(index < state.camera.bookmarks.size(), "there is this bookmark");
  state.camera.bookmarks.erase(state.camera.bookmarks.begin() + static_cast<std::ptrdiff_t>(index));
  if (state.camera.bookmark > static_cast<int>(index)) --state.camera.bookmark;
  state.camera.bookmark = std::min(state.camera.bookmark, static_cast<int>(state.camera.bookmarks.size()) - 1);
}

void goToBookmark(ViewerState& state, std::size_t index) {
  TG_ASSERT(index < state.camera.bookmarks.size(), "there is this bookmark");
  setCamera(state, state.camera.bookmarks.at(index));
  state.path.playing = false;
  state.camera.bookmark = static_cast<int>(index);
}

bool sameBookmarks(const std::vector<Camera>& a, const std::vector<Camera>& b) {
  return std::ranges::equal(
      a, b, [](const Camera& x, const Camera& y) { return x == y && x.name == y.name && x.test == y.test; });
}

void stepBookmark(ViewerState& state, int step) {
  const int count = static_cast<int>(state.camera.bookmarks.size());
  if (count == 0) return notify(state, "No bookmarks yet: Shift+B sets one");
  const int from = state.camera.bookmark >= 0 ? state.camera.bookmark : (step > 0 ? -1 : 0);
  goToBookmark(state, static_cast<std::size_t>((from + step + count) % count));
  notify(state, state.camera.bookmarks[static_cast<std::size_t>(state.camera.bookmark)].name);
}

void saveBookmarks(const ViewerState& state, const std::filesystem::path& file) {
  writeTextAtomically(file, formatCameras(state.camera.bookmarks));
}

void readBookmarks(ViewerState& state, const std::filesystem::path& file) {
  std::vector<Camera> cameras = readCameras(file);
  if (cameras.size() > kMaxBookmarks) {
    throw Error(ErrorKind::badData, file.string(),
                "too many bookmarks (expected at most " + std::to_string(kMaxBookmarks) + ", found " +
                    std::to_string(cameras.size()) + ")");
  }
  if (!sameBookmarks(state.camera.bookmarks, cameras)) {
    state.camera.bookmarks = std::move(cameras);
    state.camera.bookmark = -1;
  }
  noteBookmarksKept(state);
}

void loadBookmarks(ViewerState& state, const std::filesystem::path& file) {
  readBookmarks(state, file);
  const std::size_t count = state.camera.bookmarks.size();
  notify(state,
         std::to_string(count) + (count == 1 ? " bookmark" : " bookmarks") + " from " + file.filename().string());
}

std::string withJson(const std::filesystem::path& file) {
  return lowerExtension(file) == ".json" || file.filename().empty() ? file.string() : file.string() + ".json";
}

}  // namespace tg
