// SPDX-License-Identifier: Apache-2.0
// What takes a conversion long, and how far it is.
#pragma once
#include <cstddef>
#include <functional>

#include "core/system/names.h"

namespace tg {

// Steps of a fit to a viewer, and files that are written on the way to a target.
enum class ConvertPart : unsigned { fit, target };
constexpr auto namesOf(ConvertPart) { return enumNames("fit", "target"); }

// Hears how many steps of how many are done: none before the first, then each. On the caller's thread; what it throws
// ends the conversion, of which nothing is left, but an Error(usage) may count as a --target-size out of reach. A
// second search for one target counts anew, and one for a size may end before its last step.
using ConvertListener = std::function<void(ConvertPart part, std::size_t done, std::size_t steps)>;

}  // namespace tg
