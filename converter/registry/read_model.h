// SPDX-License-Identifier: Apache-2.0
// A model from any file the toolchain reads: model.tgz, INRIA's splat PLY, compressed PLY, .splat, SPZ, and glTF with
// KHR_gaussian_splatting.
#pragma once
#include <filesystem>

#include "converter/formats/read_options.h"
#include "core/bundle/bundle.h"

namespace tg {

// Told apart by content; .splat, which has no magic number, by its extension. The model has passed checkModel. Throws
// Error(cannotRead / badData); formats that are known but not supported are named. ReadCancelled: options.progress
// said so.
Bundle readModel(const std::filesystem::path& path, const ReadOptions& options = {});

}  // namespace tg
