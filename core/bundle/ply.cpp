// SPDX-License-Identifier: Apache-2.0
// Splat PLY in INRIA's layout, and point clouds.
#include "core/bundle/ply.h"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "core/bundle/ply_vertices.h"
#include "core/bundle/read_progress.h"
#include "core/bundle/splat_rows.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

// All rows, in blocks on all cores: take(first, count, scratch) fills Gaussians of the model. Whether all of them keep
// the promises of a model.
template <typename Take>
bool takeAll(std::size_t rows, const Take& take) {
  std::atomic<bool> good{true};
  std::vector<std::vector<std::uint8_t>> scratch(static_cast<std::size_t>(threadCount()));
  parallelForWorkers(static_cast<std::int64_t>((rows + kSplatBlockRows - 1) / kSplatBlockRows), 1, std::ssize(scratch),
                     [&](std::int64_t block, int worker) {
                       const std::size_t first = static_cast<std::size_t>(block) * kSplatBlockRows;
                       const std::size_t count = std::min(kSplatBlockRows, rows - first);
                       if (!take(first, count, scratch[static_cast<std::size_t>(worker)])) good = false;
                     });
  return good;
}

}  // namespace

GaussianModel parseSplatPly(std::span<const std::uint8_t> bytes, const std::string& path, bool* broken) {
  const SplatRows rows(bytes, bytes.size(), path);
  if (rows.plain()) {
    GaussianModel model;
    resizeGaussians(model, rows.size(), rows.shDegree());
    const bool good = takeAll(rows.size(), [&](std::size_t first, std::size_t count, std::vector<std::uint8_t>&) {
      return rows.convert(bytes.data() + rows.firstRow() + first * rows.stride(), first, first + count, model);
    });
    if (broken) *broken = !good;
    if (good || broken) return model;
  }
  return rows.convertAll(broken);
}

GaussianModel readSplatPly(const std::filesystem::path& path, ReadProgress* progress, bool* broken) {
  {
    const SplatPlyFile file(path);
    const SplatRows& rows = file.rows();
    if (progress) progress->total = file.bytes();
    if (rows.plain()) {
      GaussianModel model;
      resizeGaussians(model, rows.size(), rows.shDegree());
      const bool good =
          takeAll(rows.size(), [&](std::size_t first, std::size_t count, std::vector<std::uint8_t>& scratch) {
            if (progress) progress->advance(count * rows.stride());
            return file.read(first, count, first, model, scratch);
          });
      if (broken) *broken = !good;
      if (good || broken) return model;
    }
  }
  return parseSplatPly(readFile(path, kMaxPlyBytes), path.string(), broken);
}

std::vector<std::uint8_t> formatSplatPly(const GaussianModel& model) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  const std::string header = splatHeader(model.size(), model.sh_degree);
  const std::size_t stride = splatRowBytes(model.sh_degree);
  std::vector<std::uint8_t> bytes(header.size() + model.size() * stride);
  std::memcpy(bytes.data(), header.data(), header.size());
  takeAll(model.size(), [&](std::size_t first, std::size_t count, std::vector<std::uint8_t>&) {
    formatSplatRows(model, first, count, bytes.data() + header.size() + first * stride);
    return true;
  });
  return bytes;
}

void writeSplatPly(const std::filesystem::path& path, const GaussianModel& model) {
  checkModel(model, path.string());
  const std::string header = splatHeader(model.size(), model.sh_degree);
  const std::size_t stride = splatRowBytes(model.sh_degree);
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) {
    const FileWriter file(temporary, path);
    file.write(0, {reinterpret_cast<const std::uint8_t*>(header.data()), header.size()});
    takeAll(model.size(), [&](std::size_t first, std::size_t count, std::vector<std::uint8_t>& scratch) {
      scratch.resize(count * stride);
      formatSplatRows(model, first, count, scratch.data());
      file.write(header.size() + std::uint64_t{first} * stride, scratch);
      return true;
    });
  });
}

PointCloud readPointCloudPly(const std::filesystem::path& path, const glm::dvec3& origin) {
  const FileReader file(path, kMaxPlyBytes);
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), kMaxPlyHeaderBytes)));
  const std::size_t start = bytes.size();
  file.read(0, bytes);
  // Before the rest is read, of which what follows the points is left out where they are the last element.
  const std::uint64_t trailing = PlyVertices(bytes, file.size(), path.string(), "point").trailing();
  bytes.resize(static_cast<std::size_t>(file.size() - trailing));
  if (bytes.size() > start) file.read(start, std::span(bytes).subspan(start));
  const PlyVertices ply(bytes, path.string(), "point");
  std::vector<int> columns = {ply.require("x"), ply.require("y"), ply.require("z")};
  float white = 1.0f;
  const bool colored = ply.find("red") >= 0 && ply.find("green") >= 0 && ply.find("blue") >= 0;
  if (colored) {
    for (const char* name : {"red", "green", "blue"}) columns.push_back(ply.find(name));
    const PlyType type = ply.properties()[static_cast<std::size_t>(columns[3])].type;
    if (type == PlyType::uint8) {
      white = 255.0f;
    } else if (type == PlyType::uint16) {
      white = 65535.0f;
    } else if (type != PlyType::float32 && type != PlyType::float64) {
      ply.fail("unsupported type of property red (expected uchar, ushort or float)");
    }
  }
  std::vector<double> offsets(columns.size(), 0.0);
  for (int axis = 0; axis < 3; ++axis) offsets[static_cast<std::size_t>(axis)] = origin[axis];
  PointCloud cloud;
  cloud.position.resize(ply.size());
  cloud.color.assign(ply.size(), glm::vec3(0.5f));
  const auto take = [&](std::size_t i, std::span<const float> v) {
    cloud.position[i] = {v[0], v[1], v[2]};
    if (colored) cloud.color[i] = glm::clamp(glm::vec3(v[3], v[4], v[5]) / white, 0.0f, 1.0f);
  };
  ply.read(columns, take, true, offsets);
  return cloud;
}

}  // namespace tg
