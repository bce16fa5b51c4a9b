// SPDX-License-Identifier: Apache-2.0
// Between the rows of a splat PLY and Gaussians.
#include "core/bundle/splat_rows.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "core/bundle/ply.h"
#include "core/bundle/read_progress.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"

namespace tg {
namespace {

constexpr std::uint32_t kExponent = 0x7f800000u;  // all ones: infinite or not a number
// 2DGS files have two scales. The third is this much thinner than the smaller one: flat, yet not degenerate.
const float kFlatLogScale = std::log(1e-4f);

// What Mip-Splatting (Yu et al., CVPR 2024, equation 9) draws of a Gaussian that it stores without its 3D filter: each
// variance has the filter's more, and the opacity is less by the square root of the volumes' quotient. What is no width
// makes scales that are no numbers.
void applyFilter(GaussianModel& model, std::size_t i, float sigma) {
  if (!(sigma >= 0)) sigma = std::numeric_limits<float>::quiet_NaN();
  double compensation = 1;
  for (int axis = 0; axis < 3; ++axis) {
    float& log_scale = model.log_scale[i][axis];
    const double scale = std::exp(static_cast<double>(log_scale)),
                 filtered = std::hypot(scale, static_cast<double>(sigma));
    compensation *= scale / filtered;
    log_scale = static_cast<float>(std::log(filtered));
  }
  model.opacity_logit[i] = logitFromOpacity(opacityOf(model, i) * compensation);
}

// Explains what a PLY without splats is, as far as its properties tell.
void requireSplats(const PlyVertices& ply) {
  if (ply.find("f_dc_0") >= 0) return;
  if (ply.find("packed_position") >= 0) {
    ply.fail("is a compressed splat PLY (expected float properties, found packed_position)");
  }
  if (ply.find("red") >= 0 || ply.find("diffuse_red") >= 0) {
    ply.fail("is a point cloud, not splats (expected property f_dc_0, found red)");
  }
  ply.fail("holds no splats (missing property f_dc_0)");
}

void appendFloats(std::uint8_t*& to, std::initializer_list<float> values) {
  std::memcpy(to, values.begin(), values.size() * sizeof(float));
  to += values.size() * sizeof(float);
}

bool allFinite(const float* values, std::size_t count) {
  std::uint32_t broken = 0;
  for (std::size_t i = 0; i < count; ++i) broken |= (std::bit_cast<std::uint32_t>(values[i]) & kExponent) == kExponent;
  return broken == 0;
}

// Of Gaussians `first` to `last` (excluded), first < last.
bool keepsPromises(const GaussianModel& model, std::size_t first, std::size_t last) {
  bool good = true;
  forEachField(
      [&]<typename T>(const Field& field, const std::vector<T>& all) {
        const std::size_t count = field.values(model.shCount());
        const std::span values = std::span(all).subspan(first * count, (last - first) * count);
        if constexpr (std::is_same_v<T, glm::vec4>) {
          good = good && (!field.quaternion || std::ranges::all_of(values, hasLength));
        }
        good = good && allFinite(reinterpret_cast<const float*>(values.data()), field.floats * values.size());
      },
      model);
  return good;
}

std::vector<std::uint8_t> startOf(const FileReader& file) {
  std::vector<std::uint8_t> start(static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), kMaxPlyHeaderBytes)));
  file.read(0, start);
  return start;
}

}  // namespace

SplatRows::SplatRows(std::span<const std::uint8_t> start, std::uint64_t total, const std::string& path)
    : path_(path), vertices_(start, total, path, "Gaussian") {
  requireSplats(vertices_);
  sh_degree_ = vertices_.shDegree();
  const auto add = [&](const std::string& name) { columns_.push_back(vertices_.require(name)); };
  for (const char* name : {"x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3", "opacity", "scale_0", "scale_1"}) {
    add(name);
  }
  flat_ = vertices_.find("scale_2") < 0;
  if (!flat_) add("scale_2");
  dc_ = columns_.size();
  for (int c = 0; c < 3; ++c) add("f_dc_" + std::to_string(c));
  rest_ = columns_.size();
  for (std::size_t k = 0; k < 3 * (shCountOf(sh_degree_) - 1); ++k) add("f_rest_" + std::to_string(k));
  if (!flat_ && vertices_.find("filter_3D") >= 0) filter_ = columns_.size(), add("filter_3D");
  plain_ = vertices_.plainFloats(columns_);
  for (int column : columns_) offsets_.push_back(vertices_.properties()[static_cast<std::size_t>(column)].offset);
}

