// SPDX-License-Identifier: Apache-2.0
// Model to device: the layouts of shaders/project.comp and shaders/blend.comp.
#include "render/gpu/model_buffers.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/gtc/packing.hpp>
#include <optional>
#include <vector>

#include "core/model/texture_dictionary.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "shared/layout.h"
#include "shared/texels.h"

namespace tg {
namespace {

constexpr float kLargestHalf = 65504.0f;

// fill(i) is element i of a buffer of `count` elements.
template <typename T, typename Fill>
BufferPtr uploadArray(GpuDevice& device, const char* name, std::size_t count, Fill fill) {
  BufferPtr buffer = device.makeBuffer(name, count * sizeof(T));
  device.upload(buffer, count * sizeof(T), sizeof(T), [&](std::uint64_t first, std::span<std::byte> out) {
    for (std::size_t i = 0; i < out.size() / sizeof(T); ++i) {
      const T element = fill(static_cast<std::size_t>(first / sizeof(T)) + i);
      std::memcpy(out.data() + i * sizeof(T), &element, sizeof(T));
    }
  });
  return buffer;
}

std::uint32_t shRows(int degree) { return degree <= 1 ? 1 : degree == 2 ? 3 : 4; }

glm::vec4 shElement(const GaussianModel& model, std::size_t element) {
  const std::size_t row_elements = shRows(model.sh_degree) * 3;
  const std::size_t gaussian = element / row_elements;
  const std::size_t row = element % row_elements / 3;
  const auto channel = static_cast<glm::length_t>(element % 3);
  const std::size_t count = model.shCount();
  glm::vec4 value(0.0f);
  for (glm::length_t k = 0; k < 4; ++k) {
    const std::size_t coefficient = row * 4 + static_cast<std::size_t>(k);
    if (coefficient < count) value[k] = model.sh[gaussian * count + coefficient][channel];
  }
  return value;
}

std::uint32_t cellsAlong(std::uint32_t texels) { return std::max(texels, 2u) - 1; }

std::uint64_t cellCount(const TextureRect& rect) {
  return rect.texelCount() == 0 ? 0 : std::uint64_t{cellsAlong(rect.width)} * cellsAlong(rect.height);
}

struct CellPlan {
  std::vector<std::uint32_t> place;  // [N] the first cell of every Gaussian's texture; 0: it has none
  std::vector<std::uint32_t> rects;  // those that have cells of their own, in the cells' order
  std::uint64_t cells = 1;           // may be more than places can name
};

// shared: rectangles of the same offset have the same cells.
CellPlan planCells(const TextureAtlas& atlas, bool shared) {
  CellPlan plan;
  std::vector<std::uint32_t> known(shared ? atlas.texels.size() : 0);  // places, by offset
  for (std::uint32_t i = 0; i < atlas.rects.size(); ++i) {
    const TextureRect& rect = atlas.rects[i];
    std::uint32_t place = 0;
    if (rect.texelCount() > 0) {
      if (shared) place = known[rect.offset];
      if (place == 0) {
        place = static_cast<std::uint32_t>(plan.cells);
        plan.rects.push_back(i);
        plan.cells += cellCount(rect);
        if (shared) known[rect.offset] = place;
      }
    }
    plan.place.push_back(place);
  }
  return plan;
}

// Writes the cells of textures in the plan's order, one at a time.
class CellWriter {
 public:
  CellWriter(const TextureAtlas& atlas, const CellPlan& plan, ModelPrecision precision)
      : atlas_(atlas), plan_(plan), precision_(precision) {}

  // Of a Gaussian with a texture: 2^(exponent + kTexelExponentMin) holds its colours.
  std::uint32_t exponent(const TextureRect& rect) const {
    float largest = 0.0f;
    for (std::uint32_t i = 0; i < rect.texelCount(); ++i) {
      const glm::vec3 color = glm::abs(glm::vec3(atlas_.texels[rect.offset + i]));
      largest = std::max({largest, color.x, color.y, color.z});
    }
    int exponent = 0;
    if (std::frexp(std::min(largest, kLargestHalf), &exponent) == 0.5f) --exponent;  // a power of two holds itself
    return static_cast<std::uint32_t>(std::clamp(exponent, kTexelExponentMin, kTexelExponentMax) - kTexelExponentMin);
  }

  // Cells are asked for from 0 on.
  glm::uvec4 element(std::size_t index) {
    const std::size_t cell = precision_ == ModelPrecision::exact ? index / 2 : index;
    while (cell >= first_ + cells_) nextTexture();
    std::array<glm::vec4, 4> corners;
    corners.fill(glm::vec4(0.0f, 0.0f, 0.0f, 1.0f));
    if (cell > 0) {
      const auto in_texture = static_cast<std::uint32_t>(cell - first_);
      const std::uint32_t x = in_texture % cellsAlong(rect_.width);
      const std::uint32_t y = in_texture / cellsAlong(rect_.width);
      for (std::uint32_t k = 0; k < 4; ++k) {
        const std::uint32_t column = std::min<std::uint32_t>(x + k % 2, rect_.width - 1u);
        const std::uint32_t row = std::min<std::uint32_t>(y + k / 2, rect_.height - 1u);
        corners[k] = glm::clamp(atlas_.texels[rect_.offset + row * rect_.width + column], -kLargestHalf, kLargestHalf);
      }
    }
    if (precision_ == ModelPrecision::compact) {
      return {bytes(corners[0]), bytes(corners[1]), bytes(corners[2]), bytes(corners[3])};
    }
    const std::size_t first = index % 2 * 2;
    const auto left = glm::unpackUint2x32(glm::packHalf4x16(corners[first]));
    const auto right = glm::unpackUint2x32(glm::packHalf4x16(corners[first + 1]));
    return {left.x, left.y, right.x, right.y};
  }

