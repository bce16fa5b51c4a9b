// SPDX-License-Identifier: Apache-2.0
// Several files at once: all of them or none.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/system/temporary_files.h"

namespace tg {

// Makes the folder where it is not there, its parent being; whether it did. Throws Error(cannotWrite).
bool createFolder(const std::filesystem::path& folder);

// The folder that files are written into, its parent being there. One that was not there is made, and gone again, if
// nothing is in it, when this ends without keep() or when a signal ends the program before.
class FolderToFill {
 public:
  // Throws Error(cannotWrite).
  explicit FolderToFill(const std::filesystem::path& folder);
  ~FolderToFill();
  FolderToFill& operator=(FolderToFill&&) = delete;

  void keep() { named_.reset(); }

 private:
  const std::filesystem::path folder_;
  std::optional<RemovedBySignal> named_;  // none: it was there, or is kept
};

// Files that belong together, as a .gltf and what it refers to: add() writes each to a temporary name beside its own,
// commit() gives them their names in that order. Without it nothing is left behind, and what was there before stays.
class AtomicFiles {
 public:
  // `replace`: files that are there already; otherwise add() refuses them.
  explicit AtomicFiles(bool replace = true);
  ~AtomicFiles();
  AtomicFiles& operator=(AtomicFiles&&) = delete;

  // Both forms as writeFileAtomically. Throws Error(cannotWrite).
  void add(const std::filesystem::path& path, const std::function<void(const std::filesystem::path& temporary)>& write);
  void add(const std::filesystem::path& path, std::span<const std::uint8_t> bytes);
  // Throws Error(cannotWrite); where a file cannot be renamed, those before it get their older content back, if the
  // file system has hard links.
  void commit();

 private:
  struct Entry;
  const bool replace_;
  std::vector<std::unique_ptr<Entry>> entries_;
};

// While it lives, what this thread writes atomically replaces no file: not even one that came while it was written.
class KeepExisting {
 public:
  explicit KeepExisting(bool keep = true);
  ~KeepExisting();
  KeepExisting& operator=(KeepExisting&&) = delete;

 private:
  const bool before_;
};

}  // namespace tg
