// SPDX-License-Identifier: Apache-2.0
// Chooses the levels of a streamed scene for a camera and reads what they lack, in a thread of its own, while what is
// there is shown.
#pragma once
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "core/system/worker.h"
#include "viewer/model/resident_levels.h"

namespace tg {

// Stands between the streamer and the files: what tests put in.
using LodReaderWrap = std::function<LodReader(LodReader files)>;

constexpr std::chrono::milliseconds kLongestLostRest = std::chrono::minutes(5);

// All members may be called from one other thread; none of them waits for a file.
class SceneStreamer {
 public:
  // Begins with the coarsest level. `wake` is called in the streamer's thread whenever there is news. `wrap` may be
  // empty. lost_rest: how long files that could not be fetched are left alone; twice as long
  // each time, up to kLongestLostRest.
  SceneStreamer(std::filesystem::path path, std::function<void()> wake, const LodReaderWrap& wrap,
                std::chrono::milliseconds lost_rest = std::chrono::seconds(10));

  const std::filesystem::path& path() const { return path_; }

  struct Wish {
    Camera camera;
    std::uint64_t budget = 0;  // Gaussians
    std::uint64_t number = 0;  // of this wish, counted by whoever wishes
    std::uint64_t drawn = 0;   // News::models of the scene on screen: the next one comes after it
  };
  void want(Wish wish) { wishes_.give(std::move(wish)); }

  struct News {
    std::optional<Scene> scene;  // what is in memory, where that has changed; the first one is the coarsest level
    std::uint64_t models = 0;    // scenes given so far
    std::uint64_t wish = 0;      // the number of the last wish that was looked at
    bool settled = false;        // the scene has the levels that it asks for, but for those that cannot be read
    std::size_t owed = 0;        // files on their way
    std::size_t lost = 0;        // files that cannot be read
    std::string loading;         // the file being read; "" = none
    std::uint64_t bytes = 0;     // read so far
    std::string problem;         // what could not be read since; "" = nothing
    int error_kind = 0;          // ErrorKind of the problem
    bool failed = false;         // it cannot be opened: nothing comes any more
    bool rewritten = false;      // nothing comes any more, since its file is another one: to be opened again
  };
  // What came since the last call.
  std::optional<News> take() { return news_.poll(); }

 private:
  class Run;
  void give(News news);

  const std::filesystem::path path_;
  const std::chrono::milliseconds lost_rest_;
  LatestValue<Wish> wishes_;
  LatestValue<News> news_;
  std::jthread thread_;
};

}  // namespace tg
