// SPDX-License-Identifier: Apache-2.0
// A model on the device.
#pragma once
#include <array>

#include "core/model.h"
#include "render/vulkan/buffer.h"

namespace tg {

// Texels are four halfs, exactly as bundles store them: half the memory and half the traffic of floats.
inline constexpr VkDeviceSize kTexelBytes = 8;
inline constexpr std::uint32_t kTexelBuffers = 4;     // bindings of shaders/blend.comp
inline constexpr std::uint32_t kOneTexelBuffer = 31;  // texel_shift when all texels are in the first buffer

struct ModelBuffers {
  std::uint32_t gaussian_count = 0;
  std::uint32_t sh_degree = 0;
  TextureMode texture_mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  std::uint32_t sh_bytes = 0;                // of one Gaussian
  std::uint32_t chunk = 0;                   // Gaussians that fit into a binding; a multiple of the group size
  std::uint32_t texel_shift = 31;            // log2(texels per buffer)
  Buffer mean_logit;                         // [N] vec4: mean, opacity logit
  Buffer rotation;                           // [N] vec4: w, x, y, z
  Buffer scale_offset;                       // [N] vec4: ln(sigma), texel offset (bits of a uint)
  Buffer texture_size;                       // [N] uint: width | height << 16
  Buffer sh;                                 // [N, rows, 3] vec4: per row of 4 coefficients red, green, blue; rest 0
  std::array<Buffer, kTexelBuffers> texels;  // [texels] 4 halfs: r, g, b, alpha
};

// Throws Error(device) when the model exceeds what the device can bind.
ModelBuffers uploadModel(const VulkanDevice& device, Commands& commands, const GaussianModel& model);

}  // namespace tg
