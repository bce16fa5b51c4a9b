// SPDX-License-Identifier: Apache-2.0
// Splat PLY in INRIA's layout, and point clouds.
#include "core/ply.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/ply_vertices.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxPlyBytes = kMaxGaussians * 62 * 8;
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

}  // namespace

GaussianModel parseSplatPly(std::span<const std::uint8_t> bytes, const std::string& path) {
  const PlyVertices ply(bytes, path, "Gaussian");
  requireSplats(ply);
  GaussianModel model;
  model.sh_degree = shDegree(ply);
  const std::size_t n = ply.size();
  const std::size_t sh_count = static_cast<std::size_t>(model.shCount());

  std::vector<int> columns;
  const auto add = [&](const std::string& name) { columns.push_back(ply.require(name)); };
  for (const char* name : {"x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3", "opacity", "scale_0", "scale_1"})
    add(name);
  const bool flat = ply.find("scale_2") < 0;
  if (!flat) add("scale_2");
  const std::size_t dc = columns.size();
  for (int c = 0; c < 3; ++c) add("f_dc_" + std::to_string(c));
  const std::size_t rest = columns.size();
  for (std::size_t k = 0; k < 3 * (sh_count - 1); ++k) add("f_rest_" + std::to_string(k));

  model.mean.resize(n);
  model.rotation.resize(n);
  model.log_scale.resize(n);
  model.opacity_logit.resize(n);
  model.sh.resize(n * sh_count);
  ply.read(columns, [&](std::size_t i, std::span<const float> v) {
    model.mean[i] = {v[0], v[1], v[2]};
    model.rotation[i] = {v[3], v[4], v[5], v[6]};
    model.opacity_logit[i] = v[7];
    model.log_scale[i] = {v[8], v[9], flat ? std::min(v[8], v[9]) + kFlatLogScale : v[10]};
    glm::vec3* sh = model.sh.data() + i * sh_count;
    sh[0] = {v[dc], v[dc + 1], v[dc + 2]};
    // Channel-major in the file: all of red, all of green, all of blue.
    for (std::size_t k = 1; k < sh_count; ++k)
      for (std::size_t c = 0; c < 3; ++c) sh[k][static_cast<int>(c)] = v[rest + c * (sh_count - 1) + k - 1];
  });
  checkModel(model, path);
  return model;
}

GaussianModel readSplatPly(const std::filesystem::path& path) {
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
