// SPDX-License-Identifier: Apache-2.0
// What is wrong with a glTF file although reading it gets by: alignment, extensionsUsed, extensionsRequired.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace tg {

// Adds "JSON pointer: what". Throws Error where the structure (container, JSON, references, sizes) is broken.
void findOverlooked(const std::filesystem::path& path, std::vector<std::string>& errors,
                    std::vector<std::string>& warnings);

}  // namespace tg
