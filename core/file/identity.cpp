// SPDX-License-Identifier: Apache-2.0
// Names and stamps of files, one system call or two each.
#include "core/file/identity.h"

#include <sys/stat.h>

#include <system_error>

namespace tg {

std::optional<FileIdentity> identityOf(const std::filesystem::path& file) {
  struct stat status{};
  if (::stat(file.c_str(), &status) != 0) return std::nullopt;
  return FileIdentity{static_cast<std::int64_t>(status.st_dev), static_cast<std::int64_t>(status.st_ino),
                      static_cast<std::int64_t>(status.st_size), static_cast<std::int64_t>(status.st_mtim.tv_sec),
                      static_cast<std::int64_t>(status.st_mtim.tv_nsec)};
}

bool sameFile(const std::filesystem::path& a, const std::filesystem::path& b) {
  if (a == b) return true;
  if (a.empty() || b.empty()) return false;
  std::error_code error;
  const std::filesystem::path first = std::filesystem::canonical(a, error);
  if (error) return false;
  const std::filesystem::path second = std::filesystem::canonical(b, error);
  return !error && first == second;
}

}  // namespace tg
