// SPDX-License-Identifier: Apache-2.0
// Recording of pass lists.
#include "render/vulkan/pass_device.h"

#include <cstring>

#include "core/system/assert.h"
#include "render/vulkan/check.h"

namespace tg {
namespace {

constexpr std::uint32_t kMaxTimeStamps = 32;
constexpr VkPipelineStageFlags kTransfer = VK_PIPELINE_STAGE_TRANSFER_BIT;
constexpr VkPipelineStageFlags kCompute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;

std::uint32_t roundUp(VkDeviceSize value, VkDeviceSize step) {
  return static_cast<std::uint32_t>((value + step - 1) / step * step);
}

const Buffer& vulkanBuffer(const GpuBuffer& buffer) { return static_cast<const Buffer&>(buffer); }

}  // namespace

Timer::Timer(const VulkanDevice& device) : device_(device) {
  std::uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(device.physical, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(device.physical, &count, families.data());
  valid_bits_ = families.at(device.queue_family).timestampValidBits;
  if (valid_bits_ == 0) return;
  VkQueryPoolCreateInfo info{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
  info.queryType = VK_QUERY_TYPE_TIMESTAMP;
  info.queryCount = kMaxTimeStamps;
  TG_VK(vkCreateQueryPool(device.device, &info, nullptr, &pool_));
}

Timer::~Timer() { vkDestroyQueryPool(device_.device, pool_, nullptr); }

void Timer::begin(VkCommandBuffer commands) {
  names_.clear();
  if (!pool_) return;
  vkCmdResetQueryPool(commands, pool_, 0, kMaxTimeStamps);
  vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool_, 0);
}

void Timer::mark(VkCommandBuffer commands, const char* name) {
  if (!pool_ || names_.size() + 1 >= kMaxTimeStamps) return;
  names_.push_back(name);
  vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool_, static_cast<std::uint32_t>(names_.size()));
}

std::vector<PassTime> Timer::read() const {
  std::vector<PassTime> times;
  if (names_.empty()) return times;
  std::vector<std::uint64_t> stamps(names_.size() + 1);
  TG_VK(vkGetQueryPoolResults(device_.device, pool_, 0, static_cast<std::uint32_t>(stamps.size()), stamps.size() * 8,
                              stamps.data(), 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT));
  const std::uint64_t mask = valid_bits_ >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << valid_bits_) - 1;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const auto ticks = static_cast<double>((stamps[i + 1] - stamps[i]) & mask);
    times.push_back({names_[i], ticks * device_.properties.limits.timestampPeriod * 1e-6});
  }
  return times;
}

VulkanProgram::VulkanProgram(const VulkanDevice& device, Pipelines& pipelines, const PassList& list)
    : results_{std::make_unique<Results>(device), std::make_unique<Results>(device)},
      first_(list.firstCounters()),
      counters_(vulkanBuffer(*list.counters()).handle()),
      slot_stride_(roundUp(sizeof(PassUniforms), device.properties.limits.minUniformBufferOffsetAlignment)),
      view_(device, "view uniforms", sizeof(ViewUniforms), Memory::host),
      slots_(device, "pass uniforms", VkDeviceSize{list.passes().size()} * slot_stride_, Memory::host),
      sets_(device, view_, slots_) {
  for (const GpuBuffer* buffer : list.cleared()) cleared_.push_back(vulkanBuffer(*buffer).handle());
  for (const Pass& pass : list.passes()) {
    const Pipeline& pipeline = pipelines.get(pass.shader, pass.options.constants);
    const auto slot = static_cast<std::uint32_t>(dispatches_.size()) * slot_stride_;
    std::memcpy(slots_.data() + slot, &pass.uniforms, sizeof pass.uniforms);
    dispatches_.push_back({pass.name, &pipeline, sets_.make(pipeline, pass), slot, pass.groups});
    if (pass.options.image) image_ = static_cast<const StorageImage*>(pass.options.image)->handle();
  }
}

Counters VulkanProgram::counters() const {
  TG_ASSERT(taken_ < recorded_, "a recording has not been passed");
  Counters counters;
  std::memcpy(&counters, oldest().counters.data(), sizeof counters);
  return counters;
}

// Every pixel is written, so that the old picture need not survive the change of layout.
void VulkanProgram::recordImageStart(VkCommandBuffer commands) {
  VkImageMemoryBarrier barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER};
  barrier.dstAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
  barrier.oldLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  barrier.newLayout = VK_IMAGE_LAYOUT_GENERAL;
  barrier.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = image_;
  barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  vkCmdPipelineBarrier(commands, kTransfer, kCompute, 0, 0, nullptr, 0, nullptr, 1, &barrier);
}

