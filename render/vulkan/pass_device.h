// SPDX-License-Identifier: Apache-2.0
// Lists of passes on Vulkan: command buffers with barriers and time stamps.
#pragma once
#include <array>
#include <memory>
#include <vector>

#include "core/system/assert.h"
#include "render/gpu/passes.h"
#include "render/vulkan/pipeline.h"

namespace tg {

// Device time per pass name of one recording.
class Timer {
 public:
  explicit Timer(const VulkanDevice& device);
  Timer& operator=(Timer&&) = delete;
  ~Timer();

  void begin(VkCommandBuffer commands);
  // Everything recorded since the last mark belongs to `name`. Comes after a barrier: some drivers stamp early.
  void mark(VkCommandBuffer commands, const char* name);
  // After the recording has executed. Empty on devices without time stamps.
  std::vector<PassTime> read() const;

 private:
  const VulkanDevice& device_;
  std::uint32_t valid_bits_ = 0;
  VkQueryPool pool_ = VK_NULL_HANDLE;
  std::vector<const char*> names_;
};

class VulkanProgram final : public PassProgram {
 public:
  VulkanProgram(const VulkanDevice& device, Pipelines& pipelines, const PassList& list);

  static constexpr std::size_t kMostUnderWay = 2;

  // Leaves the list's image in layout GENERAL, written by compute. kMostUnderWay recordings may execute on one queue,
  // one after the other: what the host reads of them lies apart, the rest is ordered by barriers.
  void record(VkCommandBuffer commands, const ViewUniforms& view);
  Counters counters() const override;
  std::vector<PassTime> times() const override { return oldest().timer.read(); }
  void next() override {
    TG_ASSERT(taken_ < recorded_, "a recording has not been passed");
    ++taken_;
  }

 private:
  struct Dispatch {
    const char* name;
    const Pipeline* pipeline;
    VkDescriptorSet set;
    std::uint32_t slot_offset;  // [bytes] of its PassUniforms
    Groups groups;
  };
  // What the host reads of a recording.
  struct Results {
    explicit Results(const VulkanDevice& device)
        : timer(device), counters(device, "counters read-back", sizeof(Counters), Memory::readBack) {}
    Timer timer;
    Buffer counters;
  };
  Results& oldest() const { return *results_[taken_ % kMostUnderWay]; }
  void recordStart(VkCommandBuffer commands, const ViewUniforms& view);
  void recordImageStart(VkCommandBuffer commands);

  std::array<std::unique_ptr<Results>, kMostUnderWay> results_;
  std::size_t recorded_ = 0, taken_ = 0;
  Counters first_;
  VkBuffer counters_;
  std::vector<VkBuffer> cleared_;
  VkImage image_ = VK_NULL_HANDLE;
  std::uint32_t slot_stride_;  // [bytes]
  Buffer view_;
  Buffer slots_;
  DescriptorSets sets_;
  std::vector<Dispatch> dispatches_;
};

class VulkanPassDevice final : public GpuDevice {
 public:
  // `device` must outlive this.
  VulkanPassDevice(VulkanDevice& device, std::shared_ptr<Pipelines> pipelines)
      : device_(device), commands_(device), pipelines_(std::move(pipelines)) {}

  GpuLimits limits() const override;
  BufferPtr makeBuffer(const char* name, std::uint64_t bytes) override;
  ImagePtr makeImage(std::uint32_t width, std::uint32_t height) override;
  void upload(const BufferPtr& target, std::uint64_t bytes, std::uint64_t granularity,
              const std::function<void(std::uint64_t first, std::span<std::byte>)>& write) override;
  void download(const BufferPtr& source, std::span<std::byte> out) override;
  Image download(const ImagePtr& source, std::uint32_t width, std::uint32_t height) override;
  std::unique_ptr<PassProgram> prepare(const PassList& list) override;
  void run(PassProgram& program, const ViewUniforms& view) override;

 private:
  VulkanDevice& device_;
  Commands commands_;
  std::shared_ptr<Pipelines> pipelines_;
};

}  // namespace tg
