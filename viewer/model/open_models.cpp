// SPDX-License-Identifier: Apache-2.0
// The life of the open models.
#include "viewer/model/open_models.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "converter/registry/file_format.h"
#include "core/file/identity.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "viewer/model/scene_of.h"
#include "viewer/view/documents.h"
#include "viewer/view/edits.h"
#include "viewer/view/inspection.h"
#include "viewer/view/parse.h"

namespace tg {

namespace {

constexpr int kMostBegun = 10;  // times that a scene is opened while it is written again and again

bool isCameras(const std::filesystem::path& json) {
  try {
    return !isPathFile(json);
  } catch (const Error&) {
    return false;  // a file that cannot be read says so when it is opened
  }
}

// A tileset or a SOG, of whatever name: any other JSON begins as a glTF does.
bool isModelInJson(const std::filesystem::path& json) {
  try {
    return detectFormat(json).whole_name;
  } catch (const Error&) {
    return false;
  }
}

bool areForShown(const ViewerState& state, const CamerasOfModels& cameras) {
  return !state.scene.partial && std::ranges::any_of(cameras.models, [&](const auto& model) {
    const int document = documentOf(state, model);
    return document >= 0 && document == state.documents.shown;
  });
}

bool areForAnOpenOne(const ViewerState& state, const CamerasOfModels& cameras) {
  return std::ranges::any_of(cameras.models, [&](const auto& model) { return documentOf(state, model) >= 0; });
}

}  // namespace

std::vector<std::filesystem::path> takeCameraFiles(ViewerState& state) {
  std::vector<std::filesystem::path>& requests = state.documents.open_requests;
  const auto first = std::stable_partition(requests.begin(), requests.end(), [](const auto& path) {
    return lowerExtension(path) != ".json" || isLodMeta(path) || isModelInJson(path);
  });
  const std::vector<std::filesystem::path> models(requests.begin(), first);
  std::vector<std::filesystem::path> due;
  for (auto file = first; file != requests.end(); ++file) {
    if (models.empty() || !isCameras(*file)) {
      due.push_back(*file);
    } else {
      state.documents.camera_files.push_back({*file, models});
    }
  }
  requests.erase(first, requests.end());
  if (!models.empty() || state.loading.active) return due;
  std::erase_if(state.documents.camera_files, [&](const CamerasOfModels& cameras) {
    const bool shown = areForShown(state, cameras);
    if (shown) due.push_back(cameras.file);
    return shown || !areForAnOpenOne(state, cameras);
  });
  return due;
}

bool hasCamerasDue(const ViewerState& state) {
  return std::ranges::any_of(state.documents.camera_files,
                             [&](const CamerasOfModels& cameras) { return areForShown(state, cameras); });
}

OpenModels::View OpenModels::viewOf(const ViewerState& state) {
  const CameraState& camera = state.camera;
  return {camera.pose, reshaped(camera.lens, camera.aspect, camera.lens.kept), camera.index, camera.visited};
}

void OpenModels::setView(ViewerState& state, const View& view) {
  const std::vector<Camera>& cameras = state.scene.cameras;
  state.camera.pose = view.pose;
  // The file may have been read again, with fewer cameras.
  state.camera.index = view.camera < static_cast<int>(cameras.size()) ? view.camera : -1;
  state.camera.visited = view.visited;
  // What was in view is, also where the window has got another shape since.
  const double aspect = state.camera.aspect;
  state.camera.lens = state.camera.index < 0 ? reshaped(view.lens, view.lens.kept, aspect)
                                             : lensOf(cameras[static_cast<std::size_t>(view.camera)], aspect);
}

// A window that gets another shape changes the lens of a model's camera, and rounds that of a free view.
bool OpenModels::View::operator==(const View& other) const {
  if (pose != other.pose || camera != other.camera) return false;
  constexpr double kRounding = 1e-9;
  Lens rounded = lens;
  if (std::abs(lens.fov_y - other.lens.fov_y) < kRounding) rounded.fov_y = other.lens.fov_y;
  return camera >= 0 || rounded == other.lens;
}

OpenModels::OpenModels(const ViewOptions& options, std::function<void()> wake,
                       std::function<void(ViewerState&, Scene)> adopt, ModelReader model_reader, LodReaderWrap wrap)
    : options_(options),
      adopt_(std::move(adopt)),
      wake_(wake),
      wrap_(std::move(wrap)),
      loader_(wake, std::move(model_reader)) {
  if (options.script.empty()) watch_ = std::make_unique<FileWatch>(wake);
  if (options.follow) {
    if (options.model.filename() == "model.tgz") {
      run_ = std::make_unique<RunWatch>(options.model.parent_path(), wake);
    }
    follower_ = std::make_unique<ModelFollower>(options.model, std::move(wake));
    return;
  }
  starting_ = !options.model.empty();
  if (starting_) read(options.model);
  for (const std::filesystem::path& path : options.more_models) read(path);
  if (!options.compare.empty()) read(options.compare);
}

// Scenes with levels of detail beside each other, models one after the other.
void OpenModels::read(const std::filesystem::path& path) {
  const auto same = [&](const std::filesystem::path& other) { return sameFile(other, path); };
  std::erase_if(closed_, same);
  if (!isLodMeta(path)) return loader_.open(path);
  std::erase_if(streams_, [&](const Stream& stream) { return same(stream.streamer->path()); });
  Stream stream;
  stream.streamer = std::make_unique<SceneStreamer>(path, wake_, wrap_);
  stream.begun = std::chrono::steady_clock::now();
  streams_.push_back(std::move(stream));
}

// A line that fades; it would come and go in a script's pictures.
void OpenModels::say(ViewerState& state, const std::string& text) const {
  if (options_.script.empty()) notify(state, text);
}

bool OpenModels::update(ViewerState& state) {
  DocumentState& documents = state.documents;
  std::string there;
  for (const std::filesystem::path& path : std::exchange(documents.open_requests, {})) {
    starting_ = false;
    const int document = documentOf(state, path);
    if (document >= 0 && (isFollowed(state, document) || !hasChanged(state, document))) {
      documents.show_request = document;
      there = path.string() + " is open already";
      continue;
    }
    read(document >= 0 ? documents.open[static_cast<std::size_t>(document)].path : path);
    say(state, "Opening " + path.string());
  }
  if (std::exchange(state.loading.cancel, false)) {
    starting_ = false;
    loader_.cancel();
    std::erase_if(streams_, [](const Stream& stream) { return stream.models == 0; });
    state.desktop.agreed.clear();
    documents.camera_files.clear();
    say(state, "Opening was cancelled");
  }
  bool changed = takeLoaded(state);
  changed |= takeStreamed(state);
  const ModelLoader::Status status = loader_.status();
  state.loading.active = !status.path.empty() || state.loading.part_owed;
  state.loading.path = status.path;
  state.loading.done = status.done;
  state.loading.total = status.total;
  state.loading.waiting = status.waiting;
  for (const Stream& stream : streams_) {
    if (stream.models > 0) continue;
    state.loading.active = true;
    if (status.path.empty()) state.loading.path = stream.streamer->path();
  }
  changed |= takeFollowed(state);
  changed |= takeRun(state);
  changed |= takeRewritten(state);
  if (const auto document = std::exchange(documents.show_request, std::nullopt)) {
    if (*document >= 0 && *document < static_cast<int>(documents.open.size())) {
      show(state, *document);
      say(state, there.empty() ? state.scene.path.filename().string() : there);
      changed = true;
    }
  }
  if (const auto document = std::exchange(documents.close_request, std::nullopt)) {
    if (*document >= 0 && *document < static_cast<int>(documents.open.size())) {
      close(state, *document);
      changed = true;
    }
  }
  return changed;
}

bool OpenModels::takeLoaded(ViewerState& state) {
  bool changed = false;
  // The first picture is there so much earlier that it is worth the wait.
  while (!state.loading.part_owed) {
    std::optional<ModelLoader::News> news = loader_.take();
    if (!news) break;
    const int document = documentOf(state, news->path);
    const auto same = [&](const std::filesystem::path& closed) { return sameFile(closed, news->path); };
    if (document < 0 && std::ranges::any_of(closed_, same)) {
      if (!loader_.reads(news->path)) std::erase_if(closed_, same);
      continue;
    }
    const bool shown = document >= 0 && document == state.documents.shown;
    const bool partial = document >= 0 && sceneAt(state, document).partial;
    if (news->scene && document >= 0) news->scene->path = state.documents.open[document].path;
    if (news->scene && news->scene->partial) {
      // A file that is read again is seen whole until it is there whole again.
      if (document < 0) {
        open(state, std::move(*news->scene));
      } else if (partial) {
        replace(state, document, std::move(*news->scene));
      }
      changed = true;
      state.loading.part_owed = state.documents.shown == documentOf(state, news->path);
      continue;
    }
    read_seconds_ = news->read_seconds;
    read_bytes_ = news->bytes;
    const bool loses = news->scene && document >= 0 && losesEdits(state, document);
    if (document >= 0) {
      std::erase_if(state.desktop.agreed, [&](const auto& agreed) { return agreed.first == news->path; });
    }
    if (loses && options_.script.empty()) {
      state.desktop.read_again.push_back(news->path);  // edited meanwhile: asked about, then read again
    } else if (news->scene) {
      if (document < 0) {
        open(state, std::move(*news->scene));
      } else {
        const bool untouched = shown && partial && viewOf(state) == adopted_view_;
        const bool own_background = shown && state.display.settings.background == backgroundOf(state.scene);
        replace(state, document, std::move(*news->scene));
        if (own_background) state.display.settings.background = backgroundOf(state.scene);  // a part may not know it
        if (untouched) {
          firstView(state);
          sharedView(state);
        }
        if (!shown && !partial) show(state, document);
      }
      if (news->path == options_.compare && !std::exchange(compare_opened_, true)) {
        state.documents.show_request = documentOf(state, options_.model);
      }
      if (opened_any_ || loader_.status().waiting > 0) say(state, "Opened " + news->path.string());
      opened_any_ = true;
      if (follower_ && !sameFile(news->path, follower_->file())) unfollow(state);
    } else {
      if (partial) close(state, document);
      if (!news->problem.empty()) takeFailure(state, news->problem, news->error_kind);
    }
    changed = true;
  }
  return changed;
}

// Throws where nothing else can be opened at the start.
void OpenModels::takeFailure(ViewerState& state, const std::string& problem, int error_kind) {
  const bool waits = std::ranges::any_of(streams_, [](const Stream& stream) { return stream.models == 0; });
  const bool last = loader_.status().path.empty() && !waits;
  if (last && starting_ && !opened_any_ && state.documents.open.empty()) {
    throw Error(static_cast<ErrorKind>(error_kind), problem);
  }
  state.messages.error = problem;
  endNotice(state);
}

bool OpenModels::takeStreamed(ViewerState& state) {
  bool changed = false;
  std::vector<std::pair<std::filesystem::path, int>> rewritten;  // and how often in vain
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    std::optional<SceneStreamer::News> news = streams_[i].streamer->take();
    if (!news) continue;
    changed = true;
    if (news->rewritten) {  // levels of both are no scene
      const std::filesystem::path path = streams_[i].streamer->path();
      const int in_vain = streams_[i].models == 0 ? streams_[i].begun_before + 1 : 0;
      if (in_vain > 0 || documentOf(state, path) >= 0) rewritten.emplace_back(path, in_vain);
      streams_.erase(streams_.begin() + static_cast<std::ptrdiff_t>(i--));
      continue;
    }
    const bool failed = news->failed;
    const std::string problem = news->problem;
    const int error_kind = news->error_kind;
    if (news->scene || !failed) takeNews(state, streams_[i], *std::move(news));
    if (!failed) continue;
    // What is there of it stays, also what came together with the failure.
    streams_.erase(streams_.begin() + static_cast<std::ptrdiff_t>(i--));
    takeFailure(state, problem, error_kind);
  }
  for (const auto& [path, in_vain] : rewritten) {
    if (in_vain == kMostBegun) {
      takeFailure(state, std::string(SceneRewritten(path).what()) + ", " + std::to_string(in_vain) + " times",
                  static_cast<int>(ErrorKind::cannotRead));
      continue;
    }
    read(path);
    streams_.back().begun_before = in_vain;
    say(state, path.string() + " was written again");
  }
  return wish(state) || changed;
}

