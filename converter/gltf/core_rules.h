// SPDX-License-Identifier: Apache-2.0
// Rules of glTF 2.0 that no reader of ours needs and every other one may: for `tgconvert check`.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "converter/gltf/document.h"

namespace tg {

// Adds "JSON pointer: what is wrong". `root`: the document's JSON, which checkGltfJson has passed. Takes time linear in
// the file: of accessors that overlap without end only the first ones' numbers are looked at, with a warning.
void checkCoreRules(const nlohmann::json& root, const GltfDocument& document, std::vector<std::string>& errors,
                    std::vector<std::string>& warnings);

}  // namespace tg
