// SPDX-License-Identifier: Apache-2.0
// How many members an aggregate has, for tables that are to have a row for each.
#pragma once
#include <cstddef>

namespace tg {

struct Anything {
  template <typename T>
  operator T() const;
};

// Its bases and members; also where no structured binding takes it apart, since its base has members, too.
template <typename T, typename... Given>
consteval std::size_t memberCount() {
  if constexpr (requires { T{Given()..., Anything()}; }) {
    return memberCount<T, Given..., Anything>();
  } else {
    return sizeof...(Given);
  }
}

}  // namespace tg
