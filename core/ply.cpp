// SPDX-License-Identifier: Apache-2.0
// Splat PLY in INRIA's layout, and point clouds.
#include "core/ply.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/ply_vertices.h"
#include "core/read_progress.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxPlyBytes = kMaxGaussians * 62 * 8;
constexpr std::size_t kMaxHeaderBytes = 1 << 20;
constexpr std::size_t kBlockRows = 4096;  // 1 MB of INRIA's rows: stays in a cache between reading and converting
// 2DGS files have two scales. The third is this much thinner than the smaller one: flat, yet not degenerate.
const float kFlatLogScale = std::log(1e-4f);

// Explains what a PLY without splats is, as far as its properties tell.
void requireSplats(const PlyVertices& ply) {
  if (ply.find("f_dc_0") >= 0) return;
  if (ply.find("packed_position") >= 0)
    ply.fail("is a compressed splat PLY (expected float properties, found packed_position)");
  if (ply.find("red") >= 0 || ply.find("diffuse_red") >= 0)
    ply.fail("is a point cloud, not splats (expected property f_dc_0, found red)");
  ply.fail("holds no splats (missing property f_dc_0)");
}

int shDegree(const PlyVertices& ply) {
  const std::size_t rest = ply.countPrefix("f_rest_");
  for (int degree = 0; degree <= 3; ++degree)
    if (rest == static_cast<std::size_t>(3 * ((degree + 1) * (degree + 1) - 1))) return degree;
  ply.fail("wrong number of f_rest properties (expected 0, 9, 24 or 45, found " + std::to_string(rest) + ")");
}

void appendFloats(std::uint8_t*& to, std::initializer_list<float> values) {
  std::memcpy(to, values.begin(), values.size() * sizeof(float));
  to += values.size() * sizeof(float);
}

// The properties that a model is made of.
struct Columns {
  explicit Columns(const PlyVertices& ply) : sh_degree(shDegree(ply)) {
    const auto add = [&](const std::string& name) { indices.push_back(ply.require(name)); };
    for (const char* name : {"x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3", "opacity", "scale_0", "scale_1"})
      add(name);
    flat = ply.find("scale_2") < 0;
    if (!flat) add("scale_2");
    dc = indices.size();
    for (int c = 0; c < 3; ++c) add("f_dc_" + std::to_string(c));
    rest = indices.size();
    const int rest_count = 3 * ((sh_degree + 1) * (sh_degree + 1) - 1);
    for (int k = 0; k < rest_count; ++k) add("f_rest_" + std::to_string(k));
  }
  int sh_degree;
  bool flat = false;
  std::size_t dc = 0, rest = 0;  // first positions in `indices`
  std::vector<int> indices;      // of properties
};

GaussianModel sized(std::size_t n, int sh_degree) {
  GaussianModel model;
  model.sh_degree = sh_degree;
  model.mean.resize(n);
  model.rotation.resize(n);
  model.log_scale.resize(n);
  model.opacity_logit.resize(n);
  model.sh.resize(n * static_cast<std::size_t>(model.shCount()));
  return model;
}

// Row i of the file becomes Gaussian i; v(k) is the value of columns.indices[k].
template <typename Values>
void setGaussian(GaussianModel& model, std::size_t i, const Columns& columns, const Values& v) {
  const std::size_t sh_count = static_cast<std::size_t>(model.shCount());
  model.mean[i] = {v(0), v(1), v(2)};
  model.rotation[i] = {v(3), v(4), v(5), v(6)};
  model.opacity_logit[i] = v(7);
  model.log_scale[i] = {v(8), v(9), columns.flat ? std::min(v(8), v(9)) + kFlatLogScale : v(10)};
  glm::vec3* sh = model.sh.data() + i * sh_count;
  sh[0] = {v(columns.dc), v(columns.dc + 1), v(columns.dc + 2)};
  // Channel-major in the file: all of red, all of green, all of blue.
  const std::size_t red = columns.rest, green = red + sh_count - 1, blue = green + sh_count - 1;
  for (std::size_t k = 0; k + 1 < sh_count; ++k) sh[k + 1] = {v(red + k), v(green + k), v(blue + k)};
}

// The same for rows whose columns are all float32, without a check on the way: whether every promise of a model was
// kept is the result.
class FloatRows {
 public:
  FloatRows(const PlyVertices& ply, const Columns& columns) : columns_(columns), stride_(ply.stride()) {
    for (int index : columns.indices) offsets_.push_back(ply.properties()[static_cast<std::size_t>(index)].offset);
  }

