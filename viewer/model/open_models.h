// SPDX-License-Identifier: Apache-2.0
// Opens, replaces and closes the models that the state asks for: loading, --follow, switching.
#pragma once
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <vector>

#include "viewer/model/file_watch.h"
#include "viewer/model/follower.h"
#include "viewer/model/loader.h"
#include "viewer/model/run_watch.h"
#include "viewer/model/scene_streamer.h"
#include "viewer/view/options.h"
#include "viewer/view/state.h"

namespace tg {

// What of the requests is no model but a camera path, or cameras for the one shown. Once a frame, before update():
// cameras that came together with models wait until one of these is shown, and are nobody's where none comes.
std::vector<std::filesystem::path> takeCameraFiles(ViewerState& state);
// Whether cameras wait that the next takeCameraFiles() gives for the model that is shown.
bool hasCamerasDue(const ViewerState& state);

class OpenModels {
 public:
  // Begins to read the models of `options` (with --follow, to watch the first). `wake` is called in other threads when
  // update() has something to do; `adopt` makes a scene (an empty one: none) the one shown, with its own view;
  // `model_reader` is the loader's, `wrap` lies around the files of streamed scenes.
  OpenModels(const ViewOptions& options, std::function<void()> wake, std::function<void(ViewerState&, Scene)> adopt,
             ModelReader model_reader = {}, LodReaderWrap wrap = {});

  // Once a frame. True when the models have changed. Throws Error when nothing could be opened at the start.
  bool update(ViewerState& state);

  // Of the file read last, for --timings.
  double readSeconds() const { return read_seconds_; }
  std::uint64_t readBytes() const { return read_bytes_; }

 private:
  // A scene that is streamed, and what was asked of it last.
  struct Stream {
    std::unique_ptr<SceneStreamer> streamer;
    SceneStreamer::Wish wish;
    SceneStreamer::News news;  // the last one, without its scene
    std::uint64_t models = 0;  // taken
    std::chrono::steady_clock::time_point begun;
    int begun_before = 0;  // without a model, as the file was written again
  };
  // Where a model is looked at from. Equal: nobody has moved from the one to the other.
  struct View {
    ViewPose pose;
    Lens lens;
    int camera = -1, visited = -1;  // of the model's
    bool operator==(const View& other) const;
  };
  static View viewOf(const ViewerState& state);
  static void setView(ViewerState& state, const View& view);
  void read(const std::filesystem::path& path);
  bool takeStreamed(ViewerState& state);
  void takeNews(ViewerState& state, Stream& stream, SceneStreamer::News news);
  bool wish(ViewerState& state);
  void refine(ViewerState& state, int document, Scene scene);
  void takeFailure(ViewerState& state, const std::string& problem, int error_kind);
  void say(ViewerState& state, const std::string& text) const;
  bool takeLoaded(ViewerState& state);
  bool takeFollowed(ViewerState& state);
  bool takeRun(ViewerState& state);
  bool takeRewritten(ViewerState& state);
  bool isFollowed(const ViewerState& state, int document) const;
  void unfollow(ViewerState& state);
  void adopt(ViewerState& state, Scene scene);
  void open(ViewerState& state, Scene scene);
  void replace(ViewerState& state, int document, Scene scene);
  void show(ViewerState& state, int document);
  void close(ViewerState& state, int document);
  void firstView(ViewerState& state);
  void sharedView(ViewerState& state) const;
  glm::vec3 backgroundOf(const Scene& scene) const { return options_.background.value_or(scene.background); }

  const ViewOptions options_;
  const std::function<void(ViewerState&, Scene)> adopt_;
  bool starting_ = false;  // what the command line names is all that was asked for
  bool opened_any_ = false;
  bool compare_opened_ = false;             // --compare's model, which is not the one shown
  View adopted_view_;                       // of a part, to tell whether it has been moved
  std::filesystem::path left_;              // the model that was shown when the one opened last came
  std::set<std::filesystem::path> closed_;  // while they were to be read: what comes of them is not wanted
  double read_seconds_ = 0;
  std::uint64_t read_bytes_ = 0;
  const std::function<void()> wake_;
  const LodReaderWrap wrap_;
  std::vector<Stream> streams_;
  std::unique_ptr<ModelFollower> follower_;
  std::unique_ptr<RunWatch> run_;
  std::unique_ptr<FileWatch> watch_;  // without a script
  ModelLoader loader_;
};

}  // namespace tg
