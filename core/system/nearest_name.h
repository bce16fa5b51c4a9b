// SPDX-License-Identifier: Apache-2.0
// Which of some names somebody may have meant.
#pragma once
#include <span>
#include <string>
#include <string_view>

namespace tg {

// The name that `text` was meant to be, or "".
std::string nearestName(std::string_view text, std::span<const std::string> names);

}  // namespace tg
