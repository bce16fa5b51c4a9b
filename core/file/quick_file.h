// SPDX-License-Identifier: Apache-2.0
// Files that are worth nothing after a crash.
#pragma once
#include <filesystem>
#include <functional>

namespace tg {

// As writeFileAtomically of core/file/file.h, but nothing waits for the disk.
void writeFileQuickly(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& temporary)>& write);

}  // namespace tg
