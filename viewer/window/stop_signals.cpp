// SPDX-License-Identifier: Apache-2.0
// A handler may call next to nothing, and no function of GLFW: a thread of its own wakes the window.
#include "viewer/window/stop_signals.h"

#include <semaphore.h>

#include <atomic>
#include <cerrno>
#include <utility>

#include "core/system/signals.h"

namespace tg {
namespace {

std::atomic<int> first{0};
sem_t told;

void note(int signal) {
  const int error = errno;
  int none = 0;
  if (!first.compare_exchange_strong(none, signal)) endAtOnce(signal);
  sem_post(&told);
  errno = error;
}

}  // namespace

StopSignals::StopSignals(std::function<void()> wake) {
  first = 0;
  sem_init(&told, 0, 0);
  thread_ = std::jthread([wake = std::move(wake)] {
    while (sem_wait(&told) != 0) {
    }
    if (first != 0) wake();
  });
  handleStopSignals(note);
}

StopSignals::~StopSignals() {
  handleStopSignals(endAtOnce);
  sem_post(&told);
}

int StopSignals::received() const { return first; }

}  // namespace tg
