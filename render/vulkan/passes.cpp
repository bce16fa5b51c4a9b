// SPDX-License-Identifier: Apache-2.0
// Recording of pass lists; scan and sort as passes.
#include "render/vulkan/passes.h"

#include <cstring>

#include "core/error.h"
#include "render/vulkan/check.h"

namespace tg {
namespace {

constexpr std::uint32_t kMaxPasses = 1024;
constexpr std::uint32_t kMaxTimeStamps = 32;
constexpr std::uint32_t kDigitsPerScanGroup = 16;  // shaders/sort_scan.comp

std::uint32_t roundUp(VkDeviceSize value, VkDeviceSize step) {
  return static_cast<std::uint32_t>((value + step - 1) / step * step);
}

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

std::vector<PassTime> Timer::read() {
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

PassList::PassList(const VulkanDevice& device, Pipelines& pipelines, const Buffer& view, const Buffer& counters)
    : pipelines_(pipelines),
      counters_(counters),
      slot_stride_(roundUp(sizeof(PassUniforms), device.properties.limits.minUniformBufferOffsetAlignment)),
      slots_(device, "pass uniforms", VkDeviceSize{kMaxPasses} * slot_stride_, Memory::host),
      sets_(device, view, slots_) {}

void PassList::add(const char* name, Shader shader, std::vector<Binding> buffers, const PassUniforms& uniforms,
                   const Groups& groups, const PassOptions& options) {
  if (passes_.size() == kMaxPasses) {
    throw Error(ErrorKind::device, std::string(name),
                "too many dispatches in a frame (at most " + std::to_string(kMaxPasses) + ")");
  }
  Pass pass;
  pass.name = name;
  pass.pipeline = &pipelines_.get(shader, options.constants);
  pass.set = sets_.make(*pass.pipeline, buffers, options.image);
  pass.slot_offset = static_cast<std::uint32_t>(passes_.size()) * slot_stride_;
  pass.groups = groups;
  std::memcpy(slots_.data() + pass.slot_offset, &uniforms, sizeof uniforms);
  passes_.push_back(pass);
}

void PassList::record(VkCommandBuffer commands, Timer* timer) const {
  constexpr VkPipelineStageFlags kWriters = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT;
  constexpr VkPipelineStageFlags kReaders = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT;
  for (std::size_t i = 0; i < passes_.size(); ++i) {
    const Pass& pass = passes_[i];
    stageBarrier(commands, kWriters, kReaders);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pass.pipeline->pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pass.pipeline->layout, 0, 1, &pass.set, 1,
                            &pass.slot_offset);
    if (pass.groups.indirect) {
      vkCmdDispatchIndirect(commands, counters_.handle(), *pass.groups.indirect);
    } else {
      vkCmdDispatch(commands, pass.groups.count.x, pass.groups.count.y, pass.groups.count.z);
    }
    const bool last_of_name = i + 1 == passes_.size() || std::strcmp(passes_[i + 1].name, pass.name) != 0;
    if (timer && last_of_name) {
      stageBarrier(commands, kWriters, kReaders);
      timer->mark(commands, pass.name);
    }
  }
}

Scratch::Scratch(const VulkanDevice& device)
    : partition_sums(device, "partition sums", kMaxPartitions * 4),
      histogram(device, "histogram", VkDeviceSize{kDigitCount} * kMaxPartitions * 4),
      digit_totals(device, "digit totals", kDigitCount * 4) {}

void addScan(PassList& list, const char* name, const Scratch& scratch, const Scan& scan) {
  PassUniforms uniforms{};
  uniforms.work = scan.work;
  uniforms.next_work = scan.next_work;
  uniforms.capacity = scan.capacity;
  const PassOptions input{{static_cast<std::uint32_t>(scan.input)}};
  const Groups groups = Groups::perPartition(scan.work);
  list.add(name, Shader::scanReduce, {list.counters(), scan.values, scan.order, scratch.partition_sums}, uniforms,
           groups, input);
  list.add(name, Shader::scanPartitions, {list.counters(), scratch.partition_sums}, uniforms, Groups::fixed(1));
  list.add(name, Shader::scanApply, {list.counters(), scan.values, scan.order, scratch.partition_sums, scan.offsets},
           uniforms, groups, input);
}

int addSort(PassList& list, const char* name, const Scratch& scratch, const Sort& sort) {
  PassUniforms uniforms{};
  uniforms.work = sort.work;
  int from = 0;
  for (std::uint32_t bit = 0; bit < sort.bits; bit += kDigitBits, from = 1 - from) {
    const int to = 1 - from;
    const Buffer& keys = sort.keys[from];
    const Buffer& values = sort.values[from];
    const Groups runs = Groups::fixed(kMaxPartitions / kRunThreads);
    const Groups groups = Groups::perPartition(sort.work);
    uniforms.shift = sort.first_bit + bit;
    if (sort.runs) {
      list.add(name, Shader::sortCountRuns, {{keys, VK_FORMAT_R32_UINT}, list.counters(), scratch.histogram}, uniforms,
               runs);
    } else {
      list.add(name, Shader::sortCount, {list.counters(), keys, scratch.histogram}, uniforms, groups);
    }
    list.add(name, Shader::sortScan, {list.counters(), scratch.histogram, scratch.digit_totals}, uniforms,
             Groups::fixed(kDigitCount / kDigitsPerScanGroup));
    if (sort.runs) {
      list.add(name, Shader::sortScatterRuns,
               {{keys, VK_FORMAT_R32_UINT},
                {values, VK_FORMAT_R32_UINT},
                list.counters(),
                sort.keys[to],
                sort.values[to],
                scratch.histogram,
                scratch.digit_totals},
               uniforms, runs);
    } else {
      list.add(name, Shader::sortScatter,
               {list.counters(), keys, values, sort.keys[to], sort.values[to], scratch.histogram, scratch.digit_totals},
               uniforms, groups);
    }
  }
  return from;
}

}  // namespace tg
