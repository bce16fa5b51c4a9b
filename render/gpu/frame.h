// SPDX-License-Identifier: Apache-2.0
// The frame: its buffers, by what their size follows from, and its list of passes (docs/frame.md).
#pragma once
#include <optional>

#include "render/gpu/model_buffers.h"
#include "render/gpu/passes.h"
#include "shared/limits.h"

namespace tg {

// Sizes follow from the number of Gaussians N.
struct SplatBuffers {
  SplatBuffers(GpuDevice& device, std::uint32_t gaussian_count);
  BufferPtr records;          // [N] SplatRecord (shaders/shared/layout.h)
  BufferPtr pixel_rects;      // [N] uvec2: x0 | y0 << 16, x1 | y1 << 16 [px], ends inclusive
  BufferPtr tile_counts;      // [N] uint: tiles of the rectangle; 0: culled
  BufferPtr visible_offsets;  // [N] uint: visible splats before this one
  PingPong depth_keys;        // [N] uint: bits of the depth, visible splats only
  PingPong depth_splats;      // [N] uint: their numbers
  BufferPtr pair_offsets;     // [N] uint: first pair of each visible splat, in depth order
};

// Sizes follow from the number of (tile, splat) pairs that there is room for.
struct PairBuffers {
  PairBuffers(GpuDevice& device, std::uint32_t room);
  std::uint32_t capacity;
  PingPong keys;    // [capacity] uint: tile number << kBlockBits | blocks
  PingPong splats;  // [capacity] uint: splat number
};

// Sizes follow from the image.
struct ImageBuffers {
  ImageBuffers(GpuDevice& device, std::uint32_t w, std::uint32_t h);
  std::uint32_t width;
  std::uint32_t height;
  BufferPtr tile_ranges;         // [tiles] uvec2: begin, end in PairBuffers
  BufferPtr base_transmittance;  // [pixels] vec4: base colour with background, transmittance
  BufferPtr texture_depth;       // [pixels] vec4: texture colour, depth
  BufferPtr normal_count;        // [pixels] vec4: normal, count
  BufferPtr extras;              // [pixels] vec4: median depth, overdraw, texel density
  ImagePtr picture;              // RGBA8: one output as a picture

  std::uint32_t tilesX() const { return (width + kTileSize - 1) / kTileSize; }
  std::uint32_t tilesY() const { return (height + kTileSize - 1) / kTileSize; }
};

// SplatOrder::perPixel: hits that a pixel keeps back to sort them (docs/frame.md).
constexpr std::uint32_t kKeptPerPixel = 16;

// What is compiled into the passes of a frame.
struct FrameVariant {
  std::uint32_t shape = kShapeSplats;
  bool all = true;        // all that blending yields; otherwise final and alpha
  bool overdraw = false;  // of these, too
  std::uint32_t sample = kSampleNone;
  std::uint32_t outside = kOutsideBase;  // of what is sampled
  bool per_pixel = false;                // SplatOrder::perPixel
  std::optional<Output> shown;           // write the picture; none: outputs are left in the image's buffers
  bool operator==(const FrameVariant&) const = default;
};
// The least that yields `outputs` or, alone, `shown`.
FrameVariant variantFor(OutputSet outputs);
FrameVariant variantFor(Output shown);

// How the passes are cut, by kind of device. Pictures do not depend on it.
struct PassTuning {
  bool runs = false;             // sorts walk runs of items, one per thread, instead of groups working together
  bool bounded_loops = false;    // a thread's loops must not exceed 65535 rounds in all
  // [px] of the square that a thread of blend draws: 1, 2 or 4. Which is fastest: docs/lab/gpu-frame.md.
  std::uint32_t blend_side = 4;
};

struct FrameInputs {
  const PassTuning& tuning;
  const GpuLimits& limits;
  const ModelBuffers& model;
  const SplatBuffers& splats;
  const PairBuffers& pairs;
  const ImageBuffers& image;
  const Scratch& scratch;
  const FrameVariant& variant;
  std::uint32_t blend_rounds = 1;
};

// The whole frame, with `counters` as its counters.
PassList buildFrame(const FrameInputs& inputs, const BufferPtr& counters);

// List entries of a tile that one dispatch of blend takes; longer lists need FrameInputs::blend_rounds dispatches.
std::uint32_t listEntriesPerRound(const PassTuning& tuning);

// How many rows of pixels a frame of an image of that size can have at once. Throws Error(device) when a side is longer
// than the device's images.
std::uint32_t rowsAtOnce(const GpuLimits& limits, std::uint32_t width, std::uint32_t height);

// As many pairs as the device can bind, and as the loops of the passes can walk over.
std::uint32_t maxPairCapacity(const GpuLimits& limits, const PassTuning& tuning);

}  // namespace tg
