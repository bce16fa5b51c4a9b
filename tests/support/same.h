// SPDX-License-Identifier: Apache-2.0
// Equality of models and moments that says which parameter differs.
#pragma once
#include "core/model/fields.h"
#include "support/catch.h"

namespace tg::test {

template <typename Set>
void checkSame(const Set& a, const Set& b) {
  forEachParameter(
      [](const Field& field, const auto& x, const auto& y) {
        INFO(field.name);
        CHECK((x == y));
      },
      a, b);
  CHECK((a == b));
}

}  // namespace tg::test
