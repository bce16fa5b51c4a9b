// SPDX-License-Identifier: Apache-2.0
// A small scene with levels of detail for tests of the program.
#pragma once
#include <filesystem>

#include "converter/lod/lod_scene.h"
#include "converter/lod/write_lod.h"
#include "viewer/process.h"

namespace tg::test {

// writeSample()'s cameras, and 4,000 of its Gaussians in leaves of 64.
inline LodScene writeLevels(const std::filesystem::path& path) {
  const std::filesystem::path source = path.parent_path().parent_path() / "levels-source.tgz";
  writeSample(source, 4000);
  (void)writeLod(path, readBundle(source), {.leaf = 64, .file = 512, .coarsest = 100, .merged = 4});
  std::filesystem::remove(source);
  return readLodScene(path);
}

}  // namespace tg::test
