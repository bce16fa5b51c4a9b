// SPDX-License-Identifier: Apache-2.0
// A model on the device.
#pragma once
#include "core/model.h"
#include "render/vulkan/buffer.h"

namespace tg {

struct ModelBuffers {
  std::uint32_t gaussian_count = 0;
  std::uint32_t sh_degree = 0;
  TextureMode texture_mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  bool textured = false;  // some Gaussian has texels
  Buffer mean_logit;      // [N] vec4: mean, opacity logit
  Buffer rotation;        // [N] vec4: w, x, y, z
  Buffer scale_offset;    // [N] vec4: ln(sigma), texel offset (bits of a uint)
  Buffer texture_size;    // [N] uint: width | height << 16
  Buffer sh;              // [N, rows, 3] vec4: per row of 4 coefficients red, green, blue; rest 0
  // [texels] 4 halfs: r, g, b, alpha. Exactly as bundles store them: half the memory and half the traffic of floats.
  Buffer texels;
  Buffer texture_means;  // [N] vec4: of the texture under its Gaussian; empty when not `textured`
};

// Throws Error(device) when the model exceeds what the device can bind.
ModelBuffers uploadModel(const VulkanDevice& device, Commands& commands, const GaussianModel& model);

}  // namespace tg
