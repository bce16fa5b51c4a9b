// SPDX-License-Identifier: Apache-2.0
// A model from any file the toolchain reads.
#include "converter/registry/read_model.h"

#include "converter/registry/file_format.h"

namespace tg {

Bundle readModel(const std::filesystem::path& path, const ReadOptions& options) {
  const Format& format = detectFormat(path);
  Bundle loaded = format.read(path, options);
  loaded.format = format.name;
  return loaded;
}

}  // namespace tg
