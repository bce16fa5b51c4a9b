// SPDX-License-Identifier: Apache-2.0
// Whether two names are of one file, and whether a file is still what it was.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>

namespace tg {

// Another file, or other content, has another one of these.
using FileIdentity = std::array<std::int64_t, 5>;
// None where there is no file.
std::optional<FileIdentity> identityOf(const std::filesystem::path& file);

// Whether both names lead to one path, links followed. A file that is not there has only one name.
bool sameFile(const std::filesystem::path& a, const std::filesystem::path& b);

}  // namespace tg
