// SPDX-License-Identifier: Apache-2.0
// The streamer's thread: a file at a time, a model at a time.
#include "viewer/model/scene_streamer.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <new>
#include <set>
#include <utility>
#include <vector>

#include "core/file/file.h"
#include "core/file/identity.h"
#include "core/system/error.h"

namespace tg {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kModelPause(300);            // between two models
constexpr std::chrono::milliseconds kLook(10);                   // between looks at the clock
constexpr std::uint64_t kMostWaiting = std::uint64_t{64} << 20;  // [bytes] read ahead of the next model

// Runs body(); what goes wrong with `name` goes into the news. False where there is nothing to tell: all went well, or
// was cancelled. Throws SceneRewritten.
template <typename News, typename Body>
bool findProblem(News& news, const std::string& name, const Body& body) {
  try {
    body();
    return false;
  } catch (const ReadCancelled&) {
    return false;
  } catch (const SceneRewritten&) {
    throw;
  } catch (const Error& error) {
    news.problem = error.what();
    news.error_kind = static_cast<int>(error.kind);
  } catch (const std::bad_alloc&) {
    news.problem = name + ": not enough memory";
    news.error_kind = static_cast<int>(ErrorKind::device);
  } catch (const std::exception& error) {
    news.problem = name + ": " + error.what();
    news.error_kind = static_cast<int>(ErrorKind::badData);
  }
  return true;
}

}  // namespace

class SceneStreamer::Run {
 public:
  Run(SceneStreamer& streamer, const std::stop_token& stop, const LodReaderWrap& wrap)
      : streamer_(streamer),
        stop_(stop),
        identity_(identityOf(streamer.path_)),
        opened_(open(wrap)),
        resident_(opened_.scene, opened_.reader, opened_.require_same) {}

  void run() {
    giveScene();
    // The first wish is waited for, and later ones where nothing is left to do without one.
    for (bool idle = true; !stop_.stop_requested();) {
      std::optional<Wish> fresh = idle ? streamer_.wishes_.take(stop_) : streamer_.wishes_.poll();
      if (stop_.stop_requested()) return;
      if (fresh) hear(*std::move(fresh));
      idle = !work();
    }
  }

 private:
  OpenedLevels open(const LodReaderWrap& wrap) const {
    OpenedLevels opened = openLevels(streamer_.path_, stop_);
    if (wrap) opened.reader = wrap(std::move(opened.reader));
    return opened;
  }

  void hear(Wish wish) {
    const bool same = wish_.budget == wish.budget && static_cast<const Pinhole&>(wish_.camera) == wish.camera;
    wish_ = std::move(wish);
    if (!same) chosen_ = chooseLevels(opened_.scene, wish_.camera, wish_.budget);
    if (!unreachable_.empty() && Clock::now() >= tried_again_) {
      for (const std::uint32_t file : std::exchange(unreachable_, {})) lost_.erase(file);
      rest_ = std::min(2 * rest_, kLongestLostRest);
    }
    plan();
  }

  void plan() {
    wanted_ = withoutFiles(opened_.scene, chosen_, lost_);
    missing_ = resident_.missing(wanted_, wish_.camera.position());
    said_settled_ = false;
  }

  // False: there is nothing to do before another wish comes.
  bool work() {
    if (mayRead()) readNext();
    const std::vector<std::uint8_t> levels = resident_.reachable(wanted_, wish_.budget);
    const bool other = levels != resident_.levels();
    const bool drawn = wish_.drawn >= models_;
    if (other && drawn && Clock::now() - given_at_ >= kModelPause) {
      resident_.assemble(levels);
      missing_ = resident_.missing(wanted_, wish_.camera.position());
      giveScene();
      return true;
    }
    if (mayRead()) return true;
    if (!other && !missing_.empty()) {  // what was read is not wanted any more, and is in the way
      resident_.assemble(levels);
      return true;
    }
    if (!other) {
      if (!std::exchange(said_settled_, true)) tell({});
      return false;
    }
    if (!drawn) return false;
    return sleepUnlessStopped(stop_, kLook);
  }

  bool mayRead() const { return !missing_.empty() && resident_.bytesWaiting() < kMostWaiting; }

  void readNext() {
    const std::uint32_t file = missing_.front();
    News news;
    news.loading = opened_.scene.files[file];
    tell(news);
    news.loading.clear();
    const std::string name = streamer_.path_.string() + ": " + opened_.scene.files[file];
    const bool told = findProblem(news, name, [&] {
      resident_.read(file, wanted_);
      missing_.erase(missing_.begin());
    });
    if (!told) {
      if (told_.erase(file) > 0) rest_ = streamer_.lost_rest_;
      return;
    }
    lost_.insert(file);
    if (!told_.insert(file).second) news.problem.clear();
    if (news.error_kind == static_cast<int>(ErrorKind::cannotRead)) {
      unreachable_.insert(file);
      tried_again_ = Clock::now() + rest_;
    }
    plan();
    tell(std::move(news));
  }

  void giveScene() {
    ++models_;
    given_at_ = Clock::now();
    News news;
    news.scene = sceneOf(opened_, resident_.model(), streamer_.path_);
    news.scene->file = identity_;
    tell(std::move(news));
  }

  void tell(News news) const {
    news.models = models_;
    news.wish = wish_.number;
    news.settled = missing_.empty() && wish_.number > 0 && resident_.levels() == wanted_;
    news.owed = missing_.size();
    news.lost = lost_.size();
    news.bytes = resident_.bytesRead();
    streamer_.give(std::move(news));
  }

  SceneStreamer& streamer_;
  const std::stop_token& stop_;
  const std::optional<FileIdentity> identity_;  // before it is read: what comes later is a change
  const OpenedLevels opened_;
  ResidentLevels resident_;
  Wish wish_;
  std::vector<std::uint8_t> chosen_, wanted_;  // for the wish; without what cannot be read
  std::vector<std::uint32_t> missing_;
  std::set<std::uint32_t> lost_, unreachable_;  // the latter are not broken, and are tried again
  std::set<std::uint32_t> told_;                // of what was ever lost, and has not come since
  Clock::time_point tried_again_;
  std::chrono::milliseconds rest_ = streamer_.lost_rest_;
  std::uint64_t models_ = 0;
  bool said_settled_ = false;
  Clock::time_point given_at_;
};

SceneStreamer::SceneStreamer(std::filesystem::path path, std::function<void()> wake, const LodReaderWrap& wrap,
                             std::chrono::milliseconds lost_rest)
    : path_(std::move(path)),
      lost_rest_(lost_rest),
      news_(std::move(wake)),
      thread_(startWorker(news_, [this, wrap](const std::stop_token& stop) {
        News news;
        try {
          news.failed = findProblem(news, path_.string(), [&] { Run(*this, stop, wrap).run(); });
        } catch (const SceneRewritten&) {
          news.rewritten = true;
        }
        if (news.failed || news.rewritten) give(std::move(news));
      })) {}

void SceneStreamer::give(News news) {
  news_.give(std::move(news), [](News& held, News& fresh) {
    if (!fresh.scene) fresh.scene = std::move(held.scene);
    if (!held.problem.empty()) {
      fresh.problem = std::move(held.problem);
      fresh.error_kind = held.error_kind;
    }
    held = std::move(fresh);
  });
}

}  // namespace tg
