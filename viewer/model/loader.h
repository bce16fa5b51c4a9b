// SPDX-License-Identifier: Apache-2.0
// Reads models in a thread of its own, one after another, and says how far it is.
#pragma once
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "core/bundle/read_progress.h"
#include "viewer/view/scene.h"

namespace tg {

// All members may be called from one other thread; none of them waits for a file.
class ModelLoader {
 public:
  // `wake` is called in the loader's thread whenever there is news.
  explicit ModelLoader(std::function<void()> wake);
  // Stops reading.
  ~ModelLoader();
  ModelLoader(const ModelLoader&) = delete;
  ModelLoader& operator=(const ModelLoader&) = delete;

  void open(std::filesystem::path path);
  // The file at hand and those that wait.
  void cancel();

  struct Status {
    std::filesystem::path path;  // being read; empty: none
    std::uint64_t done = 0;      // [bytes]
    std::uint64_t total = 0;     // 0: not known
    std::size_t waiting = 0;     // files after it
    std::size_t news = 0;        // not taken yet
  };
  Status status() const;

  struct News {
    std::filesystem::path path;
    std::optional<Scene> scene;  // a part of the model (scene->partial) or all of it
    std::string problem;         // why there is none; "" with a scene and after cancel()
    bool finished = true;        // nothing more comes of this file
    double read_seconds = 0;     // wall time from open to all of it
    std::uint64_t bytes = 0;     // of the file
    int error_kind = 0;          // ErrorKind of the problem
  };
  // In order of arrival.
  std::optional<News> take();

 private:
  void run();
  News load(const std::filesystem::path& path, ReadProgress& progress);
  void publish(News news);

  const std::function<void()> wake_;
  mutable std::mutex mutex_;  // guards all below but the thread
  std::condition_variable changed_;
  std::deque<std::filesystem::path> waiting_;
  std::filesystem::path reading_;
  std::shared_ptr<ReadProgress> progress_;
  std::deque<News> news_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace tg
