// SPDX-License-Identifier: Apache-2.0
// Embedded SPIR-V to pipelines, buffers to descriptor sets.
#include "render/vulkan/pipeline.h"

#include <array>

#include "render/vulkan/check.h"
#include "shared/layout.h"

namespace tg {
namespace {

constexpr std::uint32_t kMostBuffers = 16;
constexpr std::uint32_t kSetsPerPool = 64;

constexpr VkFormat kFormats[] = {VK_FORMAT_UNDEFINED, VK_FORMAT_R32_UINT, VK_FORMAT_R32G32B32A32_UINT,
                                 VK_FORMAT_R32G32B32A32_SFLOAT, VK_FORMAT_R16G16B16A16_SFLOAT};  // as Texels
static_assert(std::size(kFormats) == static_cast<std::size_t>(Texels::rgba16f) + 1);

VkDescriptorSetLayout createSetLayout(const VulkanDevice& device, const ShaderModule& module, const Pipeline& counts) {
  std::vector<VkDescriptorSetLayoutBinding> bindings;
  const auto add = [&](std::uint32_t binding, VkDescriptorType type) {
    bindings.push_back({binding, type, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr});
  };
  if (module.image) add(0, VK_DESCRIPTOR_TYPE_STORAGE_IMAGE);
  for (std::uint32_t i = 0; i < counts.texel_count + counts.buffer_count; ++i) {
    const bool texel = i < counts.texel_count;
    add(module.image + i, texel ? VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER);
  }
  add(kViewBinding, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER);
  add(kPassBinding, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC);
  VkDescriptorSetLayoutCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
  info.bindingCount = static_cast<std::uint32_t>(bindings.size());
  info.pBindings = bindings.data();
  VkDescriptorSetLayout layout = VK_NULL_HANDLE;
  TG_VK(vkCreateDescriptorSetLayout(device.device, &info, nullptr, &layout));
  return layout;
}

VkPipeline createPipeline(const VulkanDevice& device, VkPipelineLayout layout, std::span<const std::uint32_t> spirv,
                          std::span<const std::uint32_t> constants) {
  VkShaderModuleCreateInfo code{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
  code.codeSize = spirv.size_bytes();
  code.pCode = spirv.data();
  std::vector<VkSpecializationMapEntry> entries;
  for (std::uint32_t i = 0; i < constants.size(); ++i) entries.push_back({i, i * 4, 4});
  const VkSpecializationInfo specialization{static_cast<std::uint32_t>(entries.size()), entries.data(),
                                            constants.size_bytes(), constants.data()};
  VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
  info.stage = {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO};
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = &specialization;
  info.layout = layout;
  VkPipeline pipeline = VK_NULL_HANDLE;
  TG_VK(vkCreateShaderModule(device.device, &code, nullptr, &info.stage.module));
  const VkResult result = vkCreateComputePipelines(device.device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline);
  vkDestroyShaderModule(device.device, info.stage.module, nullptr);
  TG_VK(result);
  return pipeline;
}

}  // namespace

Pipelines::~Pipelines() {
  for (const auto& [key, pipeline] : pipelines_) {
    vkDestroyPipeline(device_.device, pipeline.pipeline, nullptr);
    vkDestroyPipelineLayout(device_.device, pipeline.layout, nullptr);
    vkDestroyDescriptorSetLayout(device_.device, pipeline.set_layout, nullptr);
  }
}

const Pipeline& Pipelines::get(Shader shader, std::span<const std::uint32_t> constants) {
  const auto [entry, is_new] = pipelines_.try_emplace({shader, {constants.begin(), constants.end()}});
  Pipeline& pipeline = entry->second;  // in the map from here on: its handles are destroyed with it, complete or not
  if (pipeline.pipeline) return pipeline;
  const ShaderModule& module = moduleOf(shader);
  pipeline.first_buffer = module.image;
  const bool storage = device_.storage_texels && !module.storage.empty();
  pipeline.texel_count = storage ? 0 : module.texel_count;
  pipeline.buffer_count = module.buffer_count + module.texel_count - pipeline.texel_count;
  if (!pipeline.set_layout) pipeline.set_layout = createSetLayout(device_, module, pipeline);
  if (!pipeline.layout) {
    VkPipelineLayoutCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    info.setLayoutCount = 1;
    info.pSetLayouts = &pipeline.set_layout;
    TG_VK(vkCreatePipelineLayout(device_.device, &info, nullptr, &pipeline.layout));
  }
  pipeline.pipeline = createPipeline(device_, pipeline.layout, storage ? module.storage : module.code, constants);
  return pipeline;
}

DescriptorSets::DescriptorSets(const VulkanDevice& device, const Buffer& view, const Buffer& pass_slots)
    : device_(device), view_(view), pass_slots_(pass_slots) {}

DescriptorSets::~DescriptorSets() {
  for (VkDescriptorPool pool : pools_) vkDestroyDescriptorPool(device_.device, pool, nullptr);
}

VkDescriptorPool DescriptorSets::addPool() {
  const std::array<VkDescriptorPoolSize, 5> sizes = {{
      {VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, kSetsPerPool * kMostBuffers},
      {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, kSetsPerPool * kMostBuffers},
      {VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, kSetsPerPool},
      {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, kSetsPerPool},
      {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC, kSetsPerPool},
  }};
  VkDescriptorPoolCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
  info.maxSets = kSetsPerPool;
  info.poolSizeCount = static_cast<std::uint32_t>(sizes.size());
  info.pPoolSizes = sizes.data();
  VkDescriptorPool pool = VK_NULL_HANDLE;
  TG_VK(vkCreateDescriptorPool(device_.device, &info, nullptr, &pool));
  pools_.push_back(pool);
  sets_left_ = kSetsPerPool;
  return pool;
}

VkDescriptorSet DescriptorSets::make(const Pipeline& pipeline, const Pass& pass) {
  VkDescriptorSetAllocateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
  info.descriptorPool = sets_left_ ? pools_.back() : addPool();
  info.descriptorSetCount = 1;
  info.pSetLayouts = &pipeline.set_layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  TG_VK(vkAllocateDescriptorSets(device_.device, &info, &set));
  --sets_left_;

  std::vector<VkDescriptorBufferInfo> infos(pass.buffers.size());
  std::vector<VkBufferView> views(pass.buffers.size());
  for (std::size_t i = 0; i < pass.buffers.size(); ++i) {
    const Binding& binding = pass.buffers[i];
    const auto& buffer = static_cast<const Buffer&>(*binding.buffer);
    infos[i] = {buffer.handle(), binding.offset, binding.bytes ? binding.bytes : buffer.size()};
    if (i < pipeline.texel_count) views[i] = buffer.view(kFormats[static_cast<std::size_t>(binding.texels)]);
  }
  const VkDescriptorBufferInfo view{view_.handle(), 0, sizeof(ViewUniforms)};
  const VkDescriptorBufferInfo slot{pass_slots_.handle(), 0, sizeof(PassUniforms)};
  const GpuImage* image = pass.options.image;
  const VkDescriptorImageInfo picture{VK_NULL_HANDLE, image ? static_cast<const StorageImage*>(image)->view() : nullptr,
                                      VK_IMAGE_LAYOUT_GENERAL};
  std::vector<VkWriteDescriptorSet> writes;
  const auto write = [&](std::uint32_t binding, VkDescriptorType type) -> VkWriteDescriptorSet& {
    VkWriteDescriptorSet& added = writes.emplace_back(VkWriteDescriptorSet{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET});
    added.dstSet = set;
    added.dstBinding = binding;
    added.descriptorCount = 1;
    added.descriptorType = type;
    return added;
  };
  for (std::uint32_t i = 0; i < infos.size(); ++i) {
    if (i < pipeline.texel_count) {
      write(pipeline.first_buffer + i, VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER).pTexelBufferView = &views[i];
    } else {
      write(pipeline.first_buffer + i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER).pBufferInfo = &infos[i];
    }
  }
  if (image) write(0, VK_DESCRIPTOR_TYPE_STORAGE_IMAGE).pImageInfo = &picture;
  write(kViewBinding, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER).pBufferInfo = &view;
  write(kPassBinding, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC).pBufferInfo = &slot;
  vkUpdateDescriptorSets(device_.device, static_cast<std::uint32_t>(writes.size()), writes.data(), 0, nullptr);
  return set;
}

}  // namespace tg
