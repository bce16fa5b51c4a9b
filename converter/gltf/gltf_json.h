// SPDX-License-Identifier: Apache-2.0
// The JSON of a glTF file beside what was read of it.
#pragma once
#include <nlohmann/json.hpp>
#include <optional>

namespace tg {

struct GltfJson {
  nlohmann::json root;                   // checked, its parts resolved
  std::optional<nlohmann::json> stored;  // before they were, where that is something else
  bool rewritten = false;                // `root` has integers where the file has decimals
};

}  // namespace tg
