// SPDX-License-Identifier: Apache-2.0
// Which files of a folder are photographs, told by their first bytes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/system/names.h"

namespace tg {

enum class PictureFormat { none, jpeg, png, webp, heif };
constexpr auto namesOf(PictureFormat) { return enumNames("no photograph", "JPEG", "PNG", "WebP", "HEIC"); }

PictureFormat pictureFormat(std::span<const std::uint8_t> start);
PictureFormat pictureFormat(const std::filesystem::path& file);

struct PhotographList {
  std::vector<std::filesystem::path> photographs;  // below the folder, by name, in the order of their numbers
  std::vector<std::filesystem::path> drawn;        // pictures of these programs, left out where there are photographs
  std::vector<std::filesystem::path> masks;        // pictures in folders called masks, below the folder, sorted
  std::vector<std::string> unread;                 // pictures in formats that are not read: RAW, TIFF, JPEG XL
  std::vector<std::string> films;                  // which want a command each
  std::vector<std::string> closed;                 // files and folders that may not be read, and why
  std::vector<std::string> ignored;                // other files below it
};

// Of a folder and those in it, also by links to folders, but for hidden ones, __MACOSX, folders of runs, of
// unpacked SOGs, and work folders of tgtrain photos. A link that leads above the folder, or to more files than there
// may be in all, is ignored. Throws Error(cannotRead) for a folder that cannot be listed, Error(badData) for one of
// more than `most_files`.
PhotographList findPhotographs(const std::filesystem::path& folder, std::size_t most_files = 100'000);

// A photograph, and the first one that has the same bytes.
struct PhotographCopy {
  std::filesystem::path copy, original;  // below the folder
};
// Takes those out of a folder's sorted photographs that are another's bytes again.
std::vector<PhotographCopy> takeOutCopies(const std::filesystem::path& folder,
                                          std::vector<std::filesystem::path>& photographs);

// Whether a folder without cameras holds photographs, or a path names a film: what `tgtrain photos` is for.
bool isForPhotos(const std::filesystem::path& path);

// A name for a copy of each photograph: its own where that is letters, digits, '_', '-', else with '_' in their place,
// the folders before it; no two alike on any file system. Letters are ASCII's, or all that UTF-8 has beyond it. Without
// extension.
std::vector<std::string> plainNames(const std::vector<std::filesystem::path>& photographs);

}  // namespace tg
