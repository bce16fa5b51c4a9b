// SPDX-License-Identifier: Apache-2.0
// Blocks of a file.
#include "converter/formats/gaussian_blocks.h"

#include "core/bundle/ply.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {

GaussianBlocks::Block FileBlocks::block(std::size_t first, std::size_t count, Scratch& scratch) const {
  TG_ASSERT(file_.rows().plain(), "only rows of plain floats come in blocks");
  TG_ASSERT(first + count <= size(), "the file has these Gaussians");
  if (scratch.model.size() < count || scratch.model.sh_degree != shDegree()) {
    resizeGaussians(scratch.model, count, shDegree());
  }
  if (!file_.read(first, count, 0, scratch.model, scratch.bytes)) {
    readSplatPly(path_);  // says what is wrong
    throw Error(ErrorKind::badData, path_.string(), "changed while it was read");
  }
  return {scratch.model, 0, first, count};
}

}  // namespace tg