  // Rows at `bytes`, of which every `step`-th is taken, become Gaussians `first` to `last`.
  bool convert(const std::uint8_t* bytes, std::size_t step, std::size_t first, std::size_t last,
               GaussianModel& model) const {
    std::uint32_t broken = 0;
    std::vector<float> values(offsets_.size());
    for (std::size_t i = first; i < last; ++i, bytes += step * stride_) {
      for (std::size_t k = 0; k < offsets_.size(); ++k) std::memcpy(&values[k], bytes + offsets_[k], sizeof(float));
      for (float value : values) broken |= (std::bit_cast<std::uint32_t>(value) & kExponent) == kExponent;
      const float length_squared = glm::dot(model.rotation[i] = {values[3], values[4], values[5], values[6]},
                                            glm::vec4(values[3], values[4], values[5], values[6]));
      broken |= !(length_squared > 0.0f) || std::isinf(length_squared);
      setGaussian(model, i, columns_, [&](std::size_t k) { return values[k]; });
    }
    return broken == 0;
  }

 private:
  static constexpr std::uint32_t kExponent = 0x7f800000u;  // all ones: infinite or not a number
  const Columns& columns_;
  std::size_t stride_;
  std::vector<std::size_t> offsets_;
};

// All rows, in blocks on all cores. rows(offset of the first one, length, scratch) hands out their bytes.
template <typename Rows>
std::optional<GaussianModel> convertAll(const PlyVertices& ply, const Columns& columns, const Rows& rows) {
  GaussianModel model = sized(ply.size(), columns.sh_degree);
  const FloatRows floats(ply, columns);
  std::atomic<bool> good{true};
  const std::size_t blocks = (ply.size() + kBlockRows - 1) / kBlockRows;
  std::vector<std::vector<std::uint8_t>> scratch(static_cast<std::size_t>(threadCount()));
  parallelForWorkers(static_cast<std::int64_t>(blocks), 1, [&](std::int64_t block, int worker) {
    const std::size_t first = static_cast<std::size_t>(block) * kBlockRows;
    const std::size_t last = std::min(first + kBlockRows, ply.size());
    const std::uint8_t* bytes = rows(ply.firstRow() + first * ply.stride(), (last - first) * ply.stride(),
                                     scratch[static_cast<std::size_t>(worker)]);
    if (!floats.convert(bytes, 1, first, last, model)) good = false;
  });
  return good ? std::optional(std::move(model)) : std::nullopt;
}

// Any format, and messages that name the first value that is wrong.
GaussianModel convertSlowly(const PlyVertices& ply, const Columns& columns, const std::string& path) {
  GaussianModel model = sized(ply.size(), columns.sh_degree);
  ply.read(columns.indices, [&](std::size_t i, std::span<const float> values) {
    setGaussian(model, i, columns, [&](std::size_t k) { return values[k]; });
  });
  checkModel(model, path);
  return model;
}

}  // namespace

GaussianModel parseSplatPly(std::span<const std::uint8_t> bytes, const std::string& path) {
  const PlyVertices ply(bytes, path, "Gaussian");
  requireSplats(ply);
  const Columns columns(ply);
  if (ply.plainFloats(columns.indices)) {
    auto model = convertAll(ply, columns, [&](std::uint64_t offset, std::size_t, std::vector<std::uint8_t>&) {
      return bytes.data() + offset;
    });
    if (model) return std::move(*model);
  }
  return convertSlowly(ply, columns, path);
}

GaussianModel previewSplatPly(std::span<const std::uint8_t> start, std::uint64_t total) {
  try {
    const PlyVertices ply(start, total, "", "Gaussian");
    requireSplats(ply);
    const Columns columns(ply);
    if (!ply.plainFloats(columns.indices) || start.size() <= ply.firstRow()) return {};
    const std::size_t rows = (start.size() - static_cast<std::size_t>(ply.firstRow())) / ply.stride();
    const std::size_t step = std::max<std::size_t>(1, (rows + kPreviewGaussians - 1) / kPreviewGaussians);
    GaussianModel model = sized(rows / step, columns.sh_degree);
    const bool good = FloatRows(ply, columns).convert(start.data() + ply.firstRow(), step, 0, model.size(), model);
    if (!good) return {};
    for (glm::vec3& scale : model.log_scale) scale += previewGrowth(ply.size(), model.size());
    return model;
  } catch (const Error&) {
    return {};  // said when all of it has been read
  }
}

