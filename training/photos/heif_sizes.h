// SPDX-License-Identifier: Apache-2.0
// How large the pictures are that a HEIC or AVIF has its decoders make. Private to training/photos.
#pragma once
#include <cstdint>
#include <span>
#include <string>

namespace tg {

// Pixels of the largest picture of a HEIC or AVIF, 0 where none is told: of a grid or an overlay (ISO/IEC 23008-12) by
// its own numbers, of HEVC by the SPS, of AV1 by the sequence headers, in properties and in what is coded. By these
// libheif takes memory, and 1.15 writes out of bounds beyond 2^31 bytes, whatever `ispe` says, which is the size that a
// caller gets to see. What is broken in between is left to the decoder. Throws Error(badData) where the pictures take
// more than 16 times the file's bytes together: parts of it that are taken time and again.
std::uint64_t largestHeifPicture(std::span<const std::uint8_t> bytes, const std::string& path);

}  // namespace tg
