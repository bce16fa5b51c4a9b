// SPDX-License-Identifier: Apache-2.0
// Models that were read, as scenes.
#pragma once
#include <filesystem>

#include "converter/registry/read_model.h"
#include "viewer/view/options.h"
#include "viewer/view/scene.h"

namespace tg {

Scene sceneOf(Bundle loaded, const std::filesystem::path& path);
Scene sceneFor(const ViewOptions& options, Bundle loaded);  // with --up

}  // namespace tg
