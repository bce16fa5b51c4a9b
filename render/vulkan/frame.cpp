// SPDX-License-Identifier: Apache-2.0
// The frame as a list, top to bottom.
#include "render/vulkan/frame.h"

#include <algorithm>
#include <bit>

#include "core/error.h"

namespace tg {
namespace {

// Mesa 22.3's llvmpipe ends all loops of a thread after 65535 rounds in total, without a word. blend.comp takes at most
// 86 rounds for a batch of 64 entries: one per entry, 16 blocks, the batch itself and its words.
constexpr std::uint32_t kListEntriesOnCpu = 32768;
constexpr std::uint32_t kListEntries = 1u << 31;  // no limit
constexpr std::uint32_t kPresentSide = 16;        // shaders/present.comp
constexpr std::uint32_t kDepthBits = 32;

PingPong makePingPong(const VulkanDevice& device, const char* name, VkDeviceSize bytes) {
  return {Buffer(device, name, bytes), Buffer(device, name, bytes)};
}

std::uint32_t checkedPixels(const VulkanDevice& device, std::uint32_t width, std::uint32_t height) {
  const VkPhysicalDeviceLimits& limits = device.properties.limits;
  const std::uint64_t pixels = std::uint64_t{width} * height;
  const std::uint64_t most = limits.maxStorageBufferRange / sizeof(glm::vec4);
  if (pixels > most || std::max(width, height) > limits.maxImageDimension2D) {
    throw Error(ErrorKind::device, device.properties.deviceName,
                "an image of " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels is too large (expected at most " + std::to_string(most) + " pixels and " +
                    std::to_string(limits.maxImageDimension2D) + " to a side)");
  }
  return static_cast<std::uint32_t>(pixels);
}

bool needsGeometry(std::optional<Output> shown) {
  return !shown || *shown == Output::depth || *shown == Output::normal || *shown == Output::count;
}

void addProject(PassList& list, const FrameInputs& in) {
  const ModelBuffers& m = in.model;
  const SplatBuffers& s = in.splats;
  for (std::uint32_t first = 0; first < m.gaussian_count; first += m.chunk) {
    const std::uint32_t count = std::min(m.chunk, m.gaussian_count - first);
    const auto part = [&](const Buffer& buffer, VkDeviceSize element_bytes) {
      return Binding(buffer, first * element_bytes, count * element_bytes);
    };
    PassUniforms uniforms{};
    uniforms.first = first;
    uniforms.count = count;
    const glm::uvec4 groups = groupGrid((count + kGroupSize - 1) / kGroupSize);
    list.add("project", Shader::project,
             {part(m.mean_logit, 16), part(m.rotation, 16), part(m.scale_offset, 16), part(m.texture_size, 4),
              part(m.sh, m.sh_bytes), s.splat[0], s.splat[1], s.splat[2], s.splat[3], s.splat[4], s.splat[5],
              s.pixel_rects, s.tile_counts},
             uniforms, Groups::fixed(groups.x, groups.y));
  }
}

void addBlend(PassList& list, const FrameInputs& in, const Buffer& pair_splats) {
  const bool on_cpu = in.device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  const std::uint32_t entries = on_cpu ? kListEntriesOnCpu : kListEntries;
  const std::uint32_t longest = std::min(in.model.gaussian_count, in.pairs.capacity);
  const PassOptions constants{{needsGeometry(in.shown), in.model.texel_shift}};
  PassUniforms uniforms{};
  uniforms.count = entries;
  do {
    list.add("blend", Shader::blend,
             {in.image.tile_ranges, pair_splats, in.splats.splat[0], in.splats.splat[1], in.splats.splat[2],
              in.splats.splat[3], in.splats.splat[4], in.splats.splat[5], in.model.texels[0], in.model.texels[1],
              in.model.texels[2], in.model.texels[3], in.image.base_transmittance, in.image.texture_depth,
              in.image.normal_count, in.splats.pixel_rects},
             uniforms, Groups::fixed(in.image.tilesX(), in.image.tilesY()), constants);
    uniforms.first += entries;
  } while (uniforms.first < longest);
}

void addPresent(PassList& list, const FrameInputs& in) {
  PassUniforms uniforms{};
  uniforms.output_kind = static_cast<std::uint32_t>(*in.shown);
  if (*in.shown == Output::depth || *in.shown == Output::count) {
    const glm::uvec4 groups = groupGrid((in.image.width * in.image.height + kGroupSize - 1) / kGroupSize);
    list.add("output_range", Shader::outputRange, {list.counters(), in.image.texture_depth, in.image.normal_count},
             uniforms, Groups::fixed(groups.x, groups.y));
  }
  list.add("present", Shader::present,
           {list.counters(), in.image.base_transmittance, in.image.texture_depth, in.image.normal_count}, uniforms,
           Groups::fixed((in.image.width + kPresentSide - 1) / kPresentSide,
                         (in.image.height + kPresentSide - 1) / kPresentSide),
           {{}, in.image.picture.view()});
}

}  // namespace

SplatBuffers::SplatBuffers(const VulkanDevice& device, std::uint32_t gaussian_count)
    : pixel_rects(device, "screen boxes", VkDeviceSize{gaussian_count} * 8),
      tile_counts(device, "tile counts", VkDeviceSize{gaussian_count} * 4),
      visible_offsets(device, "visible offsets", VkDeviceSize{gaussian_count} * 4),
      depth_keys(makePingPong(device, "depth keys", VkDeviceSize{gaussian_count} * 4)),
      depth_splats(makePingPong(device, "depth order", VkDeviceSize{gaussian_count} * 4)),
      pair_offsets(device, "pair offsets", VkDeviceSize{gaussian_count} * 4) {
  for (Buffer& member : splat) member = Buffer(device, "splats", VkDeviceSize{gaussian_count} * sizeof(glm::vec4));
}

PairBuffers::PairBuffers(const VulkanDevice& device, std::uint32_t room)
    : capacity(room),
      tiles(makePingPong(device, "pair tiles", VkDeviceSize{room} * 4)),
      splats(makePingPong(device, "pair splats", VkDeviceSize{room} * 4)) {}

ImageBuffers::ImageBuffers(const VulkanDevice& device, std::uint32_t w, std::uint32_t h) : width(w), height(h) {
  const VkDeviceSize bytes = VkDeviceSize{checkedPixels(device, w, h)} * sizeof(glm::vec4);
  tile_ranges = Buffer(device, "tile ranges", VkDeviceSize{tilesX()} * tilesY() * sizeof(glm::uvec2));
  base_transmittance = Buffer(device, "base and transmittance", bytes);
  texture_depth = Buffer(device, "texture and depth", bytes);
  normal_count = Buffer(device, "normal and count", bytes);
  picture = StorageImage(device, w, h);
}

std::uint32_t maxPairCapacity(const VulkanDevice& device) {
  return device.properties.limits.maxStorageBufferRange / sizeof(std::uint32_t);
}

void recordFrameStart(VkCommandBuffer commands, const FrameInputs& in, const Buffer& counters) {
  Counters first{};
  first.work[kWorkGaussians] = makeWork(in.model.gaussian_count, in.model.gaussian_count);
  first.output_range = glm::uvec4(~0u, 0u, 0u, 0u);
  stageBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
               VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT);
  vkCmdUpdateBuffer(commands, counters.handle(), 0, sizeof first, &first);
  vkCmdFillBuffer(commands, in.image.tile_ranges.handle(), 0, VK_WHOLE_SIZE, 0);
}

void buildFrame(PassList& list, const FrameInputs& in) {
  const SplatBuffers& s = in.splats;
  const PairBuffers& p = in.pairs;

  // Model and view to splats with their tile counts.
  addProject(list, in);

  // The visible ones side by side, then near to far. Equal depths stay in the model's order.
  addScan(list, "scan_visible", in.scratch,
          {ScanInput::nonZero, s.tile_counts, s.tile_counts, s.visible_offsets, kWorkGaussians, kWorkVisible,
           in.model.gaussian_count});
  list.add("compact", Shader::compact,
           {list.counters(), s.tile_counts, s.visible_offsets, s.splat[0], s.depth_keys[0], s.depth_splats[0]}, {},
           Groups::perItem(kWorkGaussians));
  const int near_to_far =
      addSort(list, "sort_depth", in.scratch, s.depth_keys, s.depth_splats, kWorkVisible, kDepthBits);

  // A pair for each tile of each splat, in depth order; sorted by tile alone, they stay in depth order within a tile.
  addScan(list, "scan_pairs", in.scratch,
          {ScanInput::ordered, s.tile_counts, s.depth_splats[near_to_far], s.pair_offsets, kWorkVisible, kWorkPairs,
           p.capacity});
  list.add("emit_keys", Shader::emitKeys,
           {list.counters(), s.depth_splats[near_to_far], s.pair_offsets, s.pixel_rects, p.tiles[0], p.splats[0]}, {},
           Groups::perItem(kWorkPairs));
  const auto tile_bits = static_cast<std::uint32_t>(std::bit_width(in.image.tilesX() * in.image.tilesY() - 1));
  const int by_tile = addSort(list, "sort_tiles", in.scratch, p.tiles, p.splats, kWorkPairs, tile_bits);
  list.add("tile_ranges", Shader::tileRanges, {list.counters(), p.tiles[by_tile], in.image.tile_ranges}, {},
           Groups::perItem(kWorkPairs));

  // Splats to sums per pixel, sums to a picture.
  addBlend(list, in, p.splats[by_tile]);
  if (in.shown) addPresent(list, in);
}

}  // namespace tg
