// SPDX-License-Identifier: Apache-2.0
// Blocks of a file.
#include "converter/formats/gaussian_blocks.h"

#include "core/model/verbs.h"
#include "core/system/assert.h"

namespace tg {

GaussianBlocks::Block FileBlocks::block(std::size_t first, std::size_t count, Scratch& scratch) const {
  TG_ASSERT(file_.rows().plain(), "only rows of plain floats come in blocks");
  TG_ASSERT(first + count <= size(), "the file has these Gaussians");
  if (scratch.model.size() < count || scratch.model.sh_degree != shDegree()) {
    resizeGaussians(scratch.model, count, shDegree());
  }
  if (!file_.read(first, count, 0, scratch.model, scratch.bytes)) throw BrokenRows(path_);
  return {scratch.model, 0, first, count};
}

}  // namespace tg
