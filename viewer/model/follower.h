// SPDX-License-Identifier: Apache-2.0
// --follow: a model file that is read again whenever it changes, as a training run replaces it.
#pragma once
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "converter/registry/file_format.h"
#include "core/bundle/read_progress.h"
#include "core/system/worker.h"

namespace tg {

// FOLDER/model.tgz of a run folder, which may not be there yet; a name with an extension is the file itself.
std::filesystem::path followedFile(const std::filesystem::path& path);

// Looks at the file a few times a second - in a run's folder at live.tgz, while that is there - and reads it in a
// thread of its own. A file that is missing or cannot be read is a problem in words until it changes; it never throws.
class ModelFollower {
 public:
  struct News {
    std::optional<Bundle> model;  // a new one
    std::string problem;          // why there is none; "" once there is
    bool missing = false;         // `problem`: the file is not there (yet)
  };

  // `wake` is called in that thread whenever there is news.
  ModelFollower(std::filesystem::path file, std::function<void()> wake);
  ~ModelFollower() { progress_.cancel = true; }

  const std::filesystem::path& file() const { return file_; }
  // What came since the last call; of several models, the last one.
  std::optional<News> take() { return news_.poll(); }
  // The same, but waits for it.
  News wait() { return news_.take().value(); }

 private:
  void run(const std::stop_token& stop);

  const std::filesystem::path file_;
  ReadProgress progress_;  // stops a read at the end
  LatestValue<News> news_;
  std::jthread thread_;
};

}  // namespace tg
