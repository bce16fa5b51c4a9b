// SPDX-License-Identifier: Apache-2.0
// The loader's thread: read, describe, hand over; a part of a large model first.
#include "viewer/model/loader.h"

#include <algorithm>
#include <chrono>
#include <new>
#include <utility>

#include "core/model/verbs.h"
#include "core/system/error.h"
#include "viewer/model/scene_of.h"

namespace tg {
namespace {

constexpr std::size_t kLargeModel = 500'000;  // Gaussians: a first picture of a part comes noticeably sooner

}  // namespace

ModelLoader::ModelLoader(std::function<void()> wake, ModelReader read)
    : read_(read ? std::move(read) : readModel),
      news_(Queue<News>::kUnlimited, std::move(wake)),
      thread_(startWorker(news_, [this](const std::stop_token& stop) {
        while (const auto file = waiting_.take(stop)) news_.give(load(**file));
      })) {}

void ModelLoader::open(std::filesystem::path path) {
  opened_.push_back(std::make_shared<File>());
  opened_.back()->path = std::move(path);
  waiting_.give(opened_.back());
}

void ModelLoader::cancel() {
  opened_.resize(opened_.size() - waiting_.clear());
  for (const std::shared_ptr<File>& file : opened_) file->cancel = true;
}

ModelLoader::Status ModelLoader::status() const {
  if (opened_.empty()) return {};
  const File& file = *opened_.front();
  return {file.path, file.done, file.total, opened_.size() - 1};
}

bool ModelLoader::reads(const std::filesystem::path& path) const {
  return std::ranges::any_of(opened_, [&](const std::shared_ptr<File>& file) { return sameFile(file->path, path); });
}

std::optional<ModelLoader::News> ModelLoader::take() {
  std::optional<News> news = news_.poll();
  if (news && news->finished) opened_.pop_front();
  return news;
}

// What is there at last counts as read even if cancel() came at the same moment.
ModelLoader::News ModelLoader::load(File& file) {
  const auto start = std::chrono::steady_clock::now();
  const std::filesystem::path& path = file.path;
  News news;
  news.path = path;
  const std::optional<FileIdentity> identity = identityOf(path);  // before it is read: what comes later is a change
  const auto publishPart = [&](Bundle part) {
    News first;
    first.path = path;
    first.finished = false;
    first.scene = sceneOf(std::move(part), path);
    first.scene->partial = true;
    first.scene->file = identity;
    news_.give(std::move(first));
  };
  file.preview = [&](GaussianModel model) {
    Bundle part;
    part.model = std::move(model);
    publishPart(std::move(part));
  };
  try {
    Bundle loaded = read_(path, {.progress = &file});
    if (loaded.model.size() >= kLargeModel) {
      Bundle part;
      part.model = thinned(loaded.model, loaded.model.size(), kPreviewGaussians);
      part.cameras = loaded.cameras;
      part.background = loaded.background;
      publishPart(std::move(part));
    }
    news.scene = sceneOf(std::move(loaded), path);
    news.scene->file = identity;
  } catch (const ReadCancelled&) {
  } catch (const Error& error) {
    news.problem = error.what();
    news.error_kind = static_cast<int>(error.kind);
  } catch (const std::bad_alloc&) {
    news.problem = path.string() + ": not enough memory";
    news.error_kind = static_cast<int>(ErrorKind::device);
  } catch (const std::exception& error) {
    news.problem = path.string() + ": " + error.what();
    news.error_kind = static_cast<int>(ErrorKind::badData);
  }
  news.bytes = file.total;
  news.read_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return news;
}

}  // namespace tg
