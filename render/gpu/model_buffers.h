// SPDX-License-Identifier: Apache-2.0
// A model on the device.
#pragma once
#include "core/model.h"
#include "render/gpu/device.h"

namespace tg {

struct ModelBuffers {
  std::uint32_t gaussian_count = 0;
  std::uint32_t sh_degree = 0;
  TextureMode texture_mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  bool textured = false;   // some Gaussian has texels
  BufferPtr mean_logit;    // [N] vec4: mean, opacity logit
  BufferPtr rotation;      // [N] vec4: w, x, y, z
  BufferPtr scale_offset;  // [N] vec4: ln(sigma), texel offset (bits of a uint)
  BufferPtr texture_size;  // [N] uint: width | height << 16
  BufferPtr sh;            // [N, rows, 3] vec4: per row of 4 coefficients red, green, blue; rest 0
  // [texels] 4 halfs: r, g, b, alpha. Exactly as bundles store them: half the memory and half the traffic of floats.
  BufferPtr texels;
  BufferPtr texture_means;  // [N] vec4: of the texture under its Gaussian; empty when not `textured`
};

// Throws Error(device) when the model exceeds what the device can bind.
ModelBuffers uploadModel(GpuDevice& device, const GaussianModel& model);

}  // namespace tg
