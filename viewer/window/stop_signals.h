// SPDX-License-Identifier: Apache-2.0
// What a window does when it is asked to stop: by Ctrl-C, by kill, or because its terminal closes.
#pragma once
#include <functional>
#include <thread>

namespace tg {

// While it lives, the first of these signals is only noted, so that the window can keep its state before it ends; the
// second one ends the program at once. There is one at a time.
class StopSignals {
 public:
  // `wake` is called in another thread once there was one.
  explicit StopSignals(std::function<void()> wake);
  ~StopSignals();  // from now on they end the program at once
  StopSignals& operator=(StopSignals&&) = delete;

  int received() const;  // 0: none

 private:
  std::jthread thread_;
};

}  // namespace tg
