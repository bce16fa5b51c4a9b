// SPDX-License-Identifier: Apache-2.0
// Sample files and data sets that are too large for the repository.
#pragma once
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <string>

namespace tg::test {

// Below ../shared, or the folder that the environment names as TG_SHARED; it need not be there.
inline std::filesystem::path sharedFile(const std::string& name) {
  const char* folder = std::getenv("TG_SHARED");
  return std::filesystem::path(folder != nullptr ? folder : "../shared") / name;
}

// For TG_SKIP_IF: which of these is not there, "" when all are.
inline std::string missingShared(std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (!std::filesystem::exists(sharedFile(name))) return "no " + sharedFile(name).string() + " (set TG_SHARED)";
  }
  return "";
}

}  // namespace tg::test