void OpenModels::takeNews(ViewerState& state, Stream& stream, SceneStreamer::News news) {
  const std::filesystem::path& path = stream.streamer->path();
  const int document = documentOf(state, path);
  if (news.scene) state.stream.drawn = false;
  if (news.scene && document < 0 && stream.models > 0) return;  // closed meanwhile
  if (news.scene && stream.models == 0) {
    if (document < 0) {
      open(state, *std::move(news.scene));
    } else {
      news.scene->path = state.documents.open[static_cast<std::size_t>(document)].path;
      replace(state, document, *std::move(news.scene));
    }
    if (path == options_.compare && !std::exchange(compare_opened_, true)) {
      state.documents.show_request = documentOf(state, options_.model);
    }
    if (opened_any_) say(state, "Opened " + path.string());
    opened_any_ = true;
    if (follower_) unfollow(state);
  } else if (news.scene) {
    refine(state, document, *std::move(news.scene));
  }
  stream.models = news.models;
  if (!news.problem.empty() && stream.news.lost == 0) {  // of many, the first one
    state.messages.error = news.problem;
    endNotice(state);
  }
  if (news.settled && !stream.news.settled) {
    read_seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - stream.begun).count();
    read_bytes_ = news.bytes;
  }
  news.scene.reset();
  stream.news = std::move(news);
}

