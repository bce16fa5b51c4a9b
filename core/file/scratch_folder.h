// SPDX-License-Identifier: Apache-2.0
// Places for files that nobody is to see.
#pragma once
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "core/system/error.h"
#include "core/system/temporary_files.h"

namespace tg {

// A file of this name, if there is one by then, is gone when this ends, or when a signal ends the program before.
class ScratchFile {
 public:
  explicit ScratchFile(std::filesystem::path path) : path_(std::move(path)), named_(path_) {}
  ~ScratchFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  ScratchFile& operator=(ScratchFile&&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  RemovedBySignal named_;
};

// A folder, gone with what is in it when this ends, or when a signal ends the program before.
class ScratchFolder {
 public:
  // Throws Error(cannotWrite).
  ScratchFolder() {
    std::error_code error;
    const std::filesystem::path place = std::filesystem::temp_directory_path(error);
    if (error) {
      std::string wanted = "/tmp";
      for (const char* name : {"TEMPDIR", "TEMP", "TMP", "TMPDIR"}) {  // the last one counts
        if (const char* value = std::getenv(name)) wanted = value;
      }
      throw Error(ErrorKind::cannotWrite, wanted, "no folder for temporary files: " + error.message());
    }
    path_ = makeTemporaryFolder(place / "textured-gaussians-", 0700, named_);
    if (path_.empty()) {
      throw Error(ErrorKind::cannotWrite, place.string(), "cannot make a temporary folder here: " + systemReason());
    }
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder& operator=(ScratchFolder&&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  std::optional<RemovedBySignal> named_;
};

}  // namespace tg
