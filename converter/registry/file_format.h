// SPDX-License-Identifier: Apache-2.0
// Tells splat files apart by their first bytes.
#pragma once
#include <filesystem>
#include <string>

namespace tg {

enum class FileFormat { bundle, ply, compressedPly, splat, spz, glb, gltf, html };

std::string_view name(FileFormat format);  // "tgz", "ply", "compressed.ply", "splat", "spz", "glb", "gltf", "html"

// .splat files have no magic number: they are told by their extension. Throws Error(cannotRead) for what is no readable
// file and Error(badData) for an empty one, for a format that is known but not supported (named in the message) and for
// anything else.
FileFormat detectFormat(const std::filesystem::path& path);

}  // namespace tg
