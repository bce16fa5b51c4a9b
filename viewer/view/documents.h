// SPDX-License-Identifier: Apache-2.0
// The open models: which there are, which is shown, and what each was left like.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "render/settings.h"
#include "viewer/view/camera_controller.h"
#include "viewer/view/edit_state.h"
#include "viewer/view/history.h"
#include "viewer/view/scene.h"

namespace tg {

// A model that is open. While it is shown its scene is ViewerState::scene, and nothing here counts but the path
// and whether it was written again.
struct Document {
  std::filesystem::path path;
  bool rewritten = false;  // its file is another one than what was read, and nobody has put up with that
  Scene scene;
  ViewPose pose;  // as it was left
  Lens lens;
  int camera = -1, visited = -1;  // as CameraState has them
  bool crop = false;
  CropBox box;
  EditState edit;
  History history;
  std::vector<Camera> bookmarks;
  std::string kept_bookmarks;  // as DesktopState has it
};

// Cameras that were asked for together with models, for the first of these that is shown.
struct CamerasOfModels {
  std::filesystem::path file;
  std::vector<std::filesystem::path> models;
};

struct DocumentState {
  std::vector<Document> open;  // in order of opening
  int shown = -1;              // of `open`; -1: none
  // What the window does next; panels, keys and scripts write here.
  std::vector<std::filesystem::path> open_requests;
  std::vector<CamerasOfModels> camera_files;
  std::optional<int> show_request, close_request;  // of `open`
};

// What is being read, written by the window.
struct LoadState {
  bool active = false;
  std::filesystem::path path;
  std::uint64_t done = 0;       // [bytes]
  std::uint64_t total = 0;      // 0: not known
  std::size_t waiting = 0;      // files after it
  bool cancel = false;          // asks the window to stop
  bool script_goes_on = false;  // a script does not wait for it
  bool part_owed = false;       // the picture of a part is not on screen yet: what follows it waits
};

struct ViewerState;
// The document of that file, by whatever name; -1: none.
int documentOf(const ViewerState& state, const std::filesystem::path& path);
// Of documents.open, wherever they are kept while it is shown or not.
const Scene& sceneAt(const ViewerState& state, int document);
Scene& sceneAt(ViewerState& state, int document);
const EditState& editAt(const ViewerState& state, int document);
EditState& editAt(ViewerState& state, int document);
// Whether its file is not what was read any more.
bool hasChanged(const ViewerState& state, int document);
// Puts the scene and view shown back into their document; none is shown then, but ViewerState::scene stays.
void leaveDocument(ViewerState& state);
// Whether two cameras stand at one place and look the same way, but for rounding. `radius`: of their scene.
bool samePlace(const Camera& a, const Camera& b, double radius);
// Whether two scenes have the same cameras, in number, name and place, and at least one: models of one data set, of
// which none has been moved. Their sizes may differ, with what they were trained at.
bool sameCameras(const Scene& a, const Scene& b);
// What ViewerState::compare names, else the next one after the one shown; -1: there is no other.
int otherDocument(const ViewerState& state);
void stepDocument(ViewerState& state, int step);  // asks for the next one, round about
void readAgain(ViewerState& state);               // asks for the file of the one shown, where it has changed

}  // namespace tg
