// SPDX-License-Identifier: Apache-2.0
// A list of dispatches with what each is given, its recording with barriers and time stamps, and the two algorithms
// that are several dispatches long.
#pragma once
#include <array>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/vulkan/pipeline.h"

namespace tg {

// How many groups a dispatch has: a number, or what the device wrote into Counters.
struct Groups {
  glm::uvec3 count{1};
  std::optional<VkDeviceSize> indirect;  // offset of the three counts in Counters

  static Groups fixed(std::uint32_t x, std::uint32_t y = 1) { return {{x, y, 1}, {}}; }
  static Groups perItem(std::uint32_t work) { return {{}, work * sizeof(Work) + offsetof(Work, item_groups)}; }
  static Groups perPartition(std::uint32_t work) {
    return {{}, work * sizeof(Work) + offsetof(Work, partition_groups)};
  }
};

struct Pass {
  const char* name = nullptr;  // its row in the table of times; consecutive passes of one name share a row
  const Pipeline* pipeline = nullptr;
  VkDescriptorSet set = VK_NULL_HANDLE;
  std::uint32_t slot_offset = 0;  // [bytes] of its PassUniforms
  Groups groups;
};

// Device time per pass name of one recording.
class Timer {
 public:
  explicit Timer(const VulkanDevice& device);
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;
  ~Timer();

  void begin(VkCommandBuffer commands);
  // Everything recorded since the last mark belongs to `name`. Comes after a barrier: some drivers stamp early.
  void mark(VkCommandBuffer commands, const char* name);
  // After the recording has executed. Empty on devices without time stamps.
  std::vector<PassTime> read();

 private:
  const VulkanDevice& device_;
  std::uint32_t valid_bits_ = 0;
  VkQueryPool pool_ = VK_NULL_HANDLE;
  std::vector<const char*> names_;
};

struct PassOptions {
  std::vector<std::uint32_t> constants;  // specialization, by constant_id
  VkImageView image = VK_NULL_HANDLE;
};

class PassList {
 public:
  PassList(const VulkanDevice& device, Pipelines& pipelines, const Buffer& view, const Buffer& counters);

  void add(const char* name, Shader shader, std::vector<Binding> buffers, const PassUniforms& uniforms,
           const Groups& groups, const PassOptions& options = {});

  const Buffer& counters() const { return counters_; }
  // Every pass sees all that earlier passes and transfers wrote. `timer` may be null.
  void record(VkCommandBuffer commands, Timer* timer) const;

 private:
  Pipelines& pipelines_;
  const Buffer& counters_;
  std::uint32_t slot_stride_;  // [bytes]
  Buffer slots_;
  DescriptorSets sets_;
  std::vector<Pass> passes_;
};

// What scans and sorts need beside their data; shared by all of a frame.
struct Scratch {
  explicit Scratch(const VulkanDevice& device);
  Buffer partition_sums;  // [kMaxPartitions]
  Buffer histogram;       // [kDigitCount, kMaxPartitions]
  Buffer digit_totals;    // [kDigitCount]
};

// Values equal kScan* of shaders/scan_input.glsl.
enum class ScanInput : std::uint32_t { values = 0, nonZero = 1, ordered = 2 };

// offsets[i] = sum of the inputs before item i of `work`; the grand total makes the work `next_work`, for which there
// are `capacity` places. `order` is read by ScanInput::ordered alone.
struct Scan {
  ScanInput input = ScanInput::values;
  const Buffer& values;
  const Buffer& order;
  const Buffer& offsets;
  std::uint32_t work = 0;
  std::uint32_t next_work = 0;
  std::uint32_t capacity = 0;
};
void addScan(PassList& list, const char* name, const Scratch& scratch, const Scan& scan);

using PingPong = std::array<Buffer, 2>;

// Stable, ascending by `bits` bits of the keys from `first_bit` on; the items of `work` lie in keys[0], values[0].
struct Sort {
  const PingPong& keys;
  const PingPong& values;
  std::uint32_t work = 0;
  std::uint32_t first_bit = 0;
  std::uint32_t bits = 32;
  bool runs = false;  // a thread per partition instead of a group, for drivers on the CPU
};
// Returns which of the two buffers holds the result.
int addSort(PassList& list, const char* name, const Scratch& scratch, const Sort& sort);

}  // namespace tg
