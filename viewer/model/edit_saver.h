// SPDX-License-Identifier: Apache-2.0
// Writes the edited model to a file, beside everything else.
#pragma once
#include <filesystem>
#include <functional>
#include <thread>

#include "core/bundle/bundle.h"
#include "core/system/worker.h"
#include "viewer/view/state.h"

namespace tg {

class EditSaver {
 public:
  // `wake` is called in another thread when update() has news.
  explicit EditSaver(std::function<void()> wake);

  // Takes up what the state asks for, one file after the other, and says what came of it. `scripted`: a failure is
  // thrown, and nothing is announced. Call once a frame.
  void update(ViewerState& state, bool scripted);

 private:
  struct Job {
    std::filesystem::path document, file;
    std::shared_ptr<const GaussianModel> model;
    Bundle beside;  // all but the model
    std::uint64_t revision = 0;
    bool whole = false;  // the file holds all of the model
    std::string problem;
    int error_kind = 0;
    std::vector<std::string> warnings;
  };
  static void write(Job& job);

  Queue<Job> asked_, done_;
  std::size_t under_way_ = 0;
  std::jthread thread_;
};

}  // namespace tg
