// SPDX-License-Identifier: Apache-2.0
// Options of a conversion that do nothing.
#pragma once
#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "converter/convert.h"

namespace tg {

// How the names of those files end that --base-only reads otherwise (Format::has_base).
std::vector<std::string> basedNames();

// Throws Error(usage) for the first option that does nothing, by tgconvert's flag. `given`: the flags. `output`: null
// where nothing is written, or in no known format. `inputs`: the files that are read; asked for where it counts. What
// options.edits merges is read besides.
void refuseIdle(const std::set<std::string>& given, const Format* output,
                const std::function<std::vector<std::filesystem::path>()>& inputs, const ConvertOptions& options);

}  // namespace tg
