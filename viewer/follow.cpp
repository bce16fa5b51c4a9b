// SPDX-License-Identifier: Apache-2.0
// A poll of the file's identity: works on every file system, and costs one system call.
#include "viewer/follow.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <exception>
#include <utility>

#include "core/error.h"
#include "core/json.h"

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

int whole(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return 0;
  const double value = found->get<double>();
  return value >= 0 && value <= 1e9 ? static_cast<int>(value) : 0;
}

const nlohmann::json* member(const nlohmann::json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(key);
  return found == object.end() || !found->is_object() ? nullptr : &*found;
}

}  // namespace

std::filesystem::path followedFile(const std::filesystem::path& path) {
  std::error_code ignored;
  const bool folder = std::filesystem::is_directory(path, ignored);
  return folder || !path.has_extension() || !path.has_filename() ? path / "model.tgz" : path;
}

TrainingProgress trainingProgress(const std::string& training_json) {
  TrainingProgress progress;
  if (training_json.empty()) return progress;
  nlohmann::json json;
  try {
    json = parseJson(training_json, "training.json");
  } catch (const Error&) {
    return progress;
  }
  const nlohmann::json* stages = member(json, "stages");
  if (!stages) return progress;
  const auto interrupted = json.find("interrupted");
  progress.finished = interrupted == json.end() || !interrupted->is_boolean() || !interrupted->get<bool>();
  // The stage that the run is in is the last one with steps; stages not begun have none. Stage untextured trains
  // another model for comparison: what this file holds is no part of it.
  for (const std::string stage : {"count", "plain", "textured", "untextured"}) {
    const nlohmann::json* report = member(*stages, stage.c_str());
    if (!report || (progress.finished && stage == "untextured") ||
        (!progress.stage.empty() && whole(*report, "iterations") == 0))
      continue;
    progress.stage = stage;
    progress.iteration = whole(*report, "iterations");
    const auto psnr = report->find("train_psnr");
    progress.psnr = psnr != report->end() && psnr->is_number() ? psnr->get<double>() : 0;
  }
  if (const nlohmann::json* settings = member(json, "settings")) {
    const bool second = progress.stage == "textured" || progress.stage == "untextured";
    progress.iterations = whole(*settings, second ? "texture-iterations" : "iterations");
  }
  return progress;
}

std::string formatProgress(const TrainingProgress& progress) {
  if (progress.stage.empty()) return "";
  std::string text = progress.stage + " " + std::to_string(progress.iteration);
  if (progress.iterations > 0) text += " / " + std::to_string(progress.iterations);
  return text;
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
