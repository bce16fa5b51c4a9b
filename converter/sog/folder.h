// SPDX-License-Identifier: Apache-2.0
// SOG version 2 that is not bundled: meta.json and the images that it names, beside it or in folders there.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "converter/sog/sog.h"
#include "core/bundle/bundle.h"

namespace tg {

constexpr const char* kSogMetaName = "meta.json";

// `name` without a "./" before it, where it stays inside: parts of letters, ASCII or beyond it, digits, spaces and
// _ - . ( ) +, none of which begins with a dot, with '/' between them.
std::optional<std::string> nameInside(std::string_view name);
// The words for another name.
std::string leavesFolder(const std::string& name);
// `read` of meta.json and of names that stay inside its folder; of others Error(badData), which `path` begins.
SogFiles filesInside(SogFiles read, std::string path);

// As readSog. `meta`: the JSON, whatever its name.
Bundle readSogFolder(const std::filesystem::path& meta, bool base_only = false);
// Bytes of the images that it names, 0 of what is not there. Throws Error(cannotRead / badData).
std::uint64_t bytesOfSogImages(const std::filesystem::path& meta);

}  // namespace tg
