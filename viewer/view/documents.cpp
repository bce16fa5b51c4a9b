// SPDX-License-Identifier: Apache-2.0
// The list of open models.
#include "viewer/view/documents.h"

#include <algorithm>
#include <utility>

#include "core/system/assert.h"
#include "viewer/view/edits.h"
#include "viewer/view/state.h"

namespace tg {
namespace {

template <typename State, typename Part>
auto& partOf(State& state, int document, Part ViewerState::* shown, Part Document::* hidden) {
  TG_ASSERT(document >= 0 && document < static_cast<int>(state.documents.open.size()), "the document is open");
  if (document == state.documents.shown) return state.*shown;
  return state.documents.open[static_cast<std::size_t>(document)].*hidden;
}

}  // namespace

int documentOf(const ViewerState& state, const std::filesystem::path& path) {
  const std::vector<Document>& open = state.documents.open;
  auto at = std::ranges::find(open, path, &Document::path);
  if (at == open.end()) at = std::ranges::find_if(open, [&](const Document& d) { return sameFile(d.path, path); });
  return at == open.end() ? -1 : static_cast<int>(at - open.begin());
}

const Scene& sceneAt(const ViewerState& state, int document) {
  return partOf(state, document, &ViewerState::scene, &Document::scene);
}
Scene& sceneAt(ViewerState& state, int document) {
  return partOf(state, document, &ViewerState::scene, &Document::scene);
}
const EditState& editAt(const ViewerState& state, int document) {
  return partOf(state, document, &ViewerState::edit, &Document::edit);
}
EditState& editAt(ViewerState& state, int document) {
  return partOf(state, document, &ViewerState::edit, &Document::edit);
}

bool hasChanged(const ViewerState& state, int document) {
  const Scene& scene = sceneAt(state, document);
  return !scene.file || scene.file != identityOf(state.documents.open[static_cast<std::size_t>(document)].path);
}

void leaveDocument(ViewerState& state) {
  TG_ASSERT(state.documents.shown < static_cast<int>(state.documents.open.size()), "the document shown is open");
  if (state.documents.shown < 0) return;
  cancelDrag(state);
  Document& document = state.documents.open[static_cast<std::size_t>(std::exchange(state.documents.shown, -1))];
  document.scene = state.scene;
  document.pose = state.camera.pose;
  document.lens = reshaped(state.camera.lens, state.camera.aspect, state.camera.lens.kept);
  document.camera = state.camera.index;
  document.visited = state.camera.visited;
  document.crop = state.display.crop;
  document.box = state.display.box;
  document.bookmarks = state.camera.bookmarks;
  document.kept_bookmarks = state.desktop.kept_bookmarks;
  document.edit = std::exchange(state.edit, afresh(state.edit));
  document.history = std::exchange(state.history, {});
}

bool samePlace(const Camera& a, const Camera& b, double radius) {
  constexpr double kRounding = 1e-4;  // [scene radii], and of a rotation's numbers: files of other formats round
  if (glm::distance(a.position(), b.position()) > kRounding * radius) return false;
  const glm::dmat3 turned = a.rotation - b.rotation;
  return glm::dot(turned[0], turned[0]) + glm::dot(turned[1], turned[1]) + glm::dot(turned[2], turned[2]) <=
         kRounding * kRounding;
}

bool sameCameras(const Scene& a, const Scene& b) {
  const auto same = [&](const Camera& x, const Camera& y) {
    return x.name == y.name && samePlace(x, y, a.bounds.radius);
  };
  return !a.cameras.empty() && std::equal(a.cameras.begin(), a.cameras.end(), b.cameras.begin(), b.cameras.end(), same);
}

int otherDocument(const ViewerState& state) {
  const int count = static_cast<int>(state.documents.open.size());
  const int named = documentOf(state, state.compare.other);
  if (named >= 0 && named != state.documents.shown) return named;
  return count > 1 ? (state.documents.shown + 1) % count : -1;
}

void readAgain(ViewerState& state) {
  if (state.documents.shown < 0) return;
  state.documents.open_requests.push_back(state.documents.open[static_cast<std::size_t>(state.documents.shown)].path);
}

void stepDocument(ViewerState& state, int step) {
  const int count = static_cast<int>(state.documents.open.size());
  if (count < 2) return notify(state, "No other model is open");
  state.documents.show_request = (state.documents.shown + step + count) % count;
}

}  // namespace tg
