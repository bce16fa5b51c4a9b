// SPDX-License-Identifier: Apache-2.0
// Gaussians for a writer, a block at a time: of a model in memory, or straight from a file that is never in memory as a
// whole.
#pragma once
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/bundle/splat_rows.h"
#include "core/model/model.h"
#include "core/system/error.h"

namespace tg {

class GaussianBlocks {
 public:
  // Gaussians `first` to `first` + `count` of the whole are those from `begin` on of `model`.
  struct Block {
    const GaussianModel& model;
    std::size_t begin = 0;
    std::size_t first = 0;
    std::size_t count = 0;
  };
  // A thread's own; a block is valid until the next one that is made with it.
  struct Scratch {
    GaussianModel model;
    std::vector<std::uint8_t> bytes;
  };

  virtual ~GaussianBlocks() = default;
  virtual std::size_t size() const = 0;
  virtual int shDegree() const = 0;
  // From several threads. Throws Error.
  virtual Block block(std::size_t first, std::size_t count, Scratch& scratch) const = 0;
};

class ModelBlocks final : public GaussianBlocks {
 public:
  explicit ModelBlocks(const GaussianModel& model) : model_(model) {}
  std::size_t size() const override { return model_.size(); }
  int shDegree() const override { return model_.sh_degree; }
  Block block(std::size_t first, std::size_t count, Scratch&) const override { return {model_, first, first, count}; }

 private:
  const GaussianModel& model_;
};

// Rows that are no Gaussians as they are: their file is to be read as a whole, which mends them.
struct BrokenRows : Error {
  explicit BrokenRows(const std::string& path) : Error(ErrorKind::badData, path, "values are not finite") {}
};

// `file`'s rows must be plain and outlive this.
class FileBlocks final : public GaussianBlocks {
 public:
  FileBlocks(const SplatPlyFile& file, std::string path) : file_(file), path_(std::move(path)) {}
  std::size_t size() const override { return file_.rows().size(); }
  int shDegree() const override { return file_.rows().shDegree(); }
  // Throws BrokenRows.
  Block block(std::size_t first, std::size_t count, Scratch& scratch) const override;

 private:
  const SplatPlyFile& file_;
  const std::string path_;
};

}  // namespace tg