 private:
  void nextTexture() {
    first_ += cells_;
    rect_ = atlas_.rects[plan_.rects[next_++]];
    cells_ = cellCount(rect_);
    unit_ = std::ldexp(1.0f, static_cast<int>(exponent(rect_)) + kTexelExponentMin) / 127.0f;
  }

  std::uint32_t bytes(const glm::vec4& texel) const {
    const auto color = [&](float value) {
      return static_cast<std::uint32_t>(128.0f + std::round(std::min(std::max(-127.0f, value / unit_), 127.0f)));
    };
    const auto loss = static_cast<std::uint32_t>(std::round(255.0f * (1.0f - std::min(std::max(0.0f, texel.w), 1.0f))));
    return color(texel.x) | color(texel.y) << 8 | color(texel.z) << 16 | loss << 24;
  }

  const TextureAtlas& atlas_;
  const CellPlan& plan_;
  ModelPrecision precision_;
  std::size_t next_ = 0;   // of the plan's rectangles, after that of the texture
  std::size_t first_ = 0;  // cell of the texture; cell 0 belongs to none
  std::size_t cells_ = 1;
  TextureRect rect_{};
  float unit_ = 1.0f;
};

}  // namespace

ModelBuffers uploadModel(GpuDevice& device, const GaussianModel& model, ModelPrecision precision) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  const GpuLimits limits = device.limits();
  const std::size_t count = model.size();
  // A Gaussian has 8 bytes in storage buffers that are bound whole, and 8 to 12 elements in texel buffers.
  const std::uint32_t elements = std::max(kRecordSize, shRows(model.sh_degree) * 3);
  const std::size_t most = std::min(limits.storage_bytes / 8, limits.texel_elements / elements);
  if (count > most) {
    throw Error(
        ErrorKind::device, limits.device,
        "the model has " + std::to_string(count) + " Gaussians, the device binds at most " + std::to_string(most));
  }
  const std::optional<TextureAtlas> once = heldOnce(model.atlas);
  const TextureAtlas& atlas = once ? *once : model.atlas;
  const std::vector<TextureRect>& rects = atlas.rects;
  const CellPlan plan = planCells(atlas, once.has_value());
  const std::uint32_t cell_size = precision == ModelPrecision::exact ? 2 : 1;
  const std::uint64_t cells = plan.cells;
  const std::uint64_t most_cells = std::min(limits.texel_elements / cell_size, 1u << kCellBits);
  if (cells > most_cells) {
    throw Error(ErrorKind::device, limits.device,
                "the model's textures have " + std::to_string(cells) +
                    " cells between texels, the device binds at most " + std::to_string(most_cells));
  }
  ModelBuffers buffers;
  buffers.gaussian_count = static_cast<std::uint32_t>(count);
  buffers.sh_degree = static_cast<std::uint32_t>(model.sh_degree);
  buffers.texture_mode = model.texture_mode;
  buffers.intersection = model.intersection;
  buffers.outside = model.outside;
  buffers.textured = cells > 1;
  buffers.precision = precision;
  buffers.mean_logit = uploadArray<glm::vec4>(
      device, "means", count, [&](std::size_t i) { return glm::vec4(model.mean[i], model.opacity_logit[i]); });
  buffers.rotation =
      uploadArray<glm::vec4>(device, "rotations", count, [&](std::size_t i) { return model.rotation[i]; });
  CellWriter writer(atlas, plan, precision);
  buffers.scale_offset = uploadArray<glm::vec4>(device, "scales", count, [&](std::size_t i) {
    std::uint32_t place = rects.empty() ? 0 : plan.place[i];
    if (place > 0 && precision == ModelPrecision::compact) place |= writer.exponent(rects[i]) << kCellBits;
    return glm::vec4(model.log_scale[i], std::bit_cast<float>(place));
  });
  buffers.texture_size = uploadArray<std::uint32_t>(device, "texture sizes", count, [&](std::size_t i) {
    const bool textured = !rects.empty() && rects[i].texelCount() > 0;
    return textured ? rects[i].width | std::uint32_t{rects[i].height} << 16 : 0u;
  });
  const std::size_t sh_elements = count * shRows(model.sh_degree) * 3;
  if (precision == ModelPrecision::compact) {
    buffers.sh = uploadArray<std::uint64_t>(device, "spherical harmonics", sh_elements, [&](std::size_t i) {
      return glm::packHalf4x16(glm::clamp(shElement(model, i), -kLargestHalf, kLargestHalf));
    });
  } else {
    buffers.sh = uploadArray<glm::vec4>(device, "spherical harmonics", sh_elements,
                                        [&](std::size_t i) { return shElement(model, i); });
  }
  buffers.texels =
      uploadArray<glm::uvec4>(device, "texels", cells * cell_size, [&](std::size_t i) { return writer.element(i); });
  const std::vector<glm::vec4> means = buffers.textured ? textureMeans(atlas, count) : std::vector<glm::vec4>{};
  buffers.texture_means =
      uploadArray<glm::vec4>(device, "texture means", means.size(), [&](std::size_t i) { return means[i]; });
  return buffers;
}

}  // namespace tg
