// SPDX-License-Identifier: Apache-2.0
// What can be undone: everything of the view that a click changes, by looking at it once a frame, and edits of the
// model. A drag is one step.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "viewer/view/camera_controller.h"
#include "viewer/view/camera_path.h"
#include "viewer/view/compare.h"
#include "viewer/view/model_edit.h"
#include "viewer/view/selection.h"

namespace tg {

// The parts of the state that a step may change. View, bookmarks and the path's keys are restored as a whole, all else
// member by member.
struct ViewSnapshot {
  struct Display {
    Output output = Output::final;
    RenderSettings settings;
    bool crop = false;
    CropBox box;
    double resolution = 1;
    bool operator==(const Display&) const = default;
  };
  struct View {
    ViewPose pose;
    Lens lens;
    double aspect = 16.0 / 9.0;  // of the picture that the lens is for
    int index = -1, visited = -1;
    int camera_lists = 0;  // Scene::camera_lists: of which list they are
    // The place alone: the same one from another list is no step.
    bool operator==(const View& other) const {
      return pose == other.pose && lens == other.lens && index == other.index;
    }
  };
  struct Motion {
    double speed = 1;
    bool fly = false;
    UpAxis up = UpAxis::cameras;
    double turntable_speed = 0;  // whether it turns is no step, as it is none whether the path plays
    bool operator==(const Motion&) const = default;
  };
  struct Bookmarks {
    std::vector<Camera> cameras;
    int at = -1;
    bool operator==(const Bookmarks& other) const;
  };
  struct Path {
    CameraPath path;
    int key = -1;
    double key_seconds = 2;
    bool drawn = true;
    bool operator==(const Path&) const = default;
  };
  struct Recording {
    glm::ivec2 size{0};
    double fps = 0;
    int turntable_frames = 0;
    bool operator==(const Recording&) const = default;
  };
  struct Compare {
    Comparison how;  // all but shows_other, which flickers by itself
    std::filesystem::path other;
    bool with_photographs = false, timed = false;
    double flicker_seconds = 0;
    bool operator==(const Compare&) const = default;
  };
  Display display;
  View view;
  Motion motion;
  std::shared_ptr<const Bookmarks> bookmarks;  // shared by the steps that leave them alone
  std::shared_ptr<const Path> path;
  Recording recording;
  Compare compare;
  SelectionPtr selection;
  bool operator==(const ViewSnapshot&) const = default;
};

struct HistoryStep {
  std::string name;  // "Delete 120"
  ViewSnapshot before, after;
  std::shared_ptr<const ModelEdit> edit;  // null: the model stays
  std::uint64_t revision_before = 0, revision_after = 0;
  bool flowing = false;  // of the wheel or of keys: what follows at once belongs to it
  double time = 0;       // [s] of its last change
  int camera_lists = 0;  // Scene::camera_lists at the edit
};

struct History {
  std::vector<HistoryStep> steps;
  std::size_t done = 0;              // steps [0, done) have happened, the others were undone
  std::optional<ViewSnapshot> last;  // what was seen last; none: looked at anew, whatever has changed
};
constexpr std::size_t kMostHistorySteps = 500;
constexpr std::uint64_t kMostHistoryBytes = std::uint64_t{512} << 20;  // of edits and selections; the newest step stays

struct ViewerState;
// Once a frame. `busy`: a button or widget is held, or the camera moves by itself: the change is not over. `flowing`:
// it came from the wheel or from held keys.
void recordChanges(ViewerState& state, bool busy, bool flowing);
// What the last press changed has been taken back, as by the second one of a double click: its step is none. Edits
// stay, and steps of anything else than what has changed since. Before recordChanges().
void forgetLastStep(ViewerState& state);
// The picture got another shape, and the lens follows it: no step.
void reshape(ViewerState& state, double aspect);
// The model was replaced by another one: steps that choose or edit Gaussians are gone.
void forgetModel(ViewerState& state);
// Changes the model shown, with the selection that it then has; one step.
void editModel(ViewerState& state, ModelEdit edit, std::string name, const SelectionPtr& selection,
               const ModelPtr& known = nullptr);

// A drag that is under way is taken back instead.
void undo(ViewerState& state);
void redo(ViewerState& state);
std::string undoName(const ViewerState& state);  // "" where there is nothing
std::string redoName(const ViewerState& state);

}  // namespace tg