GaussianModel readSplatPly(const std::filesystem::path& path, ReadProgress* progress) {
  {
    const FileReader file(path, kMaxPlyBytes);
    if (progress) progress->total = file.size();
    std::vector<std::uint8_t> start(static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), kMaxHeaderBytes)));
    file.read(0, start);
    const PlyVertices ply(start, file.size(), path.string(), "Gaussian");
    requireSplats(ply);
    const Columns columns(ply);
    if (ply.plainFloats(columns.indices)) {
      auto model =
          convertAll(ply, columns, [&](std::uint64_t offset, std::size_t length, std::vector<std::uint8_t>& scratch) {
            if (progress) progress->advance(length);
            scratch.resize(length);
            file.read(offset, scratch);
            return static_cast<const std::uint8_t*>(scratch.data());
          });
      if (model) return std::move(*model);
    }
  }
  return parseSplatPly(readFile(path, kMaxPlyBytes), path.string());
}

std::vector<std::uint8_t> formatSplatPly(const GaussianModel& model) {
  const std::size_t n = model.size();
  const std::size_t sh_count = static_cast<std::size_t>(model.shCount());
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(n) + "\n";
  std::size_t properties = 0;
  const auto add = [&](const std::string& name) {
    header += "property float " + name + "\n";
    ++properties;
  };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"}) add(name);
  for (std::size_t k = 0; k < 3 * (sh_count - 1); ++k) add("f_rest_" + std::to_string(k));
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) add(name);
  header += "end_header\n";

  const std::size_t stride = properties * sizeof(float);
  std::vector<std::uint8_t> bytes(header.size() + n * stride);
  std::memcpy(bytes.data(), header.data(), header.size());
  parallelFor(static_cast<std::int64_t>(n), 4096, [&](std::int64_t item) {
    const std::size_t i = static_cast<std::size_t>(item);
    std::uint8_t* to = bytes.data() + header.size() + i * stride;
    const glm::vec3* sh = model.sh.data() + i * sh_count;
    appendFloats(to, {model.mean[i].x, model.mean[i].y, model.mean[i].z, 0.0f, 0.0f, 0.0f});
    appendFloats(to, {sh[0].x, sh[0].y, sh[0].z});
    for (int c = 0; c < 3; ++c)
      for (std::size_t k = 1; k < sh_count; ++k) appendFloats(to, {sh[k][c]});
    appendFloats(to, {model.opacity_logit[i], model.log_scale[i].x, model.log_scale[i].y, model.log_scale[i].z});
    const glm::vec4& q = model.rotation[i];
    appendFloats(to, {q.x, q.y, q.z, q.w});
  });
  return bytes;
}

void writeSplatPly(const std::filesystem::path& path, const GaussianModel& model) {
  checkModel(model, path.string());
  writeFileAtomically(path, formatSplatPly(model));
}

PointCloud readPointCloudPly(const std::filesystem::path& path) {
  const std::vector<std::uint8_t> bytes = readFile(path, kMaxPlyBytes);
  const PlyVertices ply(bytes, path.string(), "point");
  std::vector<int> columns = {ply.require("x"), ply.require("y"), ply.require("z")};
  float scale = 1.0f;
  const bool colored = ply.find("red") >= 0 && ply.find("green") >= 0 && ply.find("blue") >= 0;
  if (colored) {
    for (const char* name : {"red", "green", "blue"}) columns.push_back(ply.find(name));
    const PlyType type = ply.properties()[static_cast<std::size_t>(columns[3])].type;
    if (type == PlyType::uint8)
      scale = 1.0f / 255.0f;
    else if (type == PlyType::uint16)
      scale = 1.0f / 65535.0f;
    else if (type != PlyType::float32 && type != PlyType::float64)
      ply.fail("unsupported type of property red (expected uchar, ushort or float)");
  }
  PointCloud cloud;
  cloud.position.resize(ply.size());
  cloud.color.assign(ply.size(), glm::vec3(0.5f));
  ply.read(columns, [&](std::size_t i, std::span<const float> v) {
    cloud.position[i] = {v[0], v[1], v[2]};
    if (colored) cloud.color[i] = glm::clamp(glm::vec3(v[3], v[4], v[5]) * scale, 0.0f, 1.0f);
  });
  return cloud;
}

}  // namespace tg
