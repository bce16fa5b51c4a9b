// SPDX-License-Identifier: Apache-2.0
// --follow: a model file that is read again whenever it changes, as a training run replaces it.
#pragma once
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "converter/registry/read_model.h"
#include "core/bundle/read_progress.h"

namespace tg {

// FOLDER/model.tgz of a run folder, which may not be there yet; a name with an extension is the file itself.
std::filesystem::path followedFile(const std::filesystem::path& path);

// Looks at the file twice a second and reads it in a thread of its own. A file that is missing or cannot be read is a
// problem in words until it changes; it never throws.
class ModelFollower {
 public:
  struct News {
    std::optional<Bundle> model;  // a new one
    std::string problem;               // why there is none; "" once there is
  };

  // `wake` is called in that thread whenever there is news.
  ModelFollower(std::filesystem::path file, std::function<void()> wake);
  ~ModelFollower();
  ModelFollower(const ModelFollower&) = delete;
  ModelFollower& operator=(const ModelFollower&) = delete;

  const std::filesystem::path& file() const { return file_; }
  // What came since the last call; of several models, the last one.
  std::optional<News> take();
  // The same, but waits for it.
  News wait();

 private:
  void run();
  void publish(News news);

  const std::filesystem::path file_;
  const std::function<void()> wake_;
  ReadProgress progress_;  // stops a read at the end
  std::mutex mutex_;       // guards news_ and stop_
  std::condition_variable changed_;
  std::optional<News> news_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace tg
