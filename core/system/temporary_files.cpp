// SPDX-License-Identifier: Apache-2.0
// A fixed table of names that a handler may walk.
#include "core/system/temporary_files.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

namespace tg {

struct RemovedBySignal::Slot {
  std::atomic<bool> taken{false};
  std::atomic<bool> named{false};
  std::atomic<bool> if_empty{false};
  char path[PATH_MAX] = {};
};

namespace {

constinit RemovedBySignal::Slot slots[32];
static_assert(std::atomic<bool>::is_always_lock_free);

// Names that live, in all threads and in this one, without those of threads that wait for the end.
constinit std::atomic<int> alive{0};
constinit thread_local int alive_here = 0;
constinit std::atomic<bool> ending{false};

constexpr int kPauseMs = 2, kMostPauses = 50;

// A program that ends makes no new files, and says nothing of those that were taken from under its writers.
void waitForTheEnd() noexcept {
  if (!ending) return;
  alive -= alive_here;
  for (;;) ::pause();
}

constexpr int kMostDepth = 16;  // of folders in folders: more are left behind

// An entry of getdents64(2): readdir() may take memory, which a handler must not.
struct Entry {
  std::uint64_t inode;
  std::int64_t offset;
  std::uint16_t length;  // [bytes] to the next entry
  std::uint8_t type;
  char name[1];
};

// Empties and removes folder `name` of the folder `at`; whether it is gone.
bool removeFolder(int at, const char* name, int depth) noexcept {
  const int folder = ::openat(at, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (folder < 0) return false;
  alignas(Entry) char entries[4096];
  for (bool removed = true; removed;) {  // entries may move while others are removed: once more from the start
    removed = false;
    ::lseek(folder, 0, SEEK_SET);
    for (long size; (size = ::syscall(SYS_getdents64, folder, entries, sizeof entries)) > 0;) {
      for (long first = 0; first < size;) {
        const char* start = entries + first;
        std::uint16_t length;
        std::memcpy(&length, start + offsetof(Entry, length), sizeof length);
        const char* entry = start + offsetof(Entry, name);
        first += length;
        if (std::strcmp(entry, ".") == 0 || std::strcmp(entry, "..") == 0) continue;
        const bool gone =
            ::unlinkat(folder, entry, 0) == 0 || (depth < kMostDepth && removeFolder(folder, entry, depth + 1));
        removed = removed || gone;
      }
    }
  }
  ::close(folder);
  return ::unlinkat(at, name, AT_REMOVEDIR) == 0;
}

}  // namespace

RemovedBySignal::RemovedBySignal(const std::filesystem::path& path, bool if_empty) {
  ++alive;  // before it looks: who ends the program sees one of the two
  ++alive_here;
  waitForTheEnd();
  if (path.native().size() >= PATH_MAX) return;
  for (Slot& slot : slots) {
    if (slot.taken.exchange(true)) continue;
    std::memcpy(slot.path, path.c_str(), path.native().size() + 1);
    slot.if_empty = if_empty;
    slot.named = true;
    slot_ = &slot;
    return;
  }
}

RemovedBySignal::~RemovedBySignal() {
  waitForTheEnd();
  --alive;
  --alive_here;
  if (!slot_) return;
  slot_->named = false;
  slot_->taken = false;
}

std::filesystem::path makeTemporaryFolder(const std::filesystem::path& stem, mode_t mode,
                                          std::optional<RemovedBySignal>& removed) {
  static std::atomic<unsigned> counter{0};
  for (;;) {
    std::filesystem::path path = stem;
    path += std::to_string(::getpid()) + "-" + std::to_string(counter++);
    struct stat there{};
    if (::lstat(path.c_str(), &there) == 0) continue;  // somebody else's: no signal may take it
    removed.emplace(path);
    if (::mkdir(path.c_str(), mode) == 0) return path;
    const int reason = errno;
    removed.reset();
    errno = reason;
    if (reason != EEXIST) return {};
  }
}

void removeTemporaryFiles() noexcept {
  for (RemovedBySignal::Slot& slot : slots) {
    if (!slot.named || slot.if_empty) continue;
    if (::unlink(slot.path) == 0 || (errno != EISDIR && errno != EPERM)) continue;
    // Under another name no thread puts more files into it.
    char moved[PATH_MAX + 1];
    const std::size_t length = std::strlen(slot.path);
    std::memcpy(moved, slot.path, length);
    std::memcpy(moved + length, "~", 2);
    const bool away = ::rename(slot.path, moved) == 0;
    removeFolder(AT_FDCWD, away ? moved : slot.path, 0);
  }
  for (RemovedBySignal::Slot& slot : slots) {
    if (slot.named && slot.if_empty) ::rmdir(slot.path);
  }
}

void removeTemporaryFilesAtEnd() noexcept {
  ending = true;
  removeTemporaryFiles();
  for (int i = 0; i < kMostPauses && alive > alive_here; ++i) ::poll(nullptr, 0, kPauseMs);
  removeTemporaryFiles();
}

}  // namespace tg
