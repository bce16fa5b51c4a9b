// SPDX-License-Identifier: Apache-2.0
// The handlers.
#include "core/system/signals.h"

#include "core/system/assert.h"
#include "core/system/temporary_files.h"

namespace tg {

void handleStopSignals(void (*handler)(int signal)) {
  TG_ASSERT(handler != nullptr, "a signal has a handler");
  for (const int signal : kStopSignals) {
    if (std::signal(signal, handler) == SIG_IGN) std::signal(signal, SIG_IGN);
  }
  if (std::signal(SIGPIPE, handler == endAtOnce ? endAtOnce : SIG_IGN) == SIG_IGN) std::signal(SIGPIPE, SIG_IGN);
}

void endAtOnce(int signal) noexcept {
  removeTemporaryFilesAtEnd();
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

}  // namespace tg