// What the scene shown and the one that it is compared with are asked for, and how far they are. True when that has
// changed.
bool OpenModels::wish(ViewerState& state) {
  const CompareState& compare = state.compare;
  const bool compares = compare.how.mode != CompareMode::off && !compare.with_photographs;
  const int shown = state.documents.shown, other = compares ? otherDocument(state) : -1;
  StreamState& at = state.stream;
  const StreamState before = at;
  at.settled = true;  // nothing comes
  at.owed = at.lost = 0;
  at.loading.clear();
  for (Stream& stream : streams_) {
    const int document = documentOf(state, stream.streamer->path());
    if (document < 0 || (document != shown && document != other)) continue;
    if (stream.models == 0) {  // it is read again
      at.settled = false;
      continue;
    }
    SceneStreamer::Wish wish = stream.wish;
    wish.camera = at.camera;
    wish.budget = at.budget;
    if (at.drawn) wish.drawn = stream.models;
    const bool changed = wish.budget != stream.wish.budget ||
                         static_cast<const Pinhole&>(wish.camera) != static_cast<const Pinhole&>(stream.wish.camera);
    if (at.camera.size.x > 0 && (changed || wish.drawn != stream.wish.drawn)) {
      wish.number += changed;
      stream.wish = wish;
      stream.streamer->want(std::move(wish));
    }
    at.settled = at.settled && stream.news.settled && stream.news.wish == stream.wish.number;
    at.owed += stream.news.owed;
    at.lost += stream.news.lost;
    if (at.loading.empty()) at.loading = stream.news.loading;
  }
  return at.settled != before.settled || at.owed != before.owed || at.lost != before.lost;
}

