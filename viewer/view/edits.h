// SPDX-License-Identifier: Apache-2.0
// What keys, buttons and scripts do to the model shown: choosing, deleting, moving, saving; and what of it no file
// holds yet.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "viewer/view/state.h"

namespace tg {

// False with a notice: there is no model, or only a part of it yet.
bool mayEdit(ViewerState& state);
void setTool(ViewerState& state, EditTool tool);  // one that is on is switched off, another ends inspecting by clicks
// Ends a drag, over the picture or the histogram, without a trace. False: there was none.
bool cancelDrag(ViewerState& state);

// `found`: [N]. Another selection ends the drag of a handle: what it moves is not chosen any more.
void choose(ViewerState& state, std::vector<std::uint8_t> found, SelectMode mode, const SelectionPtr& before);
// What Shift and Ctrl, held, make of the mode.
SelectMode heldMode(const EditState& edit, bool shift, bool control);
void chooseAll(ViewerState& state);
void chooseNone(ViewerState& state);
void invertChoice(ViewerState& state);
// The range of the histogram, combined with what was chosen before it was dragged, else with nothing.
void chooseRange(ViewerState& state, double low, double high, SelectMode mode);
// Whether that range is the last word on what is selected.
bool rangeHolds(const EditState& edit);
// The histogram of state.edit.value; null without a model. Made anew when model or value have changed.
const Histogram* histogramShown(ViewerState& state);

void deleteChosen(ViewerState& state);
// Of the chosen Gaussians; where none is chosen, of the whole model with its cameras.
void transformChosen(ViewerState& state, const Similarity& similarity, const ModelPtr& known = nullptr);
// What turns and scales go about: the mean of the chosen means, or the middle of the model.
glm::dvec3 editPivot(const ViewerState& state);
// About the pivot: turned about x, then y, then z [degrees], scaled, moved.
Similarity similarityOf(const ViewerState& state, glm::dvec3 move, glm::dvec3 turn, double scale);

// The model that is drawn: with what a drag does to it.
const ModelPtr& shownModel(const ViewerState& state);
// Lets the drawn model catch up with the drag.
void updatePreview(ViewerState& state);

// ---- Saving
// Where Save goes to unless another file is named: the model's own, or beside it as a .tgz that loses nothing.
std::filesystem::path saveTarget(const ViewerState& state);
// Whether a file of that name would hold all of the model, or is of the format that the model came from.
bool holdsModel(const std::filesystem::path& file, const Scene& scene);
// The open models with edits that no file holds.
std::vector<std::filesystem::path> unsavedModels(const ViewerState& state);
bool hasUnsavedEdits(const ViewerState& state, int document);  // of documents.open
// scene.training; of an edited model with the words that it was so before.
std::string trainingText(const ViewerState& state);
// Once a file holds a revision of a model. One that was read again meanwhile is another model.
void noteModelKept(ViewerState& state, const std::filesystem::path& model, std::uint64_t revision);

}  // namespace tg
