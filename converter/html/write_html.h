// SPDX-License-Identifier: Apache-2.0
// Writes a model as a page that shows it, textures included, in any browser with WebGL 2 and without a network.
#pragma once
#include <filesystem>

#include "converter/gltf/write_gltf.h"

namespace tg {

// The model goes into the page as the GLB that writeGlb makes (always lean), compressed and in base64. The page's title
// is the file's name without extension. Same model and name, same bytes; atomic; memory beyond writeGlb's does not grow
// with the model. Throws what writeGlb throws. GltfReport::bytes is the page's size.
GltfReport writeHtml(const std::filesystem::path& path, const GltfContent& content);

}  // namespace tg
