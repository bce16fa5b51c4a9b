// SPDX-License-Identifier: Apache-2.0
// For a thread that works beside one that must not wait for it.
#pragma once

namespace tg {

// While this lives, loops of core/system/parallel.h run on the thread that made it alone, as nested ones do: they hold
// no other thread's loop up.
class SerialLoops {
 public:
  SerialLoops();
  ~SerialLoops();
  SerialLoops& operator=(SerialLoops&&) = delete;

 private:
  const int outer_;
};

// This thread gives way to all others from now on.
void runInBackground();
// Processor time that this thread has taken. [s]
double threadSeconds();

}  // namespace tg
