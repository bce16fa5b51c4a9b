// SPDX-License-Identifier: Apache-2.0
// A model from any file the toolchain reads.
#include "converter/registry/read_model.h"

#include "converter/formats/read_compressed_ply.h"
#include "converter/formats/read_splat.h"
#include "converter/formats/read_spz.h"
#include "converter/gltf/read_gltf.h"
#include "converter/html/read_html.h"
#include "converter/registry/file_format.h"
#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"

namespace tg {

Bundle readModel(const std::filesystem::path& path, const ReadOptions& options) {
  const FileFormat format = detectFormat(path);
  Bundle loaded;
  switch (format) {
    case FileFormat::bundle:
      loaded = readBundle(path, {}, options.progress);
      break;
    case FileFormat::ply:
      loaded.model = readSplatPly(path, options.progress);
      break;
    case FileFormat::compressedPly:
      loaded.model = readCompressedPly(path);
      break;
    case FileFormat::splat:
      loaded = readSplat(path);
      checkModel(loaded.model, path.string());
      break;
    case FileFormat::spz:
      loaded = readSpz(path);
      break;
    case FileFormat::glb:
    case FileFormat::gltf:
      loaded = readGltf(path, options);
      checkModel(loaded.model, path.string());
      break;
    case FileFormat::html:
      loaded = parseGltf(readHtmlGlb(path), path.string(), options);
      checkModel(loaded.model, path.string());
      break;
  }
  loaded.format = name(format);
  return loaded;
}

}  // namespace tg
