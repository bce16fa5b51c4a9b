// SPDX-License-Identifier: Apache-2.0
// Names that are addresses of the web, and no paths.
#pragma once
#include <string>

namespace tg {

inline bool isWebAddress(const std::string& name) {
  return name.starts_with("http://") || name.starts_with("https://");
}

}  // namespace tg
