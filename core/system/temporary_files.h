// SPDX-License-Identifier: Apache-2.0
// The names of temporary files and folders, kept where a signal handler finds them.
#pragma once
#include <sys/types.h>

#include <filesystem>
#include <optional>

namespace tg {

// A file, or a folder with what is in it, that removeTemporaryFiles() removes while this lives; `if_empty`: a folder
// that may be somebody else's by then, once the others are removed and if that leaves nothing in it. Of more than 32 at
// a time, the others are left behind.
class RemovedBySignal {
 public:
  explicit RemovedBySignal(const std::filesystem::path& path, bool if_empty = false);
  ~RemovedBySignal();
  RemovedBySignal& operator=(RemovedBySignal&&) = delete;

  struct Slot;

 private:
  Slot* slot_ = nullptr;
};

// Makes a folder whose name is `stem` and a number that nothing there has, with `mode` as far as the umask allows, and
// holds it in `removed` before it is there. Where it cannot be made: empty, with errno, and `removed` is empty.
std::filesystem::path makeTemporaryFolder(const std::filesystem::path& stem, mode_t mode,
                                          std::optional<RemovedBySignal>& removed);

// Removes the temporary files and folders of writes that are under way in any thread: async-signal-safe. Those writes
// fail.
void removeTemporaryFiles() noexcept;

// The same for a signal handler that ends the program: a thread that begins or ends a write from here on waits for ever,
// and what one was about to make under a name that it had already is removed as well, if it does within 100 ms.
void removeTemporaryFilesAtEnd() noexcept;

}  // namespace tg
