// SPDX-License-Identifier: Apache-2.0
// Whether photographs show what a pinhole camera would: a hint for comparisons, no reader of data sets.
#pragma once
#include <filesystem>

namespace tg {

// Whether a camera of the data set in that folder has a lens: of COLMAP's sparse/0 or sparse where there is one, else
// of transforms_train.json or transforms.json, else of colmap/sparse/0. False where none is there or can be read, so of
// models in sparse/1 and later ones alone.
bool hasLens(const std::filesystem::path& dataset);

}  // namespace tg
