// SPDX-License-Identifier: Apache-2.0
// A model on the device.
#pragma once
#include "core/model/model.h"
#include "render/gpu/device.h"

namespace tg {

// exact: floats, and texels as halfs, as bundles store them. compact: spherical harmonics as halfs and texels of 8
// bits, the colours of a texture being multiples of 2^k / 127 with the least k that holds them all, alpha those of 1 /
// 255.
enum class ModelPrecision { exact, compact };

struct ModelBuffers {
  ModelPrecision precision = ModelPrecision::exact;
  std::uint32_t gaussian_count = 0;
  std::uint32_t sh_degree = 0;
  TextureMode texture_mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  TextureOutside outside = TextureOutside::base;
  bool textured = false;   // some Gaussian has texels
  BufferPtr mean_logit;    // [N] vec4: mean, opacity logit
  BufferPtr rotation;      // [N] vec4: w, x, y, z
  BufferPtr scale_offset;  // [N] vec4: ln(sigma), first cell of the texture; compact: its place (bits)
  BufferPtr texture_size;  // [N] uint: width | height << 16
  BufferPtr sh;            // [N, rows, 3] vec4 or 4 halfs: per row of 4 coefficients red, green, blue; rest 0
  // Cells: the four texels that a bilinear sample needs, row by row, so that a pixel reads them at once. A texture of
  // w x h texels has max(w - 1, 1) x max(h - 1, 1) of them. Cell 0 leaves a splat as it is without a texture.
  // exact: 2 x uvec4, a texel is r, g, b, alpha. compact: uvec4, a texel is r + 128, g + 128, b + 128, 255 (1 - alpha).
  BufferPtr texels;
  BufferPtr texture_means;  // [N] vec4: of the texture under its Gaussian; empty when not `textured`
};

// Throws Error(device) when the model exceeds what the device can bind.
ModelBuffers uploadModel(GpuDevice& device, const GaussianModel& model, ModelPrecision precision);

}  // namespace tg
