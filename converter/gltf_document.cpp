// SPDX-License-Identifier: Apache-2.0
// A glTF or GLB file whose every index, offset and count has been checked.
#include "converter/gltf_document.h"

#include "converter/gltf_check.h"
#include "converter/gltf_resolve.h"

namespace tg {
namespace {

// tinygltf hands over an image's encoded bytes; they are kept as they are.
bool keepEncoded(tinygltf::Image* image, int, std::string*, std::string*, int, int, const unsigned char* bytes,
                 int size, void*) {
  image->image.assign(bytes, bytes + size);
  return true;
}

// Nothing outside the file exists.
tinygltf::FsCallbacks noFiles() {
  tinygltf::FsCallbacks none{};
  none.FileExists = [](const std::string&, void*) { return false; };
  none.ExpandFilePath = [](const std::string& path, void*) { return path; };
  none.ReadWholeFile = [](std::vector<unsigned char>*, std::string*, const std::string&, void*) { return false; };
  none.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&, void*) {
    return false;
  };
  return none;
}

}  // namespace

GltfDocument loadGltf(std::span<const std::uint8_t> bytes, const std::string& path,
                      const std::optional<std::filesystem::path>& folder) {
  GltfDocument document;
  document.path = path;
  GltfParts parts;
  parts.json = bytes;
  if (bytes.size() >= 4 && std::string_view(reinterpret_cast<const char*>(bytes.data()), 4) == "glTF") {
    parts = splitGlb(bytes, document.path);
  }
  const std::optional<std::vector<std::uint8_t>> resolved = resolveGltf(bytes, parts, folder, document.path);
  if (resolved) {
    bytes = *resolved;
    parts = splitGlb(bytes, document.path);
  }
  checkGltfJson(parseGltfJson(parts.json, document.path), parts, document.path);

  tinygltf::TinyGLTF loader;
  loader.SetImageLoader(keepEncoded, nullptr);
  loader.SetFsCallbacks(noFiles());
  std::string error;
  std::string warning;
  const auto size = static_cast<unsigned>(bytes.size());
  bool ok = false;
  try {
    ok = parts.binary ? loader.LoadBinaryFromMemory(&document.model, &error, &warning, bytes.data(), size)
                      : loader.LoadASCIIFromString(&document.model, &error, &warning,
                                                   reinterpret_cast<const char*>(bytes.data()), size, "");
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  if (!ok) throw Error(ErrorKind::badData, document.path, "no valid glTF: " + error);
  return document;
}

}  // namespace tg
