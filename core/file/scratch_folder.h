// SPDX-License-Identifier: Apache-2.0
// A place for files that nobody is to see.
#pragma once
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

#include "core/system/error.h"

namespace tg {

// A folder, gone with what is in it when this ends.
class ScratchFolder {
 public:
  // Throws Error(cannotWrite).
  ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "textured-gaussians-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw Error(ErrorKind::cannotWrite, name, "cannot make a temporary folder");
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder& operator=(ScratchFolder&&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace tg
