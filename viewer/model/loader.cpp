// SPDX-License-Identifier: Apache-2.0
// The loader's thread: read, describe, hand over; a part of a large model first.
#include "viewer/model/loader.h"

#include <chrono>
#include <new>
#include <utility>

#include "converter/registry/read_model.h"
#include "core/system/error.h"
#include "viewer/model/scene_of.h"

namespace tg {
namespace {

constexpr std::size_t kLargeModel = 500'000;  // Gaussians: a first picture of a part comes noticeably sooner

// Every k-th Gaussian, without textures, each as wide as the k that it stands for.
GaussianModel thinned(const GaussianModel& model) {
  const std::size_t step = (model.size() + kPreviewGaussians - 1) / kPreviewGaussians;
  const std::size_t sh_count = static_cast<std::size_t>(model.shCount());
  const float growth = previewGrowth(model.size(), model.size() / step);
  GaussianModel part;
  part.sh_degree = model.sh_degree;
  part.intersection = model.intersection;
  for (std::size_t i = 0; i < model.size(); i += step) {
    part.mean.push_back(model.mean[i]);
    part.rotation.push_back(model.rotation[i]);
    part.log_scale.push_back(model.log_scale[i] + growth);
    part.opacity_logit.push_back(model.opacity_logit[i]);
    part.sh.insert(part.sh.end(), model.sh.begin() + static_cast<std::ptrdiff_t>(i * sh_count),
                   model.sh.begin() + static_cast<std::ptrdiff_t>((i + 1) * sh_count));
  }
  return part;
}

}  // namespace

ModelLoader::ModelLoader(std::function<void()> wake) : wake_(std::move(wake)), thread_([this] { run(); }) {}

ModelLoader::~ModelLoader() {
  cancel();
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void ModelLoader::open(std::filesystem::path path) {
  {
    const std::lock_guard lock(mutex_);
    waiting_.push_back(std::move(path));
  }
  changed_.notify_all();
}

void ModelLoader::cancel() {
  const std::lock_guard lock(mutex_);
  waiting_.clear();
  if (progress_) progress_->cancel = true;
}

ModelLoader::Status ModelLoader::status() const {
  const std::lock_guard lock(mutex_);
  Status status;
  status.waiting = waiting_.size();
  status.news = news_.size();
  if (progress_) {
    status.path = reading_;
    status.done = progress_->done;
    status.total = progress_->total;
  } else if (!waiting_.empty()) {
    status.path = waiting_.front();
    --status.waiting;
  }
  return status;
}

std::optional<ModelLoader::News> ModelLoader::take() {
  const std::lock_guard lock(mutex_);
  if (news_.empty()) return std::nullopt;
  News news = std::move(news_.front());
  news_.pop_front();
  return news;
}

void ModelLoader::publish(News news) {
  {
    const std::lock_guard lock(mutex_);
    news_.push_back(std::move(news));
  }
  wake_();
}

void ModelLoader::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stop_ || !waiting_.empty(); });
    if (stop_) return;
    reading_ = std::move(waiting_.front());
    waiting_.pop_front();
    progress_ = std::make_shared<ReadProgress>();
    const std::shared_ptr<ReadProgress> progress = progress_;
    const std::filesystem::path path = reading_;
    lock.unlock();
    News news = load(path, *progress);
    lock.lock();
    // What is there at last counts as read even if cancel() came at the same moment.
    progress_.reset();
    reading_.clear();
    news_.push_back(std::move(news));
    lock.unlock();
    wake_();
    lock.lock();
  }
}

ModelLoader::News ModelLoader::load(const std::filesystem::path& path, ReadProgress& progress) {
  const auto start = std::chrono::steady_clock::now();
  News news;
  news.path = path;
  const auto publishPart = [&](Bundle part) {
    News first;
    first.path = path;
    first.finished = false;
    first.scene = sceneOf(std::move(part), path);
    first.scene->partial = true;
    publish(std::move(first));
  };
  progress.preview = [&](GaussianModel model) {
    Bundle part;
    part.model = std::move(model);
    publishPart(std::move(part));
  };
  try {
    Bundle loaded = readModel(path, {.progress = &progress});
    if (loaded.model.size() >= kLargeModel) {
      Bundle part;
      part.model = thinned(loaded.model);
      part.cameras = loaded.cameras;
      part.background = loaded.background;
      publishPart(std::move(part));
    }
    news.scene = sceneOf(std::move(loaded), path);
  } catch (const ReadCancelled&) {
  } catch (const Error& error) {
    news.problem = error.what();
    news.error_kind = static_cast<int>(error.kind);
  } catch (const std::bad_alloc&) {
    news.problem = path.string() + ": not enough memory";
    news.error_kind = static_cast<int>(ErrorKind::badData);
  } catch (const std::exception& error) {
    news.problem = path.string() + ": " + error.what();
    news.error_kind = static_cast<int>(ErrorKind::badData);
  }
  news.bytes = progress.total;
  news.read_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return news;
}

}  // namespace tg
