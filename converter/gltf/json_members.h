// SPDX-License-Identifier: Apache-2.0
// What stands under a key of JSON whose shape nobody has checked.
#pragma once
#include <nlohmann/json.hpp>

namespace tg {

// Null where the key is absent or `object` is none.
inline const nlohmann::json& member(const nlohmann::json& object, const char* key) {
  static const nlohmann::json none;
  const auto found = object.is_object() ? object.find(key) : object.end();
  return object.is_object() && found != object.end() ? *found : none;
}

// An empty array where `key` is no array.
inline const nlohmann::json& list(const nlohmann::json& object, const char* key) {
  static const nlohmann::json none = nlohmann::json::array();
  const nlohmann::json& value = member(object, key);
  return value.is_array() ? value : none;
}

}  // namespace tg