static_assert(kFieldCount == 5, "rows lack it: SplatRows, splatHeader(), splatRowBytes(), formatSplatRows()");

// v(k) is the value of columns_[k].
template <typename Values>
void SplatRows::set(GaussianModel& model, std::size_t i, const Values& v) const {
  const std::size_t sh_count = model.shCount();
  model.mean[i] = {v(0), v(1), v(2)};
  model.rotation[i] = {v(3), v(4), v(5), v(6)};
  model.opacity_logit[i] = v(7);
  model.log_scale[i] = {v(8), v(9), flat_ ? std::min(v(8), v(9)) + kFlatLogScale : v(10)};
  glm::vec3* sh = model.sh.data() + i * sh_count;
  sh[0] = {v(dc_), v(dc_ + 1), v(dc_ + 2)};
  // Channel-major in the file: all of red, all of green, all of blue.
  const std::size_t red = rest_, green = red + sh_count - 1, blue = green + sh_count - 1;
  for (std::size_t k = 0; k + 1 < sh_count; ++k) sh[k + 1] = {v(red + k), v(green + k), v(blue + k)};
  if (filter_ > 0 && v(filter_) != 0) applyFilter(model, i, v(filter_));
}

void SplatRows::warn(std::vector<std::string>& warnings) const {
  if (trailing() != 0) warnings.push_back(trailingWarning(trailing()));
  if (vertices_.antialiased()) warnings.emplace_back(kAntialiasedWarning);
}

bool SplatRows::convert(const std::uint8_t* bytes, std::size_t first, std::size_t last, GaussianModel& model) const {
  TG_ASSERT(plain_, "only rows of plain floats are converted unchecked");
  TG_ASSERT(first <= last && last <= model.size(), "the model has room for the rows");
  TG_ASSERT(model.sh_degree == sh_degree_, "the model has the file's SH degree");
  if (first == last) return true;
  for (std::size_t i = first; i < last; ++i, bytes += stride()) {
    set(model, i, [&](std::size_t k) {
      float value;
      std::memcpy(&value, bytes + offsets_[k], sizeof(value));
      return value;
    });
  }
  return keepsPromises(model, first, last);
}

GaussianModel SplatRows::convertAll(bool* broken) const {
  GaussianModel model;
  resizeGaussians(model, size(), sh_degree_);
  vertices_.read(
      columns_,
      [&](std::size_t i, std::span<const float> values) { set(model, i, [&](std::size_t k) { return values[k]; }); },
      broken == nullptr);
  if (broken) {
    *broken = !keepsPromises(model, 0, size());
  } else {
    checkModel(model, path_);
  }
  return model;
}

SplatPlyFile::SplatPlyFile(const std::filesystem::path& path) : file_(path, kMaxPlyBytes) {
  rows_ = std::make_unique<SplatRows>(startOf(file_), file_.size(), path.string());
}

bool SplatPlyFile::read(std::size_t first, std::size_t count, std::size_t at, GaussianModel& model,
                        std::vector<std::uint8_t>& scratch) const {
  TG_ASSERT(first + count <= rows_->size(), "the file has these rows");
  TG_ASSERT(at + count <= model.size(), "the model has room for the rows");
  scratch.resize(count * rows_->stride());
  file_.read(rows_->firstRow() + std::uint64_t{first} * rows_->stride(), scratch);
  return rows_->convert(scratch.data(), at, at + count, model);
}