// The view travels in the command buffer: the recording before may still be reading its own.
void VulkanProgram::recordStart(VkCommandBuffer commands, const ViewUniforms& view) {
  if (image_) recordImageStart(commands);
  stageBarrier(commands, kTransfer | kCompute, kTransfer | kCompute);
  vkCmdUpdateBuffer(commands, counters_, 0, sizeof first_, &first_);
  vkCmdUpdateBuffer(commands, view_.handle(), 0, sizeof view, &view);
  for (VkBuffer buffer : cleared_) vkCmdFillBuffer(commands, buffer, 0, VK_WHOLE_SIZE, 0);
}

void VulkanProgram::record(VkCommandBuffer commands, const ViewUniforms& view) {
  TG_ASSERT(recorded_ - taken_ < kMostUnderWay, "no more recordings are under way than there may be");
  constexpr VkPipelineStageFlags kWriters = kCompute | kTransfer;
  constexpr VkPipelineStageFlags kReaders = kCompute | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT;
  Results& results = *results_[recorded_++ % kMostUnderWay];
  results.timer.begin(commands);
  recordStart(commands, view);
  for (std::size_t i = 0; i < dispatches_.size(); ++i) {
    const Dispatch& pass = dispatches_[i];
    stageBarrier(commands, kWriters, kReaders);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pass.pipeline->pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pass.pipeline->layout, 0, 1, &pass.set, 1,
                            &pass.slot_offset);
    if (pass.groups.indirect) {
      vkCmdDispatchIndirect(commands, counters_, *pass.groups.indirect);
    } else {
      vkCmdDispatch(commands, pass.groups.count.x, pass.groups.count.y, pass.groups.count.z);
    }
    const bool last_of_name = i + 1 == dispatches_.size() || std::strcmp(dispatches_[i + 1].name, pass.name) != 0;
    if (last_of_name) {
      stageBarrier(commands, kWriters, kReaders);
      results.timer.mark(commands, pass.name);
    }
  }
  const VkBufferCopy copy{0, 0, sizeof(Counters)};
  stageBarrier(commands, kWriters, kTransfer);
  vkCmdCopyBuffer(commands, counters_, results.counters.handle(), 1, &copy);
  stageBarrier(commands, kTransfer, VK_PIPELINE_STAGE_HOST_BIT);
}

GpuLimits VulkanPassDevice::limits() const { return limitsOf(device_.properties, device_.storage_texels); }

BufferPtr VulkanPassDevice::makeBuffer(const char* name, std::uint64_t bytes) {
  return std::make_unique<Buffer>(device_, name, bytes);
}

ImagePtr VulkanPassDevice::makeImage(std::uint32_t width, std::uint32_t height) {
  const std::uint32_t most = limits().image_side;
  return std::make_unique<StorageImage>(device_, allocatedSide(width, most), allocatedSide(height, most));
}

void VulkanPassDevice::upload(const BufferPtr& target, std::uint64_t bytes, std::uint64_t granularity,
                              const std::function<void(std::uint64_t first, std::span<std::byte>)>& write) {
  tg::upload(device_, commands_, vulkanBuffer(*target), bytes, granularity, write);
}

void VulkanPassDevice::download(const BufferPtr& source, std::span<std::byte> out) {
  tg::download(device_, commands_, vulkanBuffer(*source), out);
}

Image VulkanPassDevice::download(const ImagePtr& source, std::uint32_t width, std::uint32_t height) {
  const Buffer pixels(device_, "picture read-back", VkDeviceSize{width} * height * 4, Memory::readBack);
  commands_.run([&](VkCommandBuffer commands) {
    stageBarrier(commands, kCompute, kTransfer);
    VkBufferImageCopy copy{};
    copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    copy.imageExtent = {width, height, 1};
    vkCmdCopyImageToBuffer(commands, static_cast<const StorageImage&>(*source).handle(), VK_IMAGE_LAYOUT_GENERAL,
                           pixels.handle(), 1, &copy);
    stageBarrier(commands, kTransfer, VK_PIPELINE_STAGE_HOST_BIT);
  });
  return imageFromRgba8({pixels.data(), static_cast<std::size_t>(width) * height * 4}, static_cast<int>(width),
                        static_cast<int>(height));
}

std::unique_ptr<PassProgram> VulkanPassDevice::prepare(const PassList& list) {
  return std::make_unique<VulkanProgram>(device_, *pipelines_, list);
}

void VulkanPassDevice::run(PassProgram& program, const ViewUniforms& view) {
  commands_.run([&](VkCommandBuffer commands) { static_cast<VulkanProgram&>(program).record(commands, view); });
}

}  // namespace tg