// The same scene with other levels: all that the user has changed of it stays.
void OpenModels::refine(ViewerState& state, int document, Scene scene) {
  TG_ASSERT(document >= 0 && static_cast<std::size_t>(document) < state.documents.open.size(), "the document is open");
  Scene& held = sceneAt(state, document);
  if (document == state.documents.shown && state.inspect.inspected) clearInspection(state);  // of the model before
  held.model = std::move(scene.model);
  held.gaussians = scene.gaussians;
  held.textured = scene.textured;
  held.texels = scene.texels;
  held.texture_mode = scene.texture_mode;
  held.intersection = scene.intersection;
  held.outside = scene.outside;
}

// The first model opens like any other; later ones change nothing but the model.
bool OpenModels::takeFollowed(ViewerState& state) {
  if (!follower_) return false;
  const int document = documentOf(state, follower_->file());
  if (document >= 0 && hasUnsavedEdits(state, document)) {
    unfollow(state);
    say(state, "Edited: no longer following " + state.documents.open[document].path.filename().string());
    return true;
  }
  const EditState* edit = document >= 0 ? &editAt(state, document) : nullptr;
  state.follow.waits = edit && (edit->selection || edit->selecting || edit->moving);
  if (state.follow.waits) return false;
  std::optional<ModelFollower::News> news = follower_->take();
  if (!news) return false;
  state.follow.problem = news->problem;
  if (!news->model) return true;
  try {
    Scene scene = sceneOf(std::move(*news->model), follower_->file());
    if (document >= 0) {
      replace(state, document, std::move(scene));
    } else {
      open(state, std::move(scene));
    }
    opened_any_ = true;
    ++state.follow.reloads;
  } catch (const std::bad_alloc&) {
    state.follow.problem = follower_->file().string() + ": not enough memory";
  }
  return true;
}

