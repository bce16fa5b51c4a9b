// SPDX-License-Identifier: Apache-2.0
// Which version this is.
#pragma once

namespace textured_gaussians {

// MAJOR.MINOR.PATCH of the library that is linked, by semantic versioning (docs/library.md).
const char* version();

}  // namespace textured_gaussians
