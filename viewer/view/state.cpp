// SPDX-License-Identifier: Apache-2.0
// Changes of the viewer's state: scenes, cameras, messages.
#include "viewer/view/state.h"

#include <algorithm>
#include <new>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "viewer/view/inspection.h"
#include "viewer/view/parse.h"

namespace tg {
namespace {

constexpr double kNoticeSeconds = 3;

// Leaves out that share of the means at either end of every axis.
CropBox boxOfMeans(const Scene& scene, double share) {
  CropBox box;
  if (!scene.model || scene.model->size() == 0) return box;
  std::vector<float> values(scene.model->size());
  const auto low = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  const auto high = static_cast<std::ptrdiff_t>(values.size()) - 1 - low;
  for (int axis = 0; axis < 3; ++axis) {
    std::transform(scene.model->mean.begin(), scene.model->mean.end(), values.begin(),
                   [axis](glm::vec3 mean) { return mean[axis]; });
    std::nth_element(values.begin(), values.begin() + low, values.end());
    box.min[axis] = values[static_cast<std::size_t>(low)];
    std::nth_element(values.begin(), values.begin() + high, values.end());
    box.max[axis] = values[static_cast<std::size_t>(high)];
  }
  return box;
}

}  // namespace

glm::dvec3 upOf(const ViewerState& state) { return upOf(state.camera.up, state.scene.up); }

bool isIsolated(const ViewerState& state) {
  return state.inspect.isolated && pickedGaussian(state) && state.scene.model;
}

RenderSettings effectiveSettings(const ViewerState& state) {
  RenderSettings settings = state.display.settings;
  if (state.display.textures_held_off) settings.textures = TextureMode::none;
  settings.outputs = {state.display.output};
  if (state.display.crop) settings.crop = state.display.box;
  if (isIsolated(state)) {
    const glm::vec3 mean = state.scene.model->mean[*pickedGaussian(state)];
    settings.crop = CropBox{mean, mean};  // a box around nothing but its mean
  }
  return settings;
}

RenderSettings shownSettings(const ViewerState& state, RenderSettings settings) {
  if (!settings.intersection) settings.intersection = state.scene.intersection;
  if (!settings.outside) settings.outside = state.scene.outside;
  return settings;
}

glm::ivec2 drawnSize(const ViewerState& state, glm::ivec2 area) {
  TG_ASSERT(area.x > 0 && area.y > 0, "an area of the window has pixels");
  const double largest = static_cast<double>(kMaxImageSide) / std::max(area.x, area.y);
  const double scale = std::min(state.display.resolution, largest);
  return glm::max(glm::ivec2(glm::round(glm::dvec2(area) * scale)), glm::ivec2(1));
}

void resetCrop(ViewerState& state) { state.display.box = boxOfMeans(state.scene, 0.0); }
void fitCrop(ViewerState& state) { state.display.box = boxOfMeans(state.scene, 0.01); }

void setScene(ViewerState& state, Scene scene) {
  state.scene = std::move(scene);
  state.display.settings.background = state.scene.background;
  state.display.crop = false;
  clearInspection(state);
  resetCrop(state);
  state.messages.error.clear();
  state.edit = afresh(state.edit);
  state.history = {};
  state.camera.bookmarks.clear();
  state.camera.bookmark = -1;
  state.camera.index = state.camera.visited = -1;
  const bool playing = state.path.playing;  // along the new model
  resetView(state);
  state.path.playing = playing;
}

void replaceScene(ViewerState& state, Scene scene) {
  clearInspection(state);  // the numbers are of another model
  forgetModel(state);
  const bool own_box = state.scene.partial && state.display.box == boxOfMeans(state.scene, 0.0);
  const int lists = state.scene.camera_lists;
  scene.camera_lists = lists + (scene.cameras == state.scene.cameras ? 0 : 1);
  state.scene = std::move(scene);
  if (state.scene.camera_lists != lists) state.camera.visited = -1;
  if (own_box) resetCrop(state);  // a part's holds no more than it
  if (state.camera.index >= static_cast<int>(state.scene.cameras.size())) state.camera.index = -1;
}

void goToCamera(ViewerState& state, int index) {
  TG_ASSERT(index >= 0 && static_cast<std::size_t>(index) < state.scene.cameras.size(), "the model has this camera");
  setCamera(state, state.scene.cameras.at(index));
  state.camera.index = index;
  state.path.playing = false;
}

void goToCamera(ViewerState& state, const std::string& text, const std::string& what) {
  const Camera camera = cameraOf(text, state.scene.cameras, what);
  if (const auto index = parseWhole<int>(text)) return goToCamera(state, *index);
  setCamera(state, camera);
  state.path.playing = false;
}

void replaceCameras(ViewerState& state, std::vector<Camera> cameras) {
  TG_ASSERT(!cameras.empty(), "there is a camera to go to");
  state.scene.cameras = std::move(cameras);
  ++state.scene.camera_lists;
  state.camera.index = state.camera.visited = -1;  // of the list before
  goToCamera(state, startCamera(state.scene.cameras));
}

void setCamera(ViewerState& state, const Camera& camera) {
  TG_ASSERT(camera.size.x > 0 && camera.size.y > 0, "a picture has pixels");
  state.camera.pose = poseOf(camera, upOf(state), state.scene.bounds);
  state.camera.lens = lensOf(camera, state.camera.aspect);
  leaveCamera(state.camera);
}

int startCamera(std::span<const Camera> cameras) {
  if (cameras.empty()) return -1;
  const auto test = std::find_if(cameras.begin(), cameras.end(), [](const Camera& c) { return c.test; });
  return test == cameras.end() ? 0 : static_cast<int>(test - cameras.begin());
}

void notify(ViewerState& state, std::string text) {
  endNotice(state);
  state.messages.notice = std::move(text);
  state.messages.notice_until = state.time + kNoticeSeconds;
}

void endNotice(ViewerState& state) {
  state.messages.notice_until = 0;
  state.ui.escape_said = false;
  state.ui.escape_seen = -1e9;
}

void attempt(ViewerState& state, const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    state.messages.error = error.what();
    endNotice(state);
  } catch (const std::bad_alloc&) {
    state.messages.error = "There is not enough memory for this";
    endNotice(state);
  } catch (const std::filesystem::filesystem_error& error) {
    state.messages.error = printable(error.what());
    endNotice(state);
  }
}

