// SPDX-License-Identifier: Apache-2.0
// A folder of its own for one test, gone afterwards, and files in it.
#pragma once
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "support/temporary_folder.h"

class Scratch {
 public:
  const std::filesystem::path& folder() const { return folder_.path; }
  std::filesystem::path write(const std::string& name, std::string_view bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }

 private:
  tg::TemporaryFolder folder_;
};
