// SPDX-License-Identifier: Apache-2.0
// Reads compressed splat PLY.
#include "converter/formats/read_compressed_ply.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

#include "converter/formats/repair.h"
#include "core/bundle/ply.h"
#include "core/bundle/ply_vertices.h"
#include "core/bundle/splat_rows.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxCompressedPlyBytes =
    kMaxGaussians * (4 * 4 + 45 + 1);  // a splat, its SH, its part of a chunk

// What the splats of a chunk are interpolated between, rounded once: far from the origin a float's step shows.
struct Bounds {
  glm::vec3 low{0.0f};
  glm::vec3 high{1.0f};
  glm::vec3 at(glm::dvec3 t) const { return glm::dvec3(low) * (1.0 - t) + glm::dvec3(high) * t; }
};
struct Chunk {
  Bounds position, log_scale, color;
};

double unorm(std::uint32_t value, int shift, int bits) {
  const std::uint32_t mask = (1u << bits) - 1;
  return (value >> shift & mask) / static_cast<double>(mask);
}

glm::dvec3 unpack111011(std::uint32_t value) {
  return {unorm(value, 21, 11), unorm(value, 11, 10), unorm(value, 0, 11)};
}

// The three smaller components in 10 bits each, the largest one's index in the top two; index 0 is w.
glm::vec4 unpackRotation(std::uint32_t value) {
  const int largest = static_cast<int>(value >> 30);
  glm::dvec4 q(0.0);
  double rest = 1.0;
  for (int k = 0, shift = 20; k < 4; ++k) {
    if (k == largest) continue;
    q[k] = (unorm(value, shift, 10) - 0.5) * std::sqrt(2.0);
    rest -= q[k] * q[k];
    shift -= 10;
  }
  q[largest] = std::sqrt(std::max(rest, 0.0));
  return q;
}

std::vector<Chunk> readChunks(const PlyVertices& chunks) {
  std::vector<int> columns;
  const auto add = [&](const std::string& group, std::string_view axes) {
    for (const char* side : {"min_", "max_"}) {
      for (const char axis : axes) columns.push_back(chunks.require(side + group + axis));
    }
  };
  add("", "xyz");
  add("scale_", "xyz");
  const bool colored = chunks.find("min_r") >= 0;
  if (colored) add("", "rgb");
  std::vector<Chunk> out(chunks.size());
  chunks.read(columns, [&](std::size_t i, std::span<const float> v) {
    const auto bounds = [&](std::size_t at) {
      return Bounds{{v[at], v[at + 1], v[at + 2]}, {v[at + 3], v[at + 4], v[at + 5]}};
    };
    out[i].position = bounds(0);
    out[i].log_scale = bounds(6);
    if (colored) out[i].color = bounds(12);
  });
  return out;
}

// Bytes 0 and 255 are the ends of the range, the others the middles of 256 steps.
float shFromByte(float byte) {
  const float t = byte <= 0.0f ? 0.0f : byte >= 255.0f ? 1.0f : (byte + 0.5f) / 256.0f;
  return (t - 0.5f) * kCompressedPlyShRange;
}

}  // namespace

GaussianModel parseCompressedPly(std::span<const std::uint8_t> bytes, const std::string& path,
                                 std::vector<std::string>* warnings) {
  const PlyVertices splats(bytes, path, "Gaussian");
  const PlyVertices chunks(bytes, path, "chunk", "chunk");
  const int position = splats.requireWord("packed_position"), rotation = splats.requireWord("packed_rotation");
  const int scale = splats.requireWord("packed_scale"), color = splats.requireWord("packed_color");
  const std::size_t n = splats.size();
  if (const std::size_t expected = (n + kCompressedPlyChunk - 1) / kCompressedPlyChunk; chunks.size() != expected) {
    splats.fail("wrong number of chunks (expected " + std::to_string(expected) + " for " + std::to_string(n) +
                " splats, found " + std::to_string(chunks.size()) + ")");
  }
  const std::vector<Chunk> bounds = readChunks(chunks);

  int sh_degree = 0;
  std::optional<PlyVertices> sh;
  if (splats.hasElement("sh")) {
    sh.emplace(bytes, path, "Gaussian", "sh");
    if (sh->size() != n) {
      sh->fail("wrong number of rows of \"sh\"" + expectedFound(n, sh->size()));
    }
    sh_degree = sh->shDegree(1);
  }
  if (warnings != nullptr) {
    if (const std::uint64_t trailing = sh ? sh->trailing() : splats.trailing(); trailing != 0)
      warnings->push_back(trailingWarning(trailing));
    if (splats.antialiased()) warnings->emplace_back(kAntialiasedWarning);
  }
  GaussianModel model;
  resizeGaussians(model, n, sh_degree);
  const std::size_t sh_count = model.shCount();
  for (std::size_t i = 0; i < n; ++i) {
    const Chunk& chunk = bounds[i / kCompressedPlyChunk];
    const std::uint32_t rgba = splats.word(i, color);
    const glm::dvec3 rgb(unorm(rgba, 24, 8), unorm(rgba, 16, 8), unorm(rgba, 8, 8));
    model.mean[i] = chunk.position.at(unpack111011(splats.word(i, position)));
    model.log_scale[i] = chunk.log_scale.at(unpack111011(splats.word(i, scale)));
    model.rotation[i] = unpackRotation(splats.word(i, rotation));
    model.opacity_logit[i] = logitFromOpacity((rgba & 0xff) / 255.0);
    model.sh[i * sh_count] = (chunk.color.at(rgb) - 0.5f) / kShC0;
  }
  if (sh) {
    const std::size_t rest = sh_count - 1;
    std::vector<int> columns;
    for (std::size_t k = 0; k < 3 * rest; ++k) {
      columns.push_back(sh->require("f_rest_" + std::to_string(k)));
      if (sh->properties()[static_cast<std::size_t>(columns.back())].type != PlyType::uint8) {
        sh->fail("property f_rest_" + std::to_string(k) + " is not stored as it must be (expected uchar)");
      }
    }
    sh->read(columns, [&](std::size_t i, std::span<const float> v) {  // channel-major, as in INRIA's layout
      for (std::size_t k = 0; k < rest; ++k) {
        for (std::size_t c = 0; c < 3; ++c) {
          model.sh[i * sh_count + 1 + k][static_cast<int>(c)] = shFromByte(v[c * rest + k]);
        }
      }
    });
  }
  checkModel(model, path);
  return model;
}

GaussianModel readCompressedPly(const std::filesystem::path& path, std::vector<std::string>* warnings) {
  return parseCompressedPly(readFile(path, kMaxCompressedPlyBytes), path.string(), warnings);
}

}  // namespace tg
