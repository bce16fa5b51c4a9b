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
bool wasEdited(const std::string& training_json) { return isTrue(training_json, "/edited"); }

void noteEdited(std::string& training_json) {
  if (training_json.empty() || wasEdited(training_json)) return;
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(training_json, nullptr, false);
  if (!json.is_object()) return;
  if (json.contains("edited")) {
    json["edited"] = true;
    training_json = dumpJson(json, 1) + "\n";
  } else {  // the rest stays byte by byte
    training_json.insert(training_json.find('{') + 1, json.empty() ? "\"edited\": true" : "\"edited\": true,");
  }
}

bool wasForValidation(const std::string& training_json) { return isTrue(training_json, "/dataset/validation"); }

}  // namespace tg
