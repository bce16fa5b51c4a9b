// SPDX-License-Identifier: Apache-2.0
// A member of a JSON that is free-form otherwise.
#include "core/bundle/training_json.h"

#include <nlohmann/json.hpp>

#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {

bool wasInterrupted(const std::string& training_json) {
  if (training_json.empty()) return false;
  try {
    const nlohmann::json json = parseJson(training_json, "training.json");
    const auto interrupted = json.find("interrupted");
    return interrupted != json.end() && interrupted->is_boolean() && interrupted->get<bool>();
  } catch (const Error&) {
    return false;
  }
}

}  // namespace tg
