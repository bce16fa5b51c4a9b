// SPDX-License-Identifier: Apache-2.0
// The rows of a splat PLY and the Gaussians they stand for, a block at a time: what reads and writes models without
// holding their file.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/bundle/ply_vertices.h"
#include "core/file/file.h"
#include "core/model/model.h"

namespace tg {

constexpr std::size_t kSplatBlockRows = 4096;  // 1 MB of INRIA's rows: stays in a cache between reading and converting

// The layout of a file's rows.
class SplatRows {
 public:
  // `start`: the first bytes of a file of `total`, the header among them. Throws Error(badData) for what holds no
  // splats.
  SplatRows(std::span<const std::uint8_t> start, std::uint64_t total, const std::string& path);

  std::size_t size() const { return vertices_.size(); }
  int shDegree() const { return sh_degree_; }
  std::uint64_t firstRow() const { return vertices_.firstRow(); }  // [bytes] from the start of a binary file
  std::size_t stride() const { return vertices_.stride(); }        // [bytes] of a binary row
  std::uint64_t trailing() const { return vertices_.trailing(); }  // [bytes] that belong to no row
  void warn(std::vector<std::string>& warnings) const;             // of what is left out
  // Rows are binary, little endian and float32 throughout: only then may convert() be called.
  bool plain() const { return plain_; }

  // The rows at `bytes` become Gaussians `first` to `last` (excluded), without a check on the way: whether every
  // promise of a model was kept is the result.
  bool convert(const std::uint8_t* bytes, std::size_t first, std::size_t last, GaussianModel& model) const;
  // Of a file that is in memory as a whole, whatever its format. Where a promise of a model is broken: throws
  // Error(badData) naming the first value that is wrong, or sets `broken` if given.
  GaussianModel convertAll(bool* broken = nullptr) const;

 private:
  template <typename Values>
  void set(GaussianModel& model, std::size_t i, const Values& v) const;

  const std::string path_;
  const PlyVertices vertices_;
  int sh_degree_ = 0;
  bool flat_ = false;  // no scale_2
  bool plain_ = false;
  std::size_t dc_ = 0, rest_ = 0;     // first positions in columns_
  std::size_t filter_ = 0;            // the position of filter_3D; 0: none
  std::vector<int> columns_;          // properties that a model is made of
  std::vector<std::size_t> offsets_;  // [bytes] of columns_ in a row
};

// A splat PLY on disk.
class SplatPlyFile {
 public:
  // Throws Error(cannotRead / badData) for what holds no splats.
  explicit SplatPlyFile(const std::filesystem::path& path);

  const SplatRows& rows() const { return *rows_; }
  std::uint64_t bytes() const { return file_.size(); }
  // Rows `first` to `first` + `count` become Gaussians from `at` on; false as SplatRows::convert. From several threads,
  // each with a `scratch` of its own. Throws Error(cannotRead).
  bool read(std::size_t first, std::size_t count, std::size_t at, GaussianModel& model,
            std::vector<std::uint8_t>& scratch) const;

 private:
  const FileReader file_;
  std::unique_ptr<const SplatRows> rows_;
};

// A splat PLY whose bytes arrive piece by piece. Rows of plain floats are Gaussians at once; the bytes of any other
// format are kept until the end.
class SplatStream {
 public:
  // `total` bytes will come. `path` starts messages.
  SplatStream(std::uint64_t total, std::string path) : total_(total), path_(std::move(path)) {}

  // Throws Error(badData) for a header that is wrong.
  void add(std::span<const std::uint8_t> bytes);
  // As far as they are there: the first ready() Gaussians, not checked yet.
  const GaussianModel& model() const { return model_; }
  std::size_t ready() const { return ready_; }
  // After all bytes: the model, checked. Throws Error(badData).
  GaussianModel finish();

 private:
  void start();
  void addRows(std::span<const std::uint8_t> bytes);

  const std::uint64_t total_;
  const std::string path_;
  std::optional<SplatRows> rows_;  // once the header is there
  std::vector<std::uint8_t>
      pending_;                // before that; then a row that is not complete, or all of a file of no plain rows
  std::uint64_t skipped_ = 0;  // [bytes] of what stands before the first row, still to come
  std::size_t ready_ = 0;
  GaussianModel model_;
};

// For a reader's warnings.
constexpr const char* kAntialiasedWarning = "trained with antialiasing, which the model has no word for";
// Of SplatRows::trailing.
inline std::string trailingWarning(std::uint64_t bytes) {
  return std::to_string(bytes) + " bytes behind the rows are passed over";
}

// The header of INRIA's layout, and the bytes of a row.
std::string splatHeader(std::size_t gaussians, int sh_degree);
std::size_t splatRowBytes(int sh_degree);
// The rows of Gaussians [first, first + count).
void formatSplatRows(const GaussianModel& model, std::size_t first, std::size_t count, std::uint8_t* to);

}  // namespace tg
