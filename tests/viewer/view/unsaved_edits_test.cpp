// SPDX-License-Identifier: Apache-2.0
// What is asked before edits are lost, and where they are saved.
#include "viewer/view/edits.h"

#include <vector>

#include "support/catch.h"
#include "viewer/view/edited_state.h"

using namespace tg;
using test::everyThird;
using test::frame;
using test::kUndo;
using test::press;
using test::sampleState;
using test::someSimilarity;

TEST_CASE("a file that was saved before the model was read again says nothing about the new one") {
  ViewerState state = sampleState();
  transformChosen(state, someSimilarity());
  const std::uint64_t saved = state.edit.revision;
  replaceScene(state, state.scene);
  noteModelKept(state, "sample.tgz", saved);
  CHECK_FALSE(hasUnsavedEdits(state, 0));
  transformChosen(state, someSimilarity());
  noteModelKept(state, "sample.tgz", saved);
  CHECK(hasUnsavedEdits(state, 0));
  noteModelKept(state, "sample.tgz", state.edit.revision);
  CHECK_FALSE(hasUnsavedEdits(state, 0));
}

TEST_CASE("what would lose edits is asked first") {
  ViewerState state = sampleState();
  askToQuit(state);
  CHECK(state.quit);  // nothing to lose
  state.quit = false;
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  deleteChosen(state);
  const std::uint64_t revision = state.edit.revision;
  press(state, kControl | 'Q');
  CHECK_FALSE(state.quit);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->what == Unsaved::edits);
  CHECK(state.desktop.question->model == "sample.tgz");
  keepUnsaved(state);
  askToQuit(state);
  saveUnsaved(state);
  CHECK(state.desktop.wanted == FileUse::saveModel);
  REQUIRE(state.desktop.after_saving);
  noteModelKept(state, "sample.tgz", revision);
  goOnClosing(state, *state.desktop.after_saving);
  CHECK(state.quit);

  // Edited once more: what was saved is another revision.
  state.quit = false;
  state.desktop = {};
  undo(state);
  CHECK(hasUnsavedEdits(state, 0));
  press(state, kControl | 'W');
  CHECK_FALSE(state.documents.close_request);
  REQUIRE(state.desktop.question);
  discardUnsaved(state);
  CHECK(state.documents.close_request == 0);
  CHECK(hasUnsavedEdits(state, 0));  // until it is closed
}

TEST_CASE("a file that is read again asks for the edits of its model, other files are opened at once") {
  ViewerState state = sampleState();
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  deleteChosen(state);
  using Paths = std::vector<std::filesystem::path>;
  state.documents.open_requests = {"sample.tgz", "another.tgz"};
  CHECK(guardEdits(state));
  CHECK(state.documents.open_requests == Paths{"another.tgz"});
  REQUIRE(state.desktop.question);
  keepUnsaved(state);
  CHECK_FALSE(guardEdits(state));
  CHECK_FALSE(state.desktop.question);

  state.documents.open_requests = {"sample.tgz"};
  askToQuit(state);
  CHECK_FALSE(guardEdits(state));  // one question at a time
  CHECK(state.documents.open_requests.empty());
  keepUnsaved(state);
  CHECK(guardEdits(state));
  discardUnsaved(state);
  CHECK_FALSE(guardEdits(state));
  CHECK(state.documents.open_requests == Paths{"sample.tgz"});
  CHECK_FALSE(state.desktop.question);
  CHECK(hasUnsavedEdits(state, 0));  // until it has been read
}

TEST_CASE("of several edited models each is asked for, in view, and a change of mind keeps them all") {
  ViewerState state = sampleState();
  Document& hidden = state.documents.open.emplace_back();
  hidden.path = "hidden.tgz";
  hidden.edit.revision = newRevision();
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  deleteChosen(state);
  askToQuit(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "sample.tgz");
  CHECK_FALSE(state.documents.show_request);
  discardUnsaved(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "hidden.tgz");
  CHECK(state.documents.show_request == 1);
  keepUnsaved(state);
  CHECK(unsavedModels(state).size() == 2);
  askToQuit(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "sample.tgz");
  keepUnsaved(state);
  askToClose(state, 1);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "hidden.tgz");
  discardUnsaved(state);
  CHECK(state.documents.close_request == 1);
}

TEST_CASE("an edited model goes to its own file, or to a bundle beside it where that would lose something") {
  ViewerState state = sampleState();
  CHECK(saveTarget(state) == "sample.tgz");
  state.scene.path = "scene.splat";
  CHECK(saveTarget(state) == "scene.tgz");  // by its name alone
  state.scene.format = "splat";
  CHECK(saveTarget(state) == "scene.splat");  // it came from one
  CHECK_FALSE(holdsModel("a.ply", state.scene));
  state.scene.path = "scene.ply";
  state.scene.format = "ply";
  CHECK_FALSE(holdsModel("a.compressed.ply", state.scene));  // which rounds
  state.scene.path = "scene.splat";
  state.scene.format = "splat";
  CHECK(holdsModel("a.glb", state.scene));
  state.scene.path = "scene.gltf-of-another-kind";
  CHECK(saveTarget(state) == "scene.tgz");
}

TEST_CASE("what training reached is said to be before edits as long as there are any") {
  ViewerState state = sampleState();
  CHECK(trainingText(state).empty());
  state.scene.training = "finished, 31.09 dB held out";
  CHECK(trainingText(state) == "finished, 31.09 dB held out");
  chooseAll(state);
  frame(state);
  CHECK(trainingText(state) == "finished, 31.09 dB held out");
  transformChosen(state, someSimilarity());
  frame(state);
  CHECK(trainingText(state) == "finished, 31.09 dB held out before edits");
  noteModelKept(state, state.scene.path, state.edit.revision);
  CHECK(trainingText(state) == "finished, 31.09 dB held out before edits");
  press(state, kUndo);
  CHECK(trainingText(state) == "finished, 31.09 dB held out");
}
