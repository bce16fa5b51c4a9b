// SPDX-License-Identifier: Apache-2.0
// Whether photographs show what a pinhole camera would: a hint for comparisons, no reader of data sets.
#pragma once
#include <filesystem>

namespace tg {

// Whether a camera of the data set in that folder has a lens: of COLMAP's sparse/ where there is one, else of
// transforms.json or transforms_train.json. False where neither is there or can be read.
bool hasLens(const std::filesystem::path& dataset);

}  // namespace tg
