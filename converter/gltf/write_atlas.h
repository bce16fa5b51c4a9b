// SPDX-License-Identifier: Apache-2.0
// A model's textures as pictures and a list, for programs that know neither glTF nor the bundle.
#pragma once
#include <filesystem>

#include "converter/gltf/write_gltf.h"

namespace tg {

// NAME.png and NAME_alpha.png as far as the mode has them (NAME_1.png, ... for further atlases), and NAME.json: mode,
// intersection, extent, atlases with file names, scale and offset as in the glTF extension, and a rectangle per
// Gaussian. content.atlas: png8 or png16. Throws Error(badData) for a model without textures, Error(usage) for exr.
GltfReport writeAtlas(const std::filesystem::path& path, const GltfContent& content);

}  // namespace tg
