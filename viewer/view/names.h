// SPDX-License-Identifier: Apache-2.0
// The texts of a window that are not the program's own.
#pragma once
#include <filesystem>
#include <functional>
#include <string_view>

#include "viewer/view/state.h"

namespace tg {

// Names of files, folders and cameras, what was typed, and messages, which name files: whatever the panels show of the
// state.
void forEachName(const ViewerState& state, const std::function<void(std::string_view)>& take);

// With all folders, for messages; as it is where the working folder is gone.
std::filesystem::path absolutePath(const std::filesystem::path& path);

}  // namespace tg
