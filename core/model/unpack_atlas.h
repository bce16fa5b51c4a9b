// SPDX-License-Identifier: Apache-2.0
// Textures out of pages that are decoded one after the other.
#pragma once
#include <functional>
#include <span>
#include <string>

#include "core/model/atlas.h"

namespace tg {

// The inverse of packAtlas(), as unpackAtlas() of all pages: decode(page) [height, width, 4] is called for pages that a
// rectangle lies on, on several threads, and holds one page a thread. `size` [px] is each page's. Throws Error(badData)
// naming the first Gaussian whose rectangle leaves its page, and what `decode` throws.
TextureAtlas unpackAtlas(std::span<const AtlasPlacement> placements, int pages, glm::ivec2 size,
                         const std::function<Image(int page)>& decode, const std::string& path);

}  // namespace tg
