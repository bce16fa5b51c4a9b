// SPDX-License-Identifier: Apache-2.0
// The frame: its buffers, by what their size follows from, and its list of passes (docs/frame.md).
#pragma once
#include <optional>

#include "render/vulkan/model_buffers.h"
#include "render/vulkan/passes.h"
#include "shared/limits.h"

namespace tg {

// Sizes follow from the number of Gaussians N.
struct SplatBuffers {
  SplatBuffers(const VulkanDevice& device, std::uint32_t gaussian_count);
  Buffer records;          // [N] SplatRecord (shaders/shared/layout.h)
  Buffer pixel_rects;      // [N] uvec2: x0 | y0 << 16, x1 | y1 << 16 [px], ends inclusive
  Buffer tile_counts;      // [N] uint: tiles of the rectangle; 0: culled
  Buffer visible_offsets;  // [N] uint: visible splats before this one
  PingPong depth_keys;     // [N] uint: bits of the depth, visible splats only
  PingPong depth_splats;   // [N] uint: their numbers
  Buffer pair_offsets;     // [N] uint: first pair of each visible splat, in depth order
};

// Sizes follow from the number of (tile, splat) pairs that there is room for.
struct PairBuffers {
  PairBuffers(const VulkanDevice& device, std::uint32_t room);
  std::uint32_t capacity;
  PingPong keys;    // [capacity] uint: tile number << kBlockBits | blocks
  PingPong splats;  // [capacity] uint: splat number
};

// Sizes follow from the image.
struct ImageBuffers {
  ImageBuffers(const VulkanDevice& device, std::uint32_t w, std::uint32_t h);
  std::uint32_t width;
  std::uint32_t height;
  Buffer tile_ranges;         // [tiles] uvec2: begin, end in PairBuffers
  Buffer base_transmittance;  // [pixels] vec4: base colour with background, transmittance
  Buffer texture_depth;       // [pixels] vec4: texture colour, depth
  Buffer normal_count;        // [pixels] vec4: normal, count
  Buffer extras;              // [pixels] vec4: median depth, overdraw, texel density
  StorageImage picture;       // RGBA8: one output as a picture

  std::uint32_t tilesX() const { return (width + kTileSize - 1) / kTileSize; }
  std::uint32_t tilesY() const { return (height + kTileSize - 1) / kTileSize; }
};

// What is compiled into the passes of a frame.
struct FrameVariant {
  std::uint32_t shape = kShapeSplats;
  bool all = true;        // all that blending yields; otherwise final and alpha
  bool overdraw = false;  // of these, too
  std::uint32_t sample = kSampleNone;
  bool per_pixel = false;       // SplatOrder::perPixel
  std::optional<Output> shown;  // write the picture; none: outputs are left in the image's buffers
  bool operator==(const FrameVariant&) const = default;
};
// The least that yields `outputs` or, alone, `shown`.
FrameVariant variantFor(OutputSet outputs);
FrameVariant variantFor(Output shown);

struct FrameInputs {
  const VulkanTuning& tuning;
  const VulkanDevice& device;
  const ModelBuffers& model;
  const SplatBuffers& splats;
  const PairBuffers& pairs;
  const ImageBuffers& image;
  const Scratch& scratch;
  const FrameVariant& variant;
  std::uint32_t blend_rounds = 1;
};

void buildFrame(PassList& list, const FrameInputs& inputs);

// What Counters holds and the ranges are cleared to before the first pass.
void recordFrameStart(VkCommandBuffer commands, const FrameInputs& inputs, const Buffer& counters);

// List entries of a tile that one dispatch of blend takes; longer lists need FrameInputs::blend_rounds dispatches.
std::uint32_t listEntriesPerRound(const VulkanTuning& tuning);

// As many pairs as the device can bind.
std::uint32_t maxPairCapacity(const VulkanDevice& device);

}  // namespace tg
