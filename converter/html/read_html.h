// SPDX-License-Identifier: Apache-2.0
// Takes the model out of a page that writeHtml made.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace tg {

// The GLB in the page. Throws Error(cannotRead / badData).
std::vector<std::uint8_t> readHtmlGlb(const std::filesystem::path& path);
std::vector<std::uint8_t> parseHtmlGlb(std::span<const std::uint8_t> bytes, const std::string& path);

}  // namespace tg
