// SPDX-License-Identifier: Apache-2.0
// Reads models in a thread of its own, one after another, and says how far it is.
#pragma once
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "converter/registry/file_format.h"
#include "core/bundle/read_progress.h"
#include "core/system/worker.h"
#include "viewer/view/scene.h"

namespace tg {

using ModelReader = std::function<Bundle(const std::filesystem::path& path, const ReadOptions& options)>;

// All members may be called from one other thread; none of them waits for a file.
class ModelLoader {
 public:
  // `wake` is called in the loader's thread whenever there is news, and `read` (empty: readModel) for each file.
  ModelLoader(std::function<void()> wake, ModelReader read);
  ~ModelLoader() { cancel(); }

  void open(std::filesystem::path path);
  // The file at hand and those that wait.
  void cancel();

  struct Status {
    std::filesystem::path path;  // the first whose last news has not been taken; empty: none
    std::uint64_t done = 0;      // [bytes]
    std::uint64_t total = 0;     // 0: not known
    std::size_t waiting = 0;     // files after it
  };
  Status status() const;
  // Whether news of that file, by whatever name, is still to be taken, be it at hand or waiting.
  bool reads(const std::filesystem::path& path) const;

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
  struct File : ReadProgress {
    std::filesystem::path path;
  };
  News load(File& file);

  const ModelReader read_;
  std::deque<std::shared_ptr<File>> opened_;  // whose last news has not been taken; the other thread's
  Queue<std::shared_ptr<File>> waiting_;
  Queue<News> news_;
  std::jthread thread_;
};

}  // namespace tg
