// SPDX-License-Identifier: Apache-2.0
// --serve: a model, and the run that makes it, as a page in browsers of other machines.
#pragma once
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/bundle/bundle.h"
#include "core/image/image.h"
#include "core/run/live.h"
#include "core/run/metrics.h"

namespace tg {

// Where to serve, and to whom.
struct ServeOptions {
  std::string host = "127.0.0.1";
  int port = 0;       // 0: any free one
  std::string token;  // that every request must bring; "": none is needed
  bool local = true;  // the host is this machine alone
};
// "[ADDRESS:]PORT" and the token of --serve-token; where others can reach the address and none is given, a random one.
// Throws Error(usage).
ServeOptions parseServe(const std::string& where, const std::string& token);

// The page draws the newest model that it was given; one that runs may be followed there. All members but the
// constructor cost what a few copies cost: what takes time is done in threads that give way to all others. To be called
// from one thread.
class PageServer {
 public:
  // `title`: of the page. `subject`: the files that tell what is shown from all else; a page that is open goes on in
  // place with a program of the same ones. Throws Error(device) where it cannot listen.
  PageServer(const ServeOptions& options, std::string title, const std::vector<std::filesystem::path>& subject = {});
  ~PageServer();
  PageServer& operator=(PageServer&&) = delete;

  // To open, with the token.
  std::string url() const;

  // Somebody has asked within the last seconds.
  bool watched() const;
  // It is watched, and a newer model may be shown: as often as its making takes a twentieth of the time at most.
  bool wantsModel() const;

  // With its cameras and background.
  void show(std::shared_ptr<const Bundle> model);
  // All lines of the run's metrics.jsonl, or one more; thinned, and shown with the next status.
  void show(const std::vector<RunMetrics>& lines);
  void add(RunMetrics line);
  void show(RunStatus status);
  // The run's seconds hold a pause: they do not say how far it is. A status that is paused says it, too.
  void notePause();
  // A held-out photograph and the picture of it, of one size.
  void showHeldOut(const std::string& name, Image photograph, Image picture);

  // Waits until whoever watches has seen what was shown last; at most so long.
  void linger(std::chrono::milliseconds most, const std::atomic<bool>* stop = nullptr) const;

 private:
  class Pages;
  std::unique_ptr<Pages> pages_;
};

// The server of --serve and --serve-token; `said` gets its address. Throws what parseServe and PageServer throw.
std::unique_ptr<PageServer> servePage(const std::string& where, const std::string& token, const std::string& title,
                                      const std::vector<std::filesystem::path>& subject, std::FILE* said = stdout);

}  // namespace tg