bool OpenModels::takeRun(ViewerState& state) {
  if (!run_) return false;
  if (const auto order = std::exchange(state.follow.order, std::nullopt)) {
    bool given = false;
    attempt(state, [&] {
      run_->order(*order);
      given = true;
    });
    state.quit = state.quit && given;  // who leaves is to hear of it
    if (!given && order->command == RunCommand::go) state.follow.told = RunCommand::pause;  // as it still is
  }
  std::optional<RunWatch::News> news = run_->take();
  if (!news) return false;
  const auto isIn = [&](RunPhase phase) { return state.follow.status && state.follow.status->phase == phase; };
  const bool waited = isIn(RunPhase::paused), gone = !state.follow.status;
  state.follow.lines = std::move(news->lines);
  state.follow.status = std::move(news->status);
  if (gone && state.follow.status && state.follow.told == RunCommand::stop) state.follow.told.reset();  // resumed
  // Somebody else has told it to.
  if (waited && isIn(RunPhase::training) && state.follow.told == RunCommand::pause) state.follow.told.reset();
  return true;
}

// Files that are other ones than what was read of them; the panels say so.
bool OpenModels::takeRewritten(ViewerState& state) {
  if (!watch_) return false;
  std::vector<Document>& open = state.documents.open;
  FileWatch::Files files;
  bool changed = false;
  for (std::size_t i = 0; i < open.size(); ++i) {
    if (const auto& file = sceneAt(state, static_cast<int>(i)).file) files.emplace(open[i].path, *file);
    if (!open[i].rewritten || hasChanged(state, static_cast<int>(i))) continue;
    open[i].rewritten = false;  // saved over since, or moved back
    changed = true;
  }
  watch_->watch(files);
  while (const std::optional<std::filesystem::path> path = watch_->take()) {
    const int document = documentOf(state, *path);
    if (document < 0 || !hasChanged(state, document)) continue;  // saved by this window, say
    open[static_cast<std::size_t>(document)].rewritten = true;
    changed = true;
  }
  return changed;
}

bool OpenModels::isFollowed(const ViewerState& state, int document) const {
  return follower_ && sameFile(state.documents.open[static_cast<std::size_t>(document)].path, follower_->file());
}

void OpenModels::unfollow(ViewerState& state) {
  follower_.reset();
  run_.reset();
  state.follow.active = state.follow.waits = false;
  state.follow.lines.reset();
  state.follow.status.reset();
  state.follow.told.reset();
  state.follow.order.reset();
}

void OpenModels::adopt(ViewerState& state, Scene scene) {
  adopt_(state, std::move(scene));
  state.display.settings.background = backgroundOf(state.scene);
}

void OpenModels::open(ViewerState& state, Scene scene) {
  left_ = state.scene.path;
  leaveDocument(state);
  state.documents.open.emplace_back().path = scene.path;
  state.documents.shown = static_cast<int>(state.documents.open.size()) - 1;
  std::string error = std::move(state.messages.error);  // of another file: stays until it is dismissed
  adopt(state, std::move(scene));
  state.messages.error = std::move(error);
  if (state.documents.open.size() == 1) firstView(state);
  sharedView(state);
  adopted_view_ = viewOf(state);
}

