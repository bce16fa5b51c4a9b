// SPDX-License-Identifier: Apache-2.0
// The frame as a list, top to bottom.
#include "render/gpu/frame.h"

#include <algorithm>
#include <bit>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "shared/layout.h"

namespace tg {
namespace {

// Mesa 22.3's llvmpipe ends all loops of a thread after so many rounds in total, without a word.
constexpr std::uint32_t kLoopRounds = 65535;
// Its threads run 4 to 16 in step. blend.comp takes two rounds per entry, and one per four entries for each of 16
// threads that go their own ways.
constexpr std::uint32_t kListEntriesOnCpu = 8192;
constexpr std::uint32_t kListEntries = 1u << 31;  // no limit
constexpr std::uint32_t kPresentSide = 16;        // shaders/present.comp
constexpr std::uint32_t kDepthBits = 32;

PingPong makePingPong(GpuDevice& device, const char* name, std::uint64_t bytes) {
  return {device.makeBuffer(name, bytes), device.makeBuffer(name, bytes)};
}

std::uint64_t mostPixels(const GpuLimits& limits) { return limits.storage_bytes / sizeof(glm::vec4); }

std::uint32_t checkedPixels(const GpuLimits& limits, std::uint32_t width, std::uint32_t height) {
  const std::uint64_t pixels = std::uint64_t{width} * height;
  const std::uint64_t most = mostPixels(limits);
  if (pixels > most || std::max(width, height) > limits.image_side) {
    throw Error(ErrorKind::device, limits.device,
                "an image of " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels is too large (expected at most " + std::to_string(most) + " pixels and " +
                    std::to_string(limits.image_side) + " to a side)");
  }
  const std::uint64_t tiles = std::uint64_t{width + kTileSize - 1} / kTileSize * ((height + kTileSize - 1) / kTileSize);
  if (tiles > kMaxTiles) {
    throw Error(ErrorKind::device, limits.device,
                "an image of " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels is too large (expected at most " + std::to_string(kMaxTiles) + " tiles, found " +
                    std::to_string(tiles) + ")");
  }
  return static_cast<std::uint32_t>(pixels);
}

void addProject(PassList& list, const FrameInputs& in) {
  const ModelBuffers& m = in.model;
  const SplatBuffers& s = in.splats;
  const std::uint32_t most = in.limits.storage_bytes / sizeof(SplatRecord);
  const std::uint32_t chunk = most / 2 * 2;  // 256 bytes: the largest alignment of an offset that a device may ask for
  for (std::uint32_t first = 0; first < m.gaussian_count; first += chunk) {
    const std::uint32_t count = std::min(chunk, m.gaussian_count - first);
    PassUniforms uniforms{};
    uniforms.first = first;
    uniforms.count = count;
    const glm::uvec4 groups = groupGrid((count + kGroupSize - 1) / kGroupSize);
    list.add("project", Shader::project,
             {{m.mean_logit, Texels::rgba32f},
              {m.rotation, Texels::rgba32f},
              {m.scale_offset, Texels::rgba32ui},
              {m.texture_size, Texels::r32ui},
              {m.sh, m.precision == ModelPrecision::compact ? Texels::rgba16f : Texels::rgba32f},
              {s.records, first * sizeof(SplatRecord), count * sizeof(SplatRecord)},
              s.pixel_rects,
              s.tile_counts},
             uniforms, Groups::fixed(groups.x, groups.y), {{in.variant.shape, m.precision == ModelPrecision::compact}});
  }
}

void addBlend(PassList& list, const FrameInputs& in, int by_tile) {
  const FrameVariant& variant = in.variant;
  const std::uint32_t side = variant.per_pixel ? 1
                             : variant.all     ? std::min(2u, in.tuning.blend_side)
                                               : in.tuning.blend_side;
  const std::uint32_t threads = kTileSize / side * (kTileSize / side);
  const std::uint32_t kept = variant.per_pixel ? kKeptPerPixel : 0;
  const bool solid = variant.shape != kShapeSplats;
  PassUniforms uniforms{};
  uniforms.count = listEntriesPerRound(in.tuning);
  for (std::uint32_t round = 0; round < in.blend_rounds; ++round, uniforms.first += uniforms.count) {
    const Groups tiles = Groups::fixed(in.image.tilesX(), in.image.tilesY());
    if (solid) {
      list.add("solid", Shader::solid,
               {{in.model.mean_logit, Texels::rgba32f},
                {in.model.rotation, Texels::rgba32f},
                {in.model.scale_offset, Texels::rgba32ui},
                {in.pairs.keys[by_tile], Texels::r32ui},
                {in.pairs.splats[by_tile], Texels::r32ui},
                {in.splats.records, Texels::rgba32ui},
                list.counters(),
                in.image.tile_ranges,
                in.image.base_transmittance},
               uniforms, tiles, {{variant.shape}});
      continue;
    }
    list.add("blend", Shader::blend,
             {{in.pairs.keys[by_tile], Texels::rgba32ui},
              {in.pairs.splats[by_tile], Texels::r32ui},
              {in.splats.records, Texels::rgba32ui},
              {in.model.texels, Texels::rgba32ui},
              {in.model.texture_means, Texels::rgba32f},
              list.counters(),
              in.image.tile_ranges,
              in.image.base_transmittance,
              in.image.texture_depth,
              in.image.normal_count,
              in.image.extras},
             uniforms, tiles,
             {{variant.all, threads, side, variant.sample, variant.overdraw, kept,
               in.model.precision == ModelPrecision::exact, variant.outside}});
  }
}

void addPresent(PassList& list, const FrameInputs& in) {
  const Output shown = *in.variant.shown;
  PassUniforms uniforms{};
  // final without base and texture lies where base lies otherwise.
  uniforms.output_kind = static_cast<std::uint32_t>(shown == Output::final ? Output::base : shown);
  if (kRangedOutputs.has(shown)) {
    const glm::uvec4 groups = groupGrid((in.image.width * in.image.height + kGroupSize - 1) / kGroupSize);
    list.add("output_range", Shader::outputRange,
             {list.counters(), in.image.texture_depth, in.image.normal_count, in.image.extras}, uniforms,
             Groups::fixed(groups.x, groups.y));
  }
  list.add(
      "present", Shader::present,
      {list.counters(), in.image.base_transmittance, in.image.texture_depth, in.image.normal_count, in.image.extras},
      uniforms,
      Groups::fixed((in.image.width + kPresentSide - 1) / kPresentSide,
                    (in.image.height + kPresentSide - 1) / kPresentSide),
      {{}, in.image.picture.get()});
}

}  // namespace

FrameVariant variantFor(OutputSet outputs) {
  FrameVariant variant;
  variant.all = outputs.hasAny(kHitOutputs.without(kPictureOutputs));
  variant.overdraw = outputs.has(Output::overdraw);
  return variant;
}

FrameVariant variantFor(Output shown) {
  FrameVariant variant = variantFor(OutputSet{shown});
  static_assert(kSolidOutputs == OutputSet{Output::ellipsoids, Output::centers}, "each has its shape");
  if (shown == Output::ellipsoids) variant.shape = kShapeEllipsoids;
  if (shown == Output::centers) variant.shape = kShapeCenters;
  variant.shown = shown;
  return variant;
}

SplatBuffers::SplatBuffers(GpuDevice& device, std::uint32_t gaussian_count)
    : records(device.makeBuffer("splat records", std::uint64_t{gaussian_count} * sizeof(SplatRecord))),
      pixel_rects(device.makeBuffer("screen boxes", std::uint64_t{gaussian_count} * 8)),
      tile_counts(device.makeBuffer("tile counts", std::uint64_t{gaussian_count} * 4)),
      visible_offsets(device.makeBuffer("visible offsets", std::uint64_t{gaussian_count} * 4)),
      depth_keys(makePingPong(device, "depth keys", std::uint64_t{gaussian_count} * 4)),
      depth_splats(makePingPong(device, "depth order", std::uint64_t{gaussian_count} * 4)),
      pair_offsets(device.makeBuffer("pair offsets", std::uint64_t{gaussian_count} * 4)) {}

PairBuffers::PairBuffers(GpuDevice& device, std::uint32_t room)
    : capacity(room),
      keys(makePingPong(device, "pair keys", std::uint64_t{room} * 4)),
      splats(makePingPong(device, "pair splats", std::uint64_t{room} * 4)) {}

ImageBuffers::ImageBuffers(GpuDevice& device, std::uint32_t w, std::uint32_t h) : width(w), height(h) {
  const std::uint64_t bytes = std::uint64_t{checkedPixels(device.limits(), w, h)} * sizeof(glm::vec4);
  tile_ranges = device.makeBuffer("tile ranges", std::uint64_t{tilesX()} * tilesY() * sizeof(glm::uvec2));
  base_transmittance = device.makeBuffer("base and transmittance", bytes);
  texture_depth = device.makeBuffer("texture and depth", bytes);
  normal_count = device.makeBuffer("normal and count", bytes);
  extras = device.makeBuffer("median depth, overdraw and texel density", bytes);
  picture = device.makeImage(w, h);
}

std::uint32_t rowsAtOnce(const GpuLimits& limits, std::uint32_t width, std::uint32_t height) {
  TG_ASSERT(width > 0 && height > 0, "a picture has pixels");
  if (std::max(width, height) > limits.image_side) checkedPixels(limits, width, height);  // says so
  const std::uint64_t rows_of_tiles = std::min(mostPixels(limits) / (std::uint64_t{width} * kTileSize),
                                               std::uint64_t{kMaxTiles} / ((width + kTileSize - 1) / kTileSize));
  const std::uint64_t rows = std::max<std::uint64_t>(rows_of_tiles, 1) * kTileSize;
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(rows, height));
}

std::uint32_t listEntriesPerRound(const PassTuning& tuning) {
  return tuning.bounded_loops ? kListEntriesOnCpu : kListEntries;
}

std::uint32_t maxPairCapacity(const GpuLimits& limits, const PassTuning& tuning) {
  constexpr std::uint32_t kPairsPerStep = 4;  // of a buffer's size
  const auto most = std::min<std::uint32_t>(limits.storage_bytes / sizeof(std::uint32_t), limits.texel_elements) /
                    kPairsPerStep * kPairsPerStep;
  if (!tuning.runs || !tuning.bounded_loops) return most;
  // A sort's thread walks over the digits and over its partition, whose size is a multiple of kPartitionStep.
  const std::uint32_t partition = (kLoopRounds - kDigitCount) / kPartitionStep * kPartitionStep;
  return std::min(most, kMaxPartitions * (partition - 1));
}

PassList buildFrame(const FrameInputs& in, const BufferPtr& counters) {
  TG_ASSERT(in.tuning.blend_side == 1 || in.tuning.blend_side == 2 || in.tuning.blend_side == 4,
            "a thread draws 1, 4 or 16 pixels");
  TG_ASSERT(in.blend_rounds >= 1, "blend runs once at least");
  const SplatBuffers& s = in.splats;
  const PairBuffers& p = in.pairs;

  Counters first{};
  first.work[kWorkGaussians] = makeWork(in.model.gaussian_count, in.model.gaussian_count);
  first.output_range = glm::uvec4(~0u, 0u, 0u, 0u);
  PassList list(counters, first);
  list.clear(in.image.tile_ranges);

  // Model and view to splats with their tile counts.
  addProject(list, in);

  // The visible ones side by side, then near to far. Equal depths stay in the model's order.
  addScan(list, "scan_visible", in.scratch,
          {ScanInput::nonZero, s.tile_counts, s.tile_counts, s.visible_offsets, kWorkGaussians, kWorkVisible,
           in.model.gaussian_count, in.tuning.runs});
  list.add("compact", Shader::compact,
           {{s.records, Texels::rgba32ui},
            list.counters(),
            s.tile_counts,
            s.visible_offsets,
            s.depth_keys[0],
            s.depth_splats[0]},
           {}, Groups::perItem(kWorkGaussians));
  const int near_to_far = addSort(list, "sort_depth", in.scratch,
                                  {s.depth_keys, s.depth_splats, kWorkVisible, 0, kDepthBits, in.tuning.runs});

  // A pair for each tile of each splat, in depth order; sorted by tile alone, they stay in depth order within a tile.
  addScan(list, "scan_pairs", in.scratch,
          {ScanInput::ordered, s.tile_counts, s.depth_splats[near_to_far], s.pair_offsets, kWorkVisible, kWorkPairs,
           p.capacity, in.tuning.runs});
  list.add("emit_keys", Shader::emitKeys,
           {{s.records, Texels::rgba32ui},
            list.counters(),
            s.depth_splats[near_to_far],
            s.pair_offsets,
            s.pixel_rects,
            p.keys[0],
            p.splats[0]},
           {}, in.tuning.runs ? Groups::perPartition(kWorkPairs) : Groups::perItem(kWorkPairs), {{in.tuning.runs}});
  const auto tile_bits = static_cast<std::uint32_t>(std::bit_width(in.image.tilesX() * in.image.tilesY() - 1));
  const int by_tile =
      addSort(list, "sort_tiles", in.scratch, {p.keys, p.splats, kWorkPairs, kBlockBits, tile_bits, in.tuning.runs});
  list.add("tile_ranges", Shader::tileRanges, {{p.keys[by_tile], Texels::r32ui}, list.counters(), in.image.tile_ranges},
           {}, Groups::perItem(kWorkPairs));

  // Splats to sums per pixel, sums to a picture.
  addBlend(list, in, by_tile);
  if (in.variant.shown) addPresent(list, in);
  return list;
}

}  // namespace tg
