// SPDX-License-Identifier: Apache-2.0
// Whether a glTF file names the extensions that it uses: for `tgconvert check`.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace tg {

// Adds "JSON pointer: what is wrong". `root`: the JSON as it stands in the file, of a document that can be read.
void checkExtensionLists(const nlohmann::json& root, std::vector<std::string>& errors,
                         std::vector<std::string>& warnings);

}  // namespace tg