void SplatStream::add(std::span<const std::uint8_t> bytes) {
  if (rows_ && rows_->plain()) return addRows(bytes);
  pending_.insert(pending_.end(), bytes.begin(), bytes.end());
  if (!rows_ && pending_.size() >= std::min<std::uint64_t>(kMaxPlyHeaderBytes, total_)) start();
}

void SplatStream::start() {
  rows_.emplace(pending_, total_, path_);
  if (rows_->trailing() != 0) {
    throw Error(ErrorKind::badData, path_,
                "file is longer than its counts say (expected " + std::to_string(total_ - rows_->trailing()) +
                    " bytes, found " + std::to_string(total_) + ")");
  }
  if (!rows_->plain()) {
    pending_.reserve(static_cast<std::size_t>(total_));
    return;
  }
  resizeGaussians(model_, rows_->size(), rows_->shDegree());
  skipped_ = rows_->firstRow();
  addRows(std::exchange(pending_, {}));
}

void SplatStream::addRows(std::span<const std::uint8_t> bytes) {
  const auto skipped = static_cast<std::size_t>(std::min<std::uint64_t>(skipped_, bytes.size()));
  skipped_ -= skipped;
  bytes = bytes.subspan(skipped);
  const std::size_t stride = rows_->stride();
  const auto take = [&](std::span<const std::uint8_t> whole) {
    const std::size_t count = std::min(whole.size() / stride, rows_->size() - ready_);
    (void)rows_->convert(whole.data(), ready_, ready_ + count, model_);  // finish() checks all of them
    ready_ += count;
    return count * stride;
  };
  if (!pending_.empty()) {  // a row that two pieces share
    const std::size_t missing = std::min(bytes.size(), stride - pending_.size());
    pending_.insert(pending_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(missing));
    bytes = bytes.subspan(missing);
    if (pending_.size() < stride) return;
    take(pending_);
    pending_.clear();
  }
  bytes = bytes.subspan(take(bytes));
  if (ready_ < rows_->size()) pending_.assign(bytes.begin(), bytes.end());  // else: elements that no splat is made of
}

GaussianModel SplatStream::finish() {
  if (!rows_) start();
  if (!rows_->plain()) return SplatRows(pending_, total_, path_).convertAll();
  checkModel(model_, path_);
  return std::move(model_);
}

std::string splatHeader(std::size_t gaussians, int sh_degree) {
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(gaussians) + "\n";
  const auto add = [&](const std::string& name) { header += "property float " + name + "\n"; };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"}) add(name);
  for (std::size_t k = 0; k < 3 * (shCountOf(sh_degree) - 1); ++k) add("f_rest_" + std::to_string(k));
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) add(name);
  return header + "end_header\n";
}

std::size_t splatRowBytes(int sh_degree) {
  TG_ASSERT(sh_degree >= 0 && sh_degree <= 3, "an SH degree from 0 to 3");
  return sizeof(float) * (14 + 3 * shCountOf(sh_degree));
}

void formatSplatRows(const GaussianModel& model, std::size_t first, std::size_t count, std::uint8_t* to) {
  TG_ASSERT(first + count <= model.size(), "the model has these Gaussians");
  const std::size_t sh_count = model.shCount();
  for (std::size_t i = first; i < first + count; ++i) {
    const glm::vec3* sh = model.sh.data() + i * sh_count;
    appendFloats(to, {model.mean[i].x, model.mean[i].y, model.mean[i].z, 0.0f, 0.0f, 0.0f});
    appendFloats(to, {sh[0].x, sh[0].y, sh[0].z});
    for (int c = 0; c < 3; ++c) {
      for (std::size_t k = 1; k < sh_count; ++k) appendFloats(to, {sh[k][c]});
    }
    appendFloats(to, {model.opacity_logit[i], model.log_scale[i].x, model.log_scale[i].y, model.log_scale[i].z});
    const glm::vec4& q = model.rotation[i];
    appendFloats(to, {q.x, q.y, q.z, q.w});
  }
}

}  // namespace tg
