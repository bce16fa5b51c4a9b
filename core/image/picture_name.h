// SPDX-License-Identifier: Apache-2.0
// Which files of a folder are pictures, by their names.
#pragma once
#include <filesystem>
#include <string>

#include "core/system/lower_case.h"

namespace tg {

// Whether the extension is one of the formats that readImage() of core/image/image.h takes.
inline bool isPictureName(const std::filesystem::path& path) {
  const std::string extension = lowerExtension(path);
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg" || extension == ".webp" ||
         extension == ".exr";
}

}  // namespace tg
