// SPDX-License-Identifier: Apache-2.0
// A poll of the file's identity: works on every file system, and costs one system call.
#include "viewer/model/follower.h"

#include <sys/stat.h>

#include <array>
#include <chrono>
#include <exception>
#include <utility>

namespace tg {
namespace {

constexpr std::chrono::milliseconds kPollPause(500);

// Another file, or other content, has another one of these.
using FileIdentity = std::array<std::int64_t, 5>;

std::optional<FileIdentity> identityOf(const std::filesystem::path& file) {
  struct stat status{};
  if (::stat(file.c_str(), &status) != 0) return std::nullopt;
  return FileIdentity{static_cast<std::int64_t>(status.st_dev), static_cast<std::int64_t>(status.st_ino),
                      static_cast<std::int64_t>(status.st_size), static_cast<std::int64_t>(status.st_mtim.tv_sec),
                      static_cast<std::int64_t>(status.st_mtim.tv_nsec)};
}

}  // namespace

std::filesystem::path followedFile(const std::filesystem::path& path) {
  std::error_code ignored;
  const bool folder = std::filesystem::is_directory(path, ignored);
  return folder || !path.has_extension() || !path.has_filename() ? path / "model.tgz" : path;
}

ModelFollower::ModelFollower(std::filesystem::path file, std::function<void()> wake)
    : file_(std::move(file)), wake_(std::move(wake)), thread_([this] { run(); }) {}

ModelFollower::~ModelFollower() {
  progress_.cancel = true;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void ModelFollower::run() {
  std::optional<FileIdentity> shown;
  bool first = true;
  for (;;) {
    const std::optional<FileIdentity> found = identityOf(file_);
    if (first || found != shown) {
      News news;
      if (!found) {
        news.problem = "waiting for " + file_.string();
      } else {
        try {
          news.model = readModel(file_, {.progress = &progress_});
        } catch (const std::exception& error) {
          news.problem = error.what();
        }
      }
      // A file that changed while it was read is read again, without a word about the half of it.
      const bool stable = identityOf(file_) == found;
      if (stable || news.model) publish(std::move(news));
      if (stable) shown = found;
      first = !stable;
    }
    std::unique_lock lock(mutex_);
    if (changed_.wait_for(lock, kPollPause, [this] { return stop_; })) return;
  }
}

void ModelFollower::publish(News news) {
  {
    const std::lock_guard lock(mutex_);
    // A model that nobody has taken yet is worth more than the news that its file is gone.
    if (news_ && news_->model && !news.model) news.model = std::move(news_->model);
    news_ = std::move(news);
  }
  changed_.notify_all();
  wake_();
}

std::optional<ModelFollower::News> ModelFollower::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(news_, std::nullopt);
}

ModelFollower::News ModelFollower::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return news_.has_value(); });
  return std::move(*std::exchange(news_, std::nullopt));
}

}  // namespace tg