// What the command line says about the first view.
void OpenModels::firstView(ViewerState& state) {
  state.history.last.reset();  // no step of the user's
  resetView(state);
  if (opened_any_) return;
  if (options_.camera.empty() || (state.scene.partial && state.scene.cameras.empty())) return;
  const auto go = [&] { goToCamera(state, options_.camera, "--camera"); };
  if (options_.model.empty()) {
    attempt(state, go);  // the window was asked for, this model was not
  } else {
    go();
  }
}

// A model of the data set of the one that was left for it is looked at from where that was.
void OpenModels::sharedView(ViewerState& state) const {
  const int left = documentOf(state, left_);
  if (left < 0 || left == state.documents.shown || !sameCameras(sceneAt(state, left), state.scene)) return;
  const Document& document = state.documents.open[static_cast<std::size_t>(left)];
  setView(state, {document.pose, document.lens, document.camera, document.visited});
}

void OpenModels::replace(ViewerState& state, int document, Scene scene) {
  TG_ASSERT(document >= 0 && static_cast<std::size_t>(document) < state.documents.open.size(), "the document is open");
  state.documents.open[document].rewritten = false;
  if (document == state.documents.shown) return replaceScene(state, std::move(scene));
  Document& hidden = state.documents.open[document];
  if (scene.cameras != hidden.scene.cameras) hidden.visited = -1;
  hidden.scene = std::move(scene);
  hidden.edit = {};
  hidden.history = {};
}

void OpenModels::show(ViewerState& state, int document) {
  TG_ASSERT(document >= 0 && static_cast<std::size_t>(document) < state.documents.open.size(), "the document is open");
  if (document == state.documents.shown) return;
  const View view = viewOf(state);
  const bool own_background = state.display.settings.background == backgroundOf(state.scene);
  const glm::vec3 background = state.display.settings.background;
  const Scene before = state.scene;
  leaveDocument(state);
  Document& next = state.documents.open[document];
  state.documents.shown = document;
  state.stream.settled = false;  // until wish() has asked for the levels of this one
  Document kept = std::exchange(next, {});
  next.path = kept.path;
  const EditTool tool = state.edit.tool;
  adopt(state, std::move(kept.scene));
  state.display.crop = kept.crop;
  state.display.box = kept.box;
  state.camera.bookmarks = std::move(kept.bookmarks);
  state.desktop.kept_bookmarks = std::move(kept.kept_bookmarks);
  state.edit = std::move(kept.edit);
  state.edit.tool = tool;
  state.history = std::move(kept.history);
  state.history.last.reset();
  if (!own_background) state.display.settings.background = background;
  // Models of one data set are looked at from one place.
  const bool together = sameCameras(before, state.scene);
  setView(state, together ? view : View{kept.pose, kept.lens, kept.camera, kept.visited});
}

void OpenModels::close(ViewerState& state, int document) {
  TG_ASSERT(document >= 0 && static_cast<std::size_t>(document) < state.documents.open.size(), "the document is open");
  std::vector<Document>& open = state.documents.open;
  if (isFollowed(state, document)) unfollow(state);
  const std::filesystem::path path = open[static_cast<std::size_t>(document)].path;
  if (loader_.reads(path)) closed_.insert(path);
  std::erase_if(streams_, [&](const Stream& stream) { return documentOf(state, stream.streamer->path()) == document; });
  const int shown = state.documents.shown;
  if (shown == document) {
    if (open.size() > 1) {
      show(state, document + 1 < static_cast<int>(open.size()) ? document + 1 : document - 1);
    } else {
      state.documents.shown = -1;
      adopt(state, {});
    }
  }
  open.erase(open.begin() + document);
  if (state.documents.shown > document) --state.documents.shown;
  const bool others = otherDocument(state) >= 0 || !state.compare.photographs.empty();
  if (!others) state.compare.how.mode = CompareMode::off;
}

}  // namespace tg
