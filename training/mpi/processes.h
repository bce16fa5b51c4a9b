// SPDX-License-Identifier: Apache-2.0
// The processes of one training as a program sees them: that they are alike, that they begin together, and that an
// error of one is said once and ends them all.
#pragma once
#include <exception>
#include <memory>
#include <string>

#include "training/mpi/channel.h"

namespace tg {

// What ends a process whose first rank says why.
struct EndedByFirst : std::exception {
  int code;
  explicit EndedByFirst(int c) : code(c) {}
  const char* what() const noexcept override { return "ended by the first process"; }
};

class Processes {
 public:
  // arguments: of the command line. Throws Error(usage) at the first rank and EndedByFirst elsewhere where a rank's
  // version or arguments are others than the first's.
  Processes(std::unique_ptr<Channel> channel, const std::string& arguments);

  Channel& channel() { return *channel_; }
  bool isFirst() const { return channel_->rank() == 0; }

  // What the first rank says, everywhere.
  int fromFirst(int said);
  // Whether all ranks came as far as here: `failed` is what stopped this one, or null. Where it stopped some, the first
  // rank throws the Error of the lowest of them, and the others EndedByFirst. `text`, where all came here, is the same
  // everywhere, or it is `what` that differs: Error(badData).
  void agree(const std::exception_ptr& failed, const std::string& what, const std::string& text);

  // Last of all, with the program's exit code: ends this process's part where all have agreed on it or `together` says
  // so, else all processes.
  void leave(int code);
  // From now on a code is one that all ranks have.
  void endTogether() { together_ = true; }

 private:
  std::unique_ptr<Channel> channel_;
  bool together_ = false;
};

}  // namespace tg
