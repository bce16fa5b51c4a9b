// SPDX-License-Identifier: Apache-2.0
// Steps back and forth.
#include "viewer/view/history.h"

#include <algorithm>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/system/assert.h"
#include "render/settings_members.h"
#include "viewer/view/actions.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/edits.h"
#include "viewer/view/inspection.h"
#include "viewer/view/path_editor.h"
#include "viewer/view/state.h"

namespace tg {
namespace {

constexpr double kFlowPause = 0.7;  // [s] between changes of the wheel that are one step

template <typename T>
std::shared_ptr<const T> sharedWith(const std::shared_ptr<const T>& before, T now) {
  return before && *before == now ? before : std::make_shared<const T>(std::move(now));
}

// What of the state each part keeps, in one list: `act(of the state, of the part...)` for one part or several of a
// kind.
template <typename State, typename Act, typename Part, typename... More>
void eachMember(State& s, const Act& act, Part& part, More&... more) {
  using Kind = std::remove_const_t<Part>;
  if constexpr (std::is_same_v<Kind, ViewSnapshot::Display>) {
    act(s.display.output, part.output, more.output...);
    act(s.display.settings, part.settings, more.settings...);
    act(s.display.crop, part.crop, more.crop...);
    act(s.display.box, part.box, more.box...);
    act(s.display.resolution, part.resolution, more.resolution...);
  } else if constexpr (std::is_same_v<Kind, ViewSnapshot::View>) {
    act(s.camera.pose, part.pose, more.pose...);
    act(s.camera.lens, part.lens, more.lens...);
    act(s.camera.aspect, part.aspect, more.aspect...);
    act(s.camera.index, part.index, more.index...);
    act(s.camera.visited, part.visited, more.visited...);
  } else if constexpr (std::is_same_v<Kind, ViewSnapshot::Motion>) {
    act(s.camera.speed, part.speed, more.speed...);
    act(s.camera.fly, part.fly, more.fly...);
    act(s.camera.up, part.up, more.up...);
    act(s.camera.turntable_speed, part.turntable_speed, more.turntable_speed...);
  } else if constexpr (std::is_same_v<Kind, ViewSnapshot::Bookmarks>) {
    act(s.camera.bookmarks, part.cameras, more.cameras...);
    act(s.camera.bookmark, part.at, more.at...);
  } else if constexpr (std::is_same_v<Kind, ViewSnapshot::Path>) {
    act(s.path.path, part.path, more.path...);
    act(s.path.key, part.key, more.key...);
    act(s.path.key_seconds, part.key_seconds, more.key_seconds...);
    act(s.path.drawn, part.drawn, more.drawn...);
  } else if constexpr (std::is_same_v<Kind, ViewSnapshot::Recording>) {
    act(s.record.size, part.size, more.size...);
    act(s.record.fps, part.fps, more.fps...);
    act(s.record.turntable_frames, part.turntable_frames, more.turntable_frames...);
  } else {
    static_assert(std::is_same_v<Kind, ViewSnapshot::Compare>);
    act(s.compare.how.mode, part.how.mode, more.how.mode...);
    act(s.compare.how.divider, part.how.divider, more.how.divider...);
    act(s.compare.how.gain, part.how.gain, more.how.gain...);
    act(s.compare.how.with_sign, part.how.with_sign, more.how.with_sign...);
    act(s.compare.other, part.other, more.other...);
    act(s.compare.with_photographs, part.with_photographs, more.with_photographs...);
    act(s.compare.timed, part.timed, more.timed...);
    act(s.compare.flicker_seconds, part.flicker_seconds, more.flicker_seconds...);
  }
}

template <typename Part>
Part captured(const ViewerState& s) {
  Part part;
  eachMember(s, [](const auto& of_state, auto& of_part) { of_part = of_state; }, part);
  return part;
}

template <typename T>
void putBackValue(T& of_state, const T& from, const T& to) {
  if (from != to) of_state = to;
}
void putBackValue(RenderSettings& of_state, const RenderSettings& from, const RenderSettings& to) {
  const auto each = [&]<std::size_t... i>(std::index_sequence<i...>) {
    const auto now = membersOf(of_state);
    const auto left = membersOf(from), wanted = membersOf(to);
    (putBackValue(std::get<i>(now), std::get<i>(left), std::get<i>(wanted)), ...);
  };
  each(std::make_index_sequence<std::tuple_size_v<decltype(membersOf(to))>>());
}

// Only what differs: the rest may have been changed elsewhere, while another model was shown.
template <typename Part>
void putBack(ViewerState& s, const Part& from, const Part& to) {
  eachMember(
      s, [](auto& of_state, const auto& left, const auto& wanted) { putBackValue(of_state, left, wanted); }, from, to);
}

// True where there was something to put back: all of it, since one member says nothing without the others.
template <typename Part>
bool putBackWhole(ViewerState& s, const Part& from, const Part& to) {
  if (from == to) return false;
  eachMember(s, [](auto& of_state, const auto& of_part) { of_state = of_part; }, to);
  return true;
}

// Keys that another model's steps have made or changed since stay.
void putBackPath(ViewerState& s, const ViewSnapshot::Path& from, const ViewSnapshot::Path& to) {
  if (s.path.path == from.path) {
    s.path.path = to.path;
    s.path.key = to.key;
    s.path.playing = false;
    s.path.at = std::min(s.path.at, duration(s.path.path));
  }
  putBackValue(s.path.key_seconds, from.key_seconds, to.key_seconds);
  putBackValue(s.path.drawn, from.drawn, to.drawn);
}

ViewSnapshot::View capturedView(const ViewerState& s) {
  auto view = captured<ViewSnapshot::View>(s);
  view.camera_lists = s.scene.camera_lists;
  return view;
}

ViewSnapshot snapshot(const ViewerState& s, const std::optional<ViewSnapshot>& last) {
  ViewSnapshot now;
  now.display = captured<ViewSnapshot::Display>(s);
  now.view = capturedView(s);
  now.motion = captured<ViewSnapshot::Motion>(s);
  now.bookmarks = sharedWith(last ? last->bookmarks : nullptr, captured<ViewSnapshot::Bookmarks>(s));
  now.path = sharedWith(last ? last->path : nullptr, captured<ViewSnapshot::Path>(s));
  now.recording = captured<ViewSnapshot::Recording>(s);
  now.compare = captured<ViewSnapshot::Compare>(s);
  now.selection = s.edit.selection;
  return now;
}

void restore(ViewerState& s, const ViewSnapshot& from, const ViewSnapshot& to) {
  putBack(s, from.display, to.display);
  putBack(s, from.motion, to.motion);
  const double aspect = s.camera.aspect;  // the window may have had another shape
  if (putBackWhole(s, from.view, to.view)) {
    s.path.playing = false;
    s.camera.lens = reshaped(s.camera.lens, s.camera.aspect, aspect);
    s.camera.aspect = aspect;
    // Numbers of another list mean other cameras now.
    if (to.view.camera_lists != s.scene.camera_lists) s.camera.index = s.camera.visited = -1;
    if (s.camera.index >= 0) {
      s.camera.lens = lensOf(s.scene.cameras[static_cast<std::size_t>(s.camera.index)], s.camera.aspect);
    }
  }
  if (from.bookmarks != to.bookmarks) putBackWhole(s, *from.bookmarks, *to.bookmarks);
  if (from.path != to.path) putBackPath(s, *from.path, *to.path);
  putBack(s, from.recording, to.recording);
  putBack(s, from.compare, to.compare);
  if (from.selection != to.selection) s.edit.selection = to.selection;
}

// What its slider, else the menu, else its flag calls it.
std::string labelOf(const RenderSetting& setting) {
  if (setting.number || setting.whole) {
    const std::string_view format = setting.slider.format;
    return std::string(format.substr(0, std::min(format.find(" x %"), format.find(" %"))));
  }
  if (const std::string_view words = menuWords(setting.name); !words.empty()) return std::string(words);
  std::string text(setting.name);
  text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

std::string displayName(const ViewSnapshot::Display& before, const ViewSnapshot::Display& after) {
  if (before.output != after.output) return "Show " + std::string(name(after.output));
  if (before.crop != after.crop) return after.crop ? "Crop box on" : "Crop box off";
  if (before.box != after.box) return "Crop box";
  if (before.resolution != after.resolution) return "Resolution";
  for (const RenderSetting& setting : renderSettings()) {
    if (setting.get && setting.get(before.settings) != setting.get(after.settings)) return labelOf(setting);
  }
  return "View";
}

std::string listName(std::size_t before, std::size_t after, const std::string& entry) {
  return before < after ? "Add " + entry : before > after ? "Remove " + entry : "Change " + entry;
}

// At most one of them was added, removed or changed.
bool isOneChange(const std::vector<Camera>& before, const std::vector<Camera>& after) {
  const auto same = [](const Camera& a, const Camera& b) { return a == b && a.name == b.name && a.test == b.test; };
  const auto [least, most] = std::minmax({before.size(), after.size()});
  std::size_t first = 0, last = 0;  // that stayed
  while (first < least && same(before[first], after[first])) ++first;
  while (first + last < least && same(before[before.size() - 1 - last], after[after.size() - 1 - last])) ++last;
  return most - first - last <= 1;
}

std::string stepName(const ViewSnapshot& before, const ViewSnapshot& after) {
  if (before.selection != after.selection) {
    return after.selection ? "Select " + std::to_string(after.selection->count) : "Select none";
  }
  if (before.display != after.display) return displayName(before.display, after.display);
  const std::vector<Camera>&was = before.bookmarks->cameras, &is = after.bookmarks->cameras;
  if (!sameBookmarks(was, is)) {
    return isOneChange(was, is) ? listName(was.size(), is.size(), "bookmark") : "Load bookmarks";
  }
  if (before.path->path != after.path->path) {
    return listName(before.path->path.keys.size(), after.path->path.keys.size(), "key");
  }
  if (before.compare != after.compare) {
    return before.compare.how.mode != after.compare.how.mode ? "Compare: " + std::string(name(after.compare.how.mode))
                                                             : "Compare";
  }
  if (before.motion != after.motion) {
    return before.motion.up != after.motion.up ? "Up " + std::string(name(after.motion.up)) : "Camera setting";
  }
  if (before.recording != after.recording) return "Recording";
  if (before.view != after.view) {
    return after.view.index >= 0 ? "Camera " + std::to_string(after.view.index) : "Camera";
  }
  return before.bookmarks != after.bookmarks ? "Bookmark" : "Path";
}

std::uint64_t bytesOf(const HistoryStep& step) {
  return (step.edit ? bytesOf(*step.edit) : 0) + (step.after.selection ? step.after.selection->chosen.size() : 0);
}

void push(History& history, HistoryStep step) {
  history.steps.resize(history.done);
  history.steps.push_back(std::move(step));
  std::uint64_t bytes = 0;
  std::size_t kept = 0;  // counted from the newest
  while (kept < std::min(history.steps.size(), kMostHistorySteps)) {
    bytes += bytesOf(history.steps[history.steps.size() - 1 - kept]);
    if (kept > 0 && bytes > kMostHistoryBytes) break;
    ++kept;
  }
  history.steps.erase(history.steps.begin(), history.steps.end() - static_cast<std::ptrdiff_t>(kept));
  history.done = history.steps.size();
}

void setModel(ViewerState& state, ModelPtr model, std::uint64_t revision) {
  clearInspection(state);
  state.scene.model = std::move(model);
  state.edit.revision = revision;
  state.edit.preview.reset();
  measure(state.scene);
}

// What was changed until now is a step of its own. Where the camera has gone by itself is none: undo would take back
// nothing else, and redo would have nothing left.
void endStep(ViewerState& state) {
  if (state.history.last && movesByItself(state)) state.history.last->view = capturedView(state);
  recordChanges(state, false, false);
}

// The whole model takes its named views along, and its cameras, those that it had.
void moveCameras(ViewerState& state, const HistoryStep& step, bool back) {
  if (!step.edit->moves_cameras) return;
  Similarity similarity = step.edit->similarity;
  if (back) {
    similarity.scale = 1 / similarity.scale;
    similarity.rotation = glm::transpose(similarity.rotation);
    similarity.translation = -similarity.scale * (similarity.rotation * similarity.translation);
  }
  transformCameras(state.scene.views, similarity);
  if (step.camera_lists != state.scene.camera_lists) return;
  transformCameras(state.scene.cameras, similarity);
  state.scene.up = sceneUp(state.scene.cameras);
  leaveCamera(state.camera);
}

}  // namespace

bool ViewSnapshot::Bookmarks::operator==(const Bookmarks& other) const {
  return at == other.at && sameBookmarks(cameras, other.cameras);
}

void recordChanges(ViewerState& state, bool busy, bool flowing) {
  History& history = state.history;
  const ViewSnapshot now = snapshot(state, history.last);
  if (!history.last) history.last = now;
  if (busy) return;
  if (now == *history.last) {
    history.last->view = now.view;  // with the list and the camera left, which are no step
    return;
  }
  HistoryStep step{stepName(*history.last, now), *history.last,       now,     nullptr,
                   state.edit.revision,          state.edit.revision, flowing, state.time};
  HistoryStep* before = history.done > 0 ? &history.steps[history.done - 1] : nullptr;
  const bool flows = before && flowing && before->flowing && before->name == step.name &&
                     history.done == history.steps.size() && state.time - before->time < kFlowPause;
  if (flows) {
    before->after = now;
    before->time = state.time;
  } else {
    push(history, std::move(step));
  }
  history.last = now;
}

void forgetLastStep(ViewerState& state) {
  History& history = state.history;
  if (history.done == 0 || history.done < history.steps.size() || !history.last || movesByItself(state)) return;
  const HistoryStep& step = history.steps.back();
  // What was put back may be a float's rounding from what it was: the state is not that before the step, but it changed
  // in the same way. Where it did not, what was changed is none of the snapshot's, and had no step.
  const ViewSnapshot now = snapshot(state, history.last);
  if (step.edit || now == *history.last || stepName(*history.last, now) != step.name) return;
  history.last = step.before;
  history.steps.pop_back();
  --history.done;
}

void reshape(ViewerState& state, double aspect) {
  CameraState& camera = state.camera;
  camera.lens = camera.index >= 0 ? lensOf(state.scene.cameras[static_cast<std::size_t>(camera.index)], aspect)
                                  : reshaped(camera.lens, camera.aspect, aspect);
  camera.aspect = aspect;
  if (!state.history.last) return;
  state.history.last->view.lens = camera.lens;
  state.history.last->view.aspect = aspect;
}

void forgetModel(ViewerState& state) {
  History& history = state.history;
  const auto of_model = [](const HistoryStep& step) {
    return step.edit || step.before.selection != step.after.selection;
  };
  const auto done = history.steps.begin() + static_cast<std::ptrdiff_t>(history.done);
  history.done -= static_cast<std::size_t>(std::count_if(history.steps.begin(), done, of_model));
  std::erase_if(history.steps, of_model);
  for (HistoryStep& step : history.steps) step.before.selection = step.after.selection = nullptr;
  EditState& edit = state.edit;
  cancelDrag(state);
  edit.selection = nullptr;
  edit.histogram.reset();
  edit.surface.reset();
  edit.read = edit.revision = edit.saved = newRevision();
  if (history.last) history.last->selection = nullptr;
}

void editModel(ViewerState& state, ModelEdit edit, std::string name, const SelectionPtr& selection,
               const ModelPtr& known) {
  TG_ASSERT(state.scene.model != nullptr, "a model is edited");
  cancelDrag(state);
  endStep(state);
  ModelPtr model = applied(*state.scene.model, edit, known);
  HistoryStep step;
  step.name = std::move(name);
  step.before = snapshot(state, state.history.last);
  step.revision_before = state.edit.revision;
  step.revision_after = newRevision();
  step.camera_lists = state.scene.camera_lists;
  step.time = state.time;
  step.edit = std::make_shared<const ModelEdit>(std::move(edit));
  moveCameras(state, step, false);
  setModel(state, std::move(model), step.revision_after);
  // Its middle has moved along.
  state.edit.selection = selection ? selectionOf(*state.scene.model, selection->chosen) : nullptr;
  step.after = snapshot(state, step.before);
  state.history.last = step.after;
  push(state.history, std::move(step));
}

void undo(ViewerState& state) {
  if (cancelDrag(state)) return notify(state, "Undone: the drag");
  endStep(state);
  History& history = state.history;
  if (history.done == 0) return notify(state, "Nothing to undo");
  attempt(state, [&] {
    const HistoryStep& step = history.steps[history.done - 1];
    if (step.edit) {
      ModelPtr before = takenBack(*state.scene.model, *step.edit);
      moveCameras(state, step, true);
      setModel(state, std::move(before), step.revision_before);
    }
    --history.done;
    restore(state, step.after, step.before);
    history.last = snapshot(state, history.last);
    notify(state, "Undone: " + step.name);
  });
}

void redo(ViewerState& state) {
  if (cancelDrag(state)) return notify(state, "The drag was taken back");
  endStep(state);
  History& history = state.history;
  if (history.done == history.steps.size()) return notify(state, "Nothing to redo");
  attempt(state, [&] {
    const HistoryStep& step = history.steps[history.done];
    if (step.edit) {
      ModelPtr after = appliedAgain(*state.scene.model, *step.edit);
      moveCameras(state, step, false);
      setModel(state, std::move(after), step.revision_after);
    }
    ++history.done;
    restore(state, step.before, step.after);
    history.last = snapshot(state, history.last);
    notify(state, "Done again: " + step.name);
  });
}

std::string undoName(const ViewerState& state) {
  return state.history.done > 0 ? state.history.steps[state.history.done - 1].name : "";
}

std::string redoName(const ViewerState& state) {
  const History& history = state.history;
  return history.done < history.steps.size() ? history.steps[history.done].name : "";
}

}  // namespace tg
