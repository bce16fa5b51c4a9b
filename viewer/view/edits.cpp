// SPDX-License-Identifier: Apache-2.0
// Edits of the model shown.
#include "viewer/view/edits.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <new>
#include <numeric>
#include <utility>

#include "converter/gltf/axes.h"
#include "converter/registry/file_format.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

std::vector<std::uint32_t> editedGaussians(const ViewerState& state) {
  if (state.edit.selection) return indicesOf(*state.edit.selection);
  std::vector<std::uint32_t> all(state.scene.model->size());
  std::iota(all.begin(), all.end(), std::uint32_t{0});
  return all;
}

glm::dmat3 turnAbout(int axis, double degrees) {
  glm::dvec4 q(0.0);
  q[0] = std::cos(0.5 * degrees * kDegrees);
  q[axis + 1] = std::sin(0.5 * degrees * kDegrees);
  return matrixFromQuaternion(q);
}

bool isIdentity(const Similarity& s) {
  return s.scale == 1.0 && s.rotation == glm::dmat3(1.0) && s.translation == glm::dvec3(0.0);
}

std::string nameOf(const Similarity& s) {
  if (s.scale != 1.0) return "Scale ";
  return s.rotation != glm::dmat3(1.0) ? "Turn " : "Move ";
}

void endMove(ViewerState& state) {
  if (state.edit.moving) cancelDrag(state);
}

}  // namespace

std::uint64_t newRevision() {
  static std::atomic<std::uint64_t> last = 0;
  return ++last;
}

bool mayEdit(ViewerState& state) {
  if (isWhole(state.scene) && state.scene.model->size() > 0) return true;
  notify(state, state.scene.streamed_from > 0
                    ? "A scene with levels of detail is not edited: open the model it was made from"
                : state.scene.model ? "Wait until the whole model is read"
                                    : "There is no model to edit");
  return false;
}

bool cancelDrag(ViewerState& state) {
  EditState& edit = state.edit;
  const bool any = edit.selecting || edit.moving || edit.range_before;
  if (edit.selecting) edit.selection = edit.selecting->before;
  if (edit.range_before) edit.selection = *edit.range_before;
  if (edit.selecting || edit.moving) state.ui.drag_spent = true;
  edit.selecting.reset();
  edit.moving.reset();
  edit.range_before.reset();
  edit.preview.reset();
  return any;
}

void setTool(ViewerState& state, EditTool tool) {
  cancelDrag(state);
  state.edit.tool = tool == state.edit.tool ? EditTool::none : tool;
  if (state.edit.tool != EditTool::none) state.inspect.active = false;
  state.edit.pointer.reset();
  state.edit.surface.reset();
  state.edit.hovered = Handle::none;
}

void choose(ViewerState& state, std::vector<std::uint8_t> found, SelectMode mode, const SelectionPtr& before) {
  TG_ASSERT(state.scene.model != nullptr, "Gaussians of a model are chosen");
  endMove(state);
  state.edit.selection = selectionOf(*state.scene.model, combined(before, std::move(found), mode));
}

void chooseAll(ViewerState& state) {
  if (!mayEdit(state)) return;
  choose(state, std::vector<std::uint8_t>(state.scene.model->size(), 1), SelectMode::replace, nullptr);
}

void chooseNone(ViewerState& state) {
  endMove(state);
  state.edit.selection = nullptr;
}

void invertChoice(ViewerState& state) {
  if (!mayEdit(state)) return;
  choose(state, inverted(state.edit.selection, state.scene.model->size()), SelectMode::replace, nullptr);
}

const Histogram* histogramShown(ViewerState& state) {
  EditState& edit = state.edit;
  if (!state.scene.model || state.scene.model->size() == 0) return nullptr;
  if (!edit.histogram || edit.histogram->value != edit.value || edit.histogram->of.lock() != state.scene.model) {
    const bool same_value = edit.histogram && edit.histogram->value == edit.value;
    edit.histogram = histogramOf(state.scene.model, edit.value);
    if (!same_value) edit.high = edit.low - 1;
  }
  return &*edit.histogram;
}

SelectMode heldMode(const EditState& edit, bool shift, bool control) {
  if (shift && control) return SelectMode::intersect;
  if (shift) return SelectMode::add;
  return control ? SelectMode::subtract : edit.mode;
}

void chooseRange(ViewerState& state, double low, double high, SelectMode mode) {
  const Histogram* histogram = histogramShown(state);
  if (!histogram || !mayEdit(state)) return;
  state.edit.low = std::min(low, high);
  state.edit.high = std::max(low, high);
  choose(state, insideRange(*histogram, state.edit.low, state.edit.high), mode,
         state.edit.range_before.value_or(nullptr));
  state.edit.range_found = state.edit.selection;
}

bool rangeHolds(const EditState& edit) {
  if (edit.low > edit.high) return false;
  return edit.range_before || (edit.selection && edit.selection == edit.range_found);
}

