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
  // All ranks come here; `failed`: what has stopped this one, or null. Where some have been stopped, the first throws
  // the Error of the lowest of them, and the others EndedByFirst. So it goes where `text` is not the same at all ranks:
  // Error(usage), which calls it `what`.
  void agree(const std::exception_ptr& failed, const std::string& what, const std::string& text);

  // From now on all ranks are about to end, with the same code.
  void endTogether() { together_ = true; }
  // Last of all, with the program's exit code: ends this process's part in what all ranks end together, else all of
  // them at once with this code.
  void leave(int code);

 private:
  std::unique_ptr<Channel> channel_;
  bool together_ = false;
};

}  // namespace tg
