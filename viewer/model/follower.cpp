// SPDX-License-Identifier: Apache-2.0
// A poll of the file's identity: works on every file system, and costs one system call.
#include "viewer/model/follower.h"

#include <chrono>
#include <exception>
#include <utility>

#include "core/file/file.h"
#include "core/file/identity.h"
#include "core/run/live.h"

namespace tg {
namespace {

constexpr std::chrono::milliseconds kPollPause(250);

// Of a run that is watched the model of this moment, else the one of its last checkpoint.
std::filesystem::path newestFile(const std::filesystem::path& file) {
  const std::filesystem::path live = file.parent_path() / kLiveModelName;
  return file.filename() == "model.tgz" && isFile(live) ? live : file;
}

}  // namespace

std::filesystem::path followedFile(const std::filesystem::path& path) {
  std::error_code ignored;
  const bool folder = std::filesystem::is_directory(path, ignored);
  return folder || !path.has_extension() || !path.has_filename() ? path / "model.tgz" : path;
}

ModelFollower::ModelFollower(std::filesystem::path file, std::function<void()> wake)
    : file_(std::move(file)),
      news_(std::move(wake)),
      thread_(startWorker(news_, [this](const std::stop_token& stop) { run(stop); })) {}

void ModelFollower::run(const std::stop_token& stop) {
  // A model that nobody has taken yet is worth more than the news that its file is gone.
  const auto keepModel = [](News& held, News& fresh) {
    if (!fresh.model) fresh.model = std::move(held.model);
    held = std::move(fresh);
  };
  std::optional<FileIdentity> shown;
  bool first = true;
  do {
    const std::filesystem::path file = newestFile(file_);
    const std::optional<FileIdentity> found = identityOf(file);
    if (!first && found == shown) continue;
    News news;
    if (!found) {
      news.problem = "waiting for " + file_.string();
      news.missing = true;
    } else {
      try {
        news.model = readModel(file, {.progress = &progress_});
      } catch (const std::exception& error) {
        news.problem = error.what();
      }
    }
    // A file that changed while it was read is read again, without a word about the half of it.
    const bool stable = identityOf(file) == found;
    if (stable || news.model) news_.give(std::move(news), keepModel);
    if (stable) shown = found;
    first = !stable;
  } while (sleepUnlessStopped(stop, kPollPause));
}

}  // namespace tg
