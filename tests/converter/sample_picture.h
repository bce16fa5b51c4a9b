// SPDX-License-Identifier: Apache-2.0
// The expected picture of docs/gltf-extension/sample.glb.
#pragma once
#include <filesystem>

#include "core/image/image.h"

namespace tg::test {

constexpr const char* kSampleFolder = "docs/gltf-extension";  // from the repository's root

// sample.glb in `folder` as its camera sees it, by the float64 reference, 8-bit values in [0, 1].
Image renderSample(const std::filesystem::path& folder);

}  // namespace tg::test
