// SPDX-License-Identifier: Apache-2.0
// Compute pipelines by shader name, and the sets of buffers that they are given.
#pragma once
#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "render/gpu/passes.h"
#include "render/vulkan/buffer.h"

namespace tg {

struct Pipeline {
  VkPipeline pipeline = VK_NULL_HANDLE;
  VkPipelineLayout layout = VK_NULL_HANDLE;
  VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
  std::uint32_t first_buffer = 0;  // binding of the first buffer: 1 where an image has binding 0
  std::uint32_t texel_count = 0;   // uniform texel buffers, which come first
  std::uint32_t buffer_count = 0;  // storage buffers
};

// Pipelines by shader and specialization constants, each made at its first use and kept.
class Pipelines {
 public:
  explicit Pipelines(const VulkanDevice& device) : device_(device) {}
  Pipelines& operator=(Pipelines&&) = delete;
  ~Pipelines();

  // constants[i] specializes constant_id i.
  const Pipeline& get(Shader shader, std::span<const std::uint32_t> constants = {});

 private:
  const VulkanDevice& device_;
  std::map<std::pair<Shader, std::vector<std::uint32_t>>, Pipeline> pipelines_;
};

// Descriptor sets that live and die together. The uniform blocks are the same for all: the view, and one slot per
// dispatch, chosen by dynamic offset.
class DescriptorSets {
 public:
  DescriptorSets(const VulkanDevice& device, const Buffer& view, const Buffer& pass_slots);
  DescriptorSets& operator=(DescriptorSets&&) = delete;
  ~DescriptorSets();

  // With the buffers and the image of `pass`, which `pipeline` runs.
  VkDescriptorSet make(const Pipeline& pipeline, const Pass& pass);

 private:
  VkDescriptorPool addPool();

  const VulkanDevice& device_;
  const Buffer& view_;
  const Buffer& pass_slots_;
  std::vector<VkDescriptorPool> pools_;
  std::uint32_t sets_left_ = 0;  // in the last pool
};

}  // namespace tg
