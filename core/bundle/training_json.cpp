// SPDX-License-Identifier: Apache-2.0
// A member of a JSON that is free-form otherwise.
#include "core/bundle/training_json.h"

#include <nlohmann/json.hpp>

#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {
namespace {

// False where there is none.
bool isTrue(const std::string& training_json, const char* pointer) {
  if (training_json.empty()) return false;
  try {
    const nlohmann::json json = parseJson(training_json, "training.json");
    const nlohmann::json::json_pointer member(pointer);
    return json.contains(member) && json[member] == true;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace

bool wasInterrupted(const std::string& training_json) { return isTrue(training_json, "/interrupted"); }
bool wasForValidation(const std::string& training_json) { return isTrue(training_json, "/dataset/validation"); }

}  // namespace tg
