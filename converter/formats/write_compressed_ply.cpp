// SPDX-License-Identifier: Apache-2.0
// Writes compressed splat PLY.
#include "converter/formats/write_compressed_ply.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>
#include <string>
#include <utility>

#include "converter/formats/little_endian.h"
#include "converter/formats/read_compressed_ply.h"
#include "converter/formats/space_curve.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "shared/limits.h"

namespace tg {
namespace {

using Bytes = std::vector<std::uint8_t>;

// t in [0, 1], or the nearer end, in so many bits.
std::uint32_t toUnorm(double t, int bits) {
  const double last = (1u << bits) - 1;
  return static_cast<std::uint32_t>(std::clamp(std::floor(t * last + 0.5), 0.0, last));
}

// The least box around the vectors of a chunk, and their places in it.
class Box {
 public:
  explicit Box(std::span<const glm::vec3> vectors) : low_(vectors.front()), high_(low_) {
    for (const glm::vec3& v : vectors) {
      low_ = glm::min(low_, v);
      high_ = glm::max(high_, v);
    }
  }

  void append(Bytes& bytes) const {
    for (const glm::vec3& corner : {low_, high_}) {
      for (int k = 0; k < 3; ++k) appendU32(bytes, std::bit_cast<std::uint32_t>(corner[k]));
    }
  }
  std::uint32_t pack(glm::vec3 v, int x_bits, int y_bits, int z_bits) const {
    const glm::dvec3 range = glm::dvec3(high_) - glm::dvec3(low_);
    glm::dvec3 t(0.0);
    for (int k = 0; k < 3; ++k) {
      if (range[k] > 0.0) t[k] = (static_cast<double>(v[k]) - static_cast<double>(low_[k])) / range[k];
    }
    return toUnorm(t.x, x_bits) << (y_bits + z_bits) | toUnorm(t.y, y_bits) << z_bits | toUnorm(t.z, z_bits);
  }

 private:
  glm::vec3 low_, high_;
};

std::uint32_t rotationBits(glm::vec4 wxyz) {
  const glm::dvec4 q = glm::normalize(glm::dvec4(wxyz));
  int largest = 0;
  for (int k = 1; k < 4; ++k) {
    if (std::abs(q[k]) > std::abs(q[largest])) largest = k;
  }
  const double sign = q[largest] < 0.0 ? -1.0 : 1.0;
  std::uint32_t bits = static_cast<std::uint32_t>(largest);
  for (int k = 0; k < 4; ++k) {
    if (k != largest) bits = bits << 10 | toUnorm(sign * q[k] * std::sqrt(0.5) + 0.5, 10);
  }
  return bits;
}

std::uint8_t shStep(float coefficient, bool& clipped) {
  constexpr double range = kCompressedPlyShRange;
  const double value = coefficient;
  if (std::abs(value) > 0.5 * range) clipped = true;
  return static_cast<std::uint8_t>(std::clamp(std::floor((value / range + 0.5) * 256.0), 0.0, 255.0));
}

// In the order in which programs expect them that do not go by names.
std::string headerOf(std::size_t count, std::size_t rest) {
  std::string text = "ply\nformat binary_little_endian 1.0\nelement chunk " +
                     std::to_string((count + kCompressedPlyChunk - 1) / kCompressedPlyChunk) + "\n";
  using Group = std::pair<std::string, std::string>;
  for (const auto& [name, axes] : {Group{"", "xyz"}, Group{"scale_", "xyz"}, Group{"", "rgb"}}) {
    for (const std::string side : {"min_", "max_"}) {
      for (const char axis : axes) text += "property float " + side + name + axis + "\n";
    }
  }
  text += "element vertex " + std::to_string(count) + "\n";
  for (const std::string name : {"position", "rotation", "scale", "color"}) {
    text += "property uint packed_" + name + "\n";
  }
  if (rest > 0) text += "element sh " + std::to_string(count) + "\n";
  for (std::size_t k = 0; k < 3 * rest; ++k) text += "property uchar f_rest_" + std::to_string(k) + "\n";
  return text + "end_header\n";
}

}  // namespace

Bytes formatCompressedPly(const GaussianModel& model, CompressedPlyReport& report) {
  TG_ASSERT(lengthsAgree(model) && model.size() > 0, "a model with Gaussians, its arrays of their lengths");
  const std::size_t count = model.size(), row = model.shCount(), rest = row - 1;
  report.order = hilbertOrder(model.mean);
  const std::string text = headerOf(count, rest);
  Bytes bytes(text.begin(), text.end()), splats, sh;
  splats.reserve(16 * count);
  sh.reserve(3 * rest * count);
  for (std::size_t first = 0; first < count; first += kCompressedPlyChunk) {
    const std::size_t length = std::min(kCompressedPlyChunk, count - first);
    const std::span<const std::uint32_t> chunk = std::span(report.order).subspan(first, length);
    std::vector<glm::vec3> means, scales, colors;
    for (const std::uint32_t i : chunk) {
      means.push_back(model.mean[i]);
      scales.push_back(model.log_scale[i]);
      colors.push_back(0.5f + kShC0 * model.sh[i * row]);
    }
    const Box mean_box(means), scale_box(scales), color_box(colors);
    for (const Box& box : {mean_box, scale_box, color_box}) box.append(bytes);
    for (std::size_t j = 0; j < length; ++j) {
      const std::uint32_t i = chunk[j];
      appendU32(splats, mean_box.pack(means[j], 11, 10, 11));
      appendU32(splats, rotationBits(model.rotation[i]));
      appendU32(splats, scale_box.pack(scales[j], 11, 10, 11));
      appendU32(splats, color_box.pack(colors[j], 8, 8, 8) << 8 | toUnorm(sigmoid(model.opacity_logit[i], 1.0), 8));
      bool clipped = false;
      for (int c = 0; c < 3; ++c) {  // channel by channel, as in INRIA's layout
        for (std::size_t k = 1; k < row; ++k) sh.push_back(shStep(model.sh[i * row + k][c], clipped));
      }
      report.clipped_sh += clipped;
    }
  }
  bytes.insert(bytes.end(), splats.begin(), splats.end());
  bytes.insert(bytes.end(), sh.begin(), sh.end());
  return bytes;
}

CompressedPlyReport writeCompressedPly(const std::filesystem::path& path, const GaussianModel& model) {
  if (model.size() == 0) throw Error(ErrorKind::badData, path.string(), "the model has no Gaussians");
  CompressedPlyReport report;
  writeFileAtomically(path, formatCompressedPly(model, report));
  return report;
}

}  // namespace tg
