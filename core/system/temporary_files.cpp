// SPDX-License-Identifier: Apache-2.0
// A fixed table of names that a handler may walk.
#include "core/system/temporary_files.h"

#include <unistd.h>

#include <atomic>
#include <climits>
#include <cstring>

namespace tg {

struct RemovedBySignal::Slot {
  std::atomic<bool> taken{false};
  std::atomic<bool> named{false};
  char path[PATH_MAX] = {};
};

namespace {

constinit RemovedBySignal::Slot slots[32];
static_assert(std::atomic<bool>::is_always_lock_free);

}  // namespace

RemovedBySignal::RemovedBySignal(const std::filesystem::path& path) {
  if (path.native().size() >= PATH_MAX) return;
  for (Slot& slot : slots) {
    if (slot.taken.exchange(true)) continue;
    std::memcpy(slot.path, path.c_str(), path.native().size() + 1);
    slot.named = true;
    slot_ = &slot;
    return;
  }
}

RemovedBySignal::~RemovedBySignal() {
  if (!slot_) return;
  slot_->named = false;
  slot_->taken = false;
}

void removeTemporaryFiles() noexcept {
  for (RemovedBySignal::Slot& slot : slots) {
    if (slot.named) ::unlink(slot.path);
  }
}

}  // namespace tg
