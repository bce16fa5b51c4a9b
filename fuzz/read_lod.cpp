// SPDX-License-Identifier: Apache-2.0
// Any bytes are a lod-meta.json or an Error; of what was read every leaf has a level within the budget, and no file is
// asked for outside its folder.
#include <algorithm>
#include <cstdlib>

#include "converter/lod/lod_scene.h"
#include "core/system/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const tg::LodScene scene = tg::parseLodScene({data, size}, "fuzz/lod-meta.json");
    const tg::Camera camera = tg::lookAt({1, 2, -3}, {0, 0, 0}, {0, -1, 0}, 0.8, 640, 480);
    const std::uint64_t budget = size % 4096;
    const std::vector<std::uint8_t> levels = tg::chooseLevels(scene, camera, budget);
    const std::uint64_t coarsest = tg::countOf(scene, tg::sameLevel(scene, scene.levels - 1));
    if (tg::countOf(scene, levels) > std::max(budget, coarsest)) std::abort();
    const tg::LodReader reader = [](const std::string& name, std::uint64_t) -> std::vector<std::uint8_t> {
      if (name.empty() || name.front() == '/' || ("/" + name).find("/..") != std::string::npos) std::abort();
      throw tg::Error(tg::ErrorKind::cannotRead, name, "no such file");
    };
    for (const std::uint32_t file : tg::filesOf(scene, levels)) {
      if (file >= scene.files.size()) std::abort();
      try {
        (void)tg::readLodFile(scene, file, reader);
      } catch (const tg::Error&) {
      }
    }
  } catch (const tg::Error&) {
  }
  return 0;
}