void deleteChosen(ViewerState& state) {
  if (!mayEdit(state)) return;
  const SelectionPtr selection = state.edit.selection;
  if (!selection) return notify(state, "Nothing is selected");
  if (selection->count == state.scene.model->size()) return notify(state, "A model keeps at least one Gaussian");
  ModelEdit edit;
  edit.erases = true;
  edit.which = indicesOf(*selection);
  const std::string text = "Delete " + std::to_string(selection->count);
  attempt(state, [&] {
    editModel(state, std::move(edit), text, nullptr);
    notify(state, text);
  });
}

void transformChosen(ViewerState& state, const Similarity& similarity, const ModelPtr& known) {
  if (!mayEdit(state) || isIdentity(similarity)) return;
  ModelEdit edit;
  edit.which = editedGaussians(state);
  edit.similarity = similarity;
  edit.moves_cameras = !state.edit.selection;
  const std::string text =
      nameOf(similarity) + (state.edit.selection ? std::to_string(state.edit.selection->count) : "model");
  const SelectionPtr before = state.edit.selection;
  editModel(state, std::move(edit), text, before, known);
  notify(state, text);
}

glm::dvec3 editPivot(const ViewerState& state) {
  return state.edit.selection ? state.edit.selection->center : state.scene.bounds.center;
}

Similarity similarityOf(const ViewerState& state, glm::dvec3 move, glm::dvec3 turn, double scale) {
  Similarity similarity;
  similarity.scale = scale;
  if (turn != glm::dvec3(0.0)) {
    similarity.rotation = turnAbout(2, turn.z) * turnAbout(1, turn.y) * turnAbout(0, turn.x);
  }
  similarity.translation = move;
  if (turn == glm::dvec3(0.0) && scale == 1.0) return similarity;
  return about(similarity, editPivot(state));
}

const ModelPtr& shownModel(const ViewerState& state) {
  const std::optional<EditPreview>& preview = state.edit.preview;
  return preview && preview->of == state.scene.model ? preview->model : state.scene.model;
}

void updatePreview(ViewerState& state) {
  EditState& edit = state.edit;
  if (!edit.moving || !state.scene.model) return;
  const Similarity& wanted = edit.moving->similarity;
  const bool there = edit.preview && edit.preview->of == state.scene.model &&
                     edit.preview->similarity.scale == wanted.scale &&
                     edit.preview->similarity.rotation == wanted.rotation &&
                     edit.preview->similarity.translation == wanted.translation;
  if (there || (isIdentity(wanted) && !edit.preview)) return;
  try {
    auto moved = std::make_shared<GaussianModel>(*state.scene.model);
    transformGaussians(*moved, wanted, editedGaussians(state));
    edit.preview = EditPreview{state.scene.model, std::move(moved), wanted};
  } catch (const std::bad_alloc&) {
    edit.preview.reset();  // only the dots follow then
  }
}

bool holdsModel(const std::filesystem::path& file, const Scene& scene) {
  const Format& format = modelFormat(file);
  if (format.holds(kKeepsFloats) && (format.holds(kKeepsTextures) || scene.textured == 0) &&
      (format.holds(kKeepsSh) || scene.sh_degree == 0) && (format.holds(kKeepsCameras) || scene.cameras.empty()) &&
      (format.holds(kKeepsViews) || scene.views.empty())) {
    return true;
  }
  return format.name == scene.format;
}

std::filesystem::path saveTarget(const ViewerState& state) {
  const std::filesystem::path& own = state.scene.path;
  try {
    if (holdsModel(own, state.scene)) return own;
  } catch (const Error&) {  // what is read but not written
  }
  return std::filesystem::path(own).replace_extension(".tgz");
}

bool hasUnsavedEdits(const ViewerState& state, int document) {
  const EditState& edit = editAt(state, document);
  return edit.revision != edit.saved;
}

std::vector<std::filesystem::path> unsavedModels(const ViewerState& state) {
  std::vector<std::filesystem::path> paths;
  for (int i = 0; i < static_cast<int>(state.documents.open.size()); ++i) {
    if (hasUnsavedEdits(state, i)) paths.push_back(state.documents.open[static_cast<std::size_t>(i)].path);
  }
  return paths;
}

std::string trainingText(const ViewerState& state) {
  const bool edited = state.edit.revision != state.edit.read;
  const std::string& training = state.scene.training;
  return edited && !training.empty() && !training.ends_with(kBeforeEdits) ? training + kBeforeEdits : training;
}

void noteModelKept(ViewerState& state, const std::filesystem::path& model, std::uint64_t revision) {
  const int document = documentOf(state, model);
  if (document < 0) return;
  EditState& edit = editAt(state, document);
  if (revision >= edit.read) edit.saved = revision;
}

}  // namespace tg
