// SPDX-License-Identifier: Apache-2.0
// A poll of identities, as ModelFollower's.
#include "viewer/model/file_watch.h"

#include <chrono>
#include <utility>

namespace tg {
namespace {

constexpr std::chrono::milliseconds kLookPause(250);

}  // namespace

FileWatch::FileWatch(std::function<void()> wake)
    : changed_(Queue<std::filesystem::path>::kUnlimited, std::move(wake)),
      thread_(startWorker(changed_, [this](const std::stop_token& stop) { run(stop); })) {}

void FileWatch::watch(const Files& files) {
  if (files == asked_) return;
  asked_ = files;
  watched_.give(files);
}

void FileWatch::run(const std::stop_token& stop) {
  struct Watched {
    FileIdentity read, told, seen;
  };
  std::map<std::filesystem::path, Watched> files;
  while (sleepUnlessStopped(stop, kLookPause)) {
    if (const std::optional<Files> asked = watched_.poll()) {
      std::erase_if(files, [&](const auto& file) { return !asked->contains(file.first); });
      for (const auto& [path, read] : *asked) {
        Watched& file = files.try_emplace(path, read, read, read).first->second;
        if (file.read != read) file = {read, read, read};
      }
    }
    for (auto& [path, file] : files) {
      const std::optional<FileIdentity> now = identityOf(path);
      if (!now || *now == file.told || std::exchange(file.seen, *now) != *now) continue;
      file.told = *now;
      changed_.give(path);
    }
  }
}

}  // namespace tg
