// SPDX-License-Identifier: Apache-2.0
// One program at a time in a folder.
#pragma once
#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>
#include <filesystem>

#include "core/file/file.h"
#include "core/system/descriptor.h"
#include "core/system/error.h"

namespace tg {

// Held for as long as it lives; the system lets go of it with the process, and it leaves no file. File systems without
// locks keep nobody out.
class FolderLock {
 public:
  // Throws Error(cannotWrite) where the folder cannot be opened, or another one holds it.
  explicit FolderLock(const std::filesystem::path& folder)
      : descriptor_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (descriptor_.get() < 0) {
      throw Error(ErrorKind::cannotWrite, folder.string(), "cannot open this folder: " + systemReason());
    }
    if (::flock(descriptor_.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      throw Error(ErrorKind::cannotWrite, folder.string(), "another tgtrain is at work in this folder");
    }
  }

 private:
  const Descriptor descriptor_;
};

}  // namespace tg
