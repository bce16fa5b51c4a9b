// SPDX-License-Identifier: Apache-2.0
// Model to device: the layouts of shaders/project.comp and shaders/blend.comp.
#include "render/gpu/model_buffers.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <glm/gtc/packing.hpp>

#include "core/error.h"
#include "shared/layout.h"

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
  const auto count = static_cast<std::size_t>(model.shCount());
  glm::vec4 value(0.0f);
  for (glm::length_t k = 0; k < 4; ++k) {
    const std::size_t coefficient = row * 4 + static_cast<std::size_t>(k);
    if (coefficient < count) value[k] = model.sh[gaussian * count + coefficient][channel];
  }
  return value;
}

}  // namespace

ModelBuffers uploadModel(GpuDevice& device, const GaussianModel& model) {
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
  const std::vector<glm::vec4>& texels = model.atlas.texels;
  if (texels.size() > limits.texel_elements) {
    throw Error(ErrorKind::device, limits.device,
                "the model has " + std::to_string(texels.size()) + " texels, the device binds at most " +
                    std::to_string(limits.texel_elements));
  }
  ModelBuffers buffers;
  buffers.gaussian_count = static_cast<std::uint32_t>(count);
  buffers.sh_degree = static_cast<std::uint32_t>(model.sh_degree);
  buffers.texture_mode = model.texture_mode;
  buffers.intersection = model.intersection;
  buffers.textured = !model.atlas.rects.empty() && !texels.empty();

  const std::vector<TextureRect>& rects = model.atlas.rects;
  buffers.mean_logit = uploadArray<glm::vec4>(
      device, "means", count, [&](std::size_t i) { return glm::vec4(model.mean[i], model.opacity_logit[i]); });
  buffers.rotation =
      uploadArray<glm::vec4>(device, "rotations", count, [&](std::size_t i) { return model.rotation[i]; });
  buffers.scale_offset = uploadArray<glm::vec4>(device, "scales", count, [&](std::size_t i) {
    return glm::vec4(model.log_scale[i], std::bit_cast<float>(rects.empty() ? 0u : rects[i].offset));
  });
  buffers.texture_size = uploadArray<std::uint32_t>(device, "texture sizes", count, [&](std::size_t i) {
    const bool textured = !rects.empty() && rects[i].texelCount() > 0;
    return textured ? rects[i].width | std::uint32_t{rects[i].height} << 16 : 0u;
  });
  buffers.sh = uploadArray<glm::vec4>(device, "spherical harmonics", count * shRows(model.sh_degree) * 3,
                                      [&](std::size_t i) { return shElement(model, i); });
  buffers.texels = uploadArray<std::uint64_t>(device, "texels", texels.size(), [&](std::size_t i) {
    return glm::packHalf4x16(glm::clamp(texels[i], -kLargestHalf, kLargestHalf));
  });
  const std::vector<glm::vec4> means = buffers.textured ? textureMeans(model.atlas, count) : std::vector<glm::vec4>{};
  buffers.texture_means =
      uploadArray<glm::vec4>(device, "texture means", means.size(), [&](std::size_t i) { return means[i]; });
  return buffers;
}

}  // namespace tg
