// SPDX-License-Identifier: Apache-2.0
// A member of a JSON that is free-form otherwise.
#include "core/bundle/training_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {
namespace {

// Null where there is none.
nlohmann::json memberOf(const std::string& training_json, const char* pointer) {
  if (training_json.empty()) return nullptr;
  try {
    const nlohmann::json json = parseJson(training_json, "training.json");
    const nlohmann::json::json_pointer member(pointer);
    return json.contains(member) ? json[member] : nullptr;
  } catch (const Error&) {
    return nullptr;
  }
}

bool isTrue(const std::string& training_json, const char* pointer) { return memberOf(training_json, pointer) == true; }

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

bool wasFiltered(const std::string& training_json) { return memberOf(training_json, "/settings/filter-3d") == "on"; }

std::optional<std::optional<Normalization>> normalizationOf(const std::string& training_json) {
  const nlohmann::json dataset = memberOf(training_json, "/dataset");
  if (!dataset.is_object() || !dataset.contains("normalized") || wasEdited(training_json)) return std::nullopt;
  const nlohmann::json& said = dataset["normalized"];
  if (said.is_null()) return std::optional<Normalization>();
  const auto number = [](const nlohmann::json& from) { return from.is_number() ? from.get<double>() : NAN; };
  if (!said.is_object() || !said.contains("scale") || !said.contains("origin")) return std::nullopt;
  const nlohmann::json& origin = said["origin"];
  if (!origin.is_array() || origin.size() != 3) return std::nullopt;
  const Normalization found{number(said["scale"]), {number(origin[0]), number(origin[1]), number(origin[2])}};
  if (!(found.scale > 0) || !std::isfinite(found.scale + found.origin.x + found.origin.y + found.origin.z)) {
    return std::nullopt;
  }
  return found;
}

}  // namespace tg
