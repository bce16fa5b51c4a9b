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
  // The rest stays byte by byte.
  const std::size_t inside = training_json.find('{') + 1;
  const std::size_t next = training_json.find_first_not_of(" \t\r\n", inside);
  if (inside == 0 || next == std::string::npos) return;
  training_json.insert(inside, training_json[next] == '}' ? "\"edited\": true" : "\"edited\": true,");
}

bool wasForValidation(const std::string& training_json) { return isTrue(training_json, "/dataset/validation"); }

}  // namespace tg
