// SPDX-License-Identifier: Apache-2.0
// Which pictures of a HEIC are made of which: libheif (1.15) follows a circle until memory ends. Private to
// training/photos.
#pragma once
#include <cstdint>
#include <span>
#include <string>

namespace tg {

// Looks at the references of a HEIC (ISO/IEC 14496-12, box `iref`) alone: pictures made of others (`dimg`), and the
// ones that hold another's alpha (`auxl`). What is broken in between is left to the decoder. Throws Error(badData)
// where a picture would be made of itself, or of others of others more than 4 deep, and where all pictures are made of
// more than 65,536.
void checkHeifReferences(std::span<const std::uint8_t> bytes, const std::string& path);

}  // namespace tg
