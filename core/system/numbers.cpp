// SPDX-License-Identifier: Apache-2.0
// Text to numbers, or an error that says what was expected.
#include "core/system/numbers.h"

#include <cmath>
#include <cstdio>

#include "core/system/error.h"

namespace tg {

void refuseValue(const std::string& what, const std::string& text, const std::string& expected) {
  throw Error(ErrorKind::usage, what + ": expected " + expected + ", found \"" + text + "\"");
}

double parseNumber(const std::string& text, const std::string& what) {
  const auto value = parseWhole<double>(text);
  if (!value || !std::isfinite(*value)) refuseValue(what, text, "a number");
  return *value;
}

double parseNumber(const std::string& text, double low, double high, const std::string& what) {
  const auto value = parseWhole<double>(text);
  if (!value || !(*value >= low && *value <= high)) {
    char limits[80];
    std::snprintf(limits, sizeof limits, "a number from %g to %g", low, high);
    refuseValue(what, text, limits);
  }
  return *value;
}

}  // namespace tg
