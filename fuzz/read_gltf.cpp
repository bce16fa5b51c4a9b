// SPDX-License-Identifier: Apache-2.0
// Any bytes are a glTF file with splats or an Error, in memory as in a file, which is read in blocks; what was read is
// a sound model. Files of an odd size are read without their texture layer. Any bytes are also a tileset of 3D Tiles
// whose content lies beside it, or an Error.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <optional>
#include <string>

#include "converter/gltf/read_gltf.h"
#include "converter/gltf/read_tiles.h"
#include "core/system/error.h"

namespace {

template <typename Read>
std::optional<std::size_t> gaussians(const Read& read) {
  try {
    const tg::GaussianModel model = read().model;
    tg::checkModel(model, "fuzz.glb");
    return model.size();
  } catch (const tg::Error&) {
    return std::nullopt;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const int file = ::memfd_create("fuzz.glb", 0);
  static const std::string path = "/proc/self/fd/" + std::to_string(file);
  if (::ftruncate(file, 0) != 0 || ::pwrite(file, data, size, 0) != static_cast<ssize_t>(size)) std::abort();
  tg::ReadOptions options;
  options.base_only = size % 2 != 0;
  const auto from_memory = gaussians([&] { return tg::parseGltf({data, size}, "fuzz.glb", options); });
  const auto from_file = gaussians([&] { return tg::readGltf(path, options); });
  // A file may name others, which bytes alone may not.
  if (from_memory && from_memory != from_file) std::abort();
  try {
    const std::string name = tg::parseTileset({data, size}, "fuzz/tileset.json").name;
    if (name.empty() || name.front() == '/' || ("/" + name + "/").find("/../") != std::string::npos) std::abort();
  } catch (const tg::Error&) {
  }
  return 0;
}