void resetView(ViewerState& state) {
  const int start = startCamera(state.scene.cameras);
  if (start >= 0) return goToCamera(state, start);
  state.path.playing = false;
  state.camera.lens = {};
  state.camera.pose = startPose(upOf(state), state.scene.bounds, state.camera.lens, state.camera.aspect,
                                double{state.display.settings.near});
  leaveCamera(state.camera);
}

void leaveCamera(CameraState& camera) {
  if (camera.index >= 0) camera.visited = camera.index;
  camera.index = -1;
}

int cameraHere(const ViewerState& state) {
  if (state.camera.index >= 0) return state.camera.index;
  const std::vector<Camera>& cameras = state.scene.cameras;
  const Camera view = toCamera(state.camera.pose, state.camera.lens, 1, 1);
  const auto here = [&](const Camera& camera) { return samePlace(camera, view, state.scene.bounds.radius); };
  // Several may be at one place, apart by their lenses: another lens there is of the one that was left.
  const int last = lastCamera(state);
  if (last >= 0 && here(cameras[static_cast<std::size_t>(last)])) return last;
  int nearest = -1;
  std::pair<double, double> least;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (!here(cameras[i])) continue;
    const double lens = lensOf(cameras[i], state.camera.aspect).fov_y;
    const std::pair apart(glm::distance(cameras[i].position(), view.position()),
                          std::abs(lens - state.camera.lens.fov_y));
    if (nearest >= 0 && apart >= least) continue;
    nearest = static_cast<int>(i);
    least = apart;
  }
  return nearest;
}

int lastCamera(const ViewerState& state) {
  const int last = state.camera.index >= 0 ? state.camera.index : state.camera.visited;
  return last < static_cast<int>(state.scene.cameras.size()) ? last : -1;  // a document may have fewer by now
}

std::filesystem::path freeName(const std::string& stem, const std::string& extension) {
  for (int i = 1;; ++i) {
    std::string number = std::to_string(i);
    if (number.size() < 3) number.insert(0, 3 - number.size(), '0');
    const std::filesystem::path path = stem + "-" + number + extension;
    std::error_code none;  // a name that is too long, say, is for who writes the file
    if (!std::filesystem::exists(path, none)) return path;
  }
}

}  // namespace tg
