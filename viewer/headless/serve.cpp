// SPDX-License-Identifier: Apache-2.0
// --serve: a page instead of a window.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "converter/registry/file_format.h"
#include "converter/serve/page_server.h"
#include "core/file/identity.h"
#include "core/system/signals.h"
#include "viewer/headless/headless.h"
#include "viewer/model/file_watch.h"
#include "viewer/model/follower.h"
#include "viewer/model/run_watch.h"
#include "viewer/model/scene_of.h"

namespace tg {
namespace {

constexpr std::chrono::milliseconds kPause(100);

std::atomic<bool> stop_requested{false};

void requestStop(int signal) {
  if (stop_requested.exchange(true)) endAtOnce(signal);
}

// What a run is that nobody trains at the moment.
RunStatus restingStatus(const RunWatch::News& news, const std::string& training_json, const std::string& name) {
  RunStatus status{RunPhase::interrupted, name, news.lines->back()};
  if (!training_json.empty() && trainingProgress(training_json).finished) status.phase = RunPhase::finished;
  for (const RunMetrics& line : *news.lines) {
    if (line.test_psnr) status.now.test_psnr = line.test_psnr;
  }
  return status;
}

void serveRun(const ViewOptions& options, PageServer& page) {
  const std::filesystem::path folder = options.model.parent_path();
  const std::string name =
      std::filesystem::absolute(options.model).lexically_normal().parent_path().filename().string();
  ModelFollower follower(options.model, [] {});
  std::unique_ptr<RunWatch> watch;
  std::shared_ptr<const std::vector<RunMetrics>> lines;
  std::string training_json, problem;
  while (!stop_requested) {
    // Without a browser the run need not know that it is watched.
    if (page.watched() != (watch != nullptr)) watch = watch ? nullptr : std::make_unique<RunWatch>(folder, [] {});
    if (std::optional<ModelFollower::News> news = follower.take()) {
      if (!news->problem.empty() && news->problem != problem)
        std::fprintf(stderr, "tgview: %s\n", news->problem.c_str());
      problem = news->problem;
      if (news->model) {
        training_json = news->model->training_json;
        page.show(std::make_shared<const Bundle>(std::move(*news->model)));
      }
    }
    if (std::optional<RunWatch::News> news = watch ? watch->take() : std::nullopt) {
      if (news->lines != lines) page.show(*(lines = news->lines));
      if (!news->status && news->settled && !lines->empty()) news->status = restingStatus(*news, training_json, name);
      if (news->status) page.show(std::move(*news->status));
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace

void serveModel(const ViewOptions& options) {
  if (!options.follow) (void)detectFormat(options.model);  // a wrong name is said before anything is served
  const std::string title = options.model.filename().string();
  const std::unique_ptr<PageServer> page = servePage(options.serve, options.serve_token, title, {options.model});
  handleStopSignals(requestStop);
  if (options.follow) return serveRun(options, *page);
  std::optional<FileIdentity> read = identityOf(options.model);
  page->show(std::make_shared<const Bundle>(readModel(options.model)));
  FileWatch watch([] {});
  while (!stop_requested) {
    if (read) watch.watch({{options.model, *read}});
    std::this_thread::sleep_for(kPause);
    if (!watch.take()) continue;
    read = identityOf(options.model);
    try {
      page->show(std::make_shared<const Bundle>(readModel(options.model)));
    } catch (const std::exception& error) {
      std::fprintf(stderr, "tgview: %s\n", error.what());  // the one that was read stays
    }
  }
}

}  // namespace tg
