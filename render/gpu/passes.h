// SPDX-License-Identifier: Apache-2.0
// A list of dispatches with what each is given, as data, and the two algorithms that are several dispatches long.
#pragma once
#include <array>
#include <cstddef>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "render/gpu/device.h"
#include "render/gpu/shaders.h"
#include "shared/work.h"

namespace tg {

// How many groups a dispatch has: a number, or what the device wrote into Counters.
struct Groups {
  glm::uvec3 count{1};
  std::optional<std::uint32_t> indirect;  // offset of the three counts in Counters

  static Groups fixed(std::uint32_t x, std::uint32_t y = 1) { return {{x, y, 1}, {}}; }
  static Groups perItem(std::uint32_t work) {
    return {{}, static_cast<std::uint32_t>(work * sizeof(Work) + offsetof(Work, item_groups))};
  }
  static Groups perPartition(std::uint32_t work) {
    return {{}, static_cast<std::uint32_t>(work * sizeof(Work) + offsetof(Work, partition_groups))};
  }
};

// How a uniform texel buffer's elements are read.
enum class Texels { none, r32ui, rgba32ui, rgba32f, rgba16f };

// All or a part of a storage buffer, or a uniform texel buffer.
struct Binding {
  const GpuBuffer* buffer = nullptr;
  std::uint64_t offset = 0;  // [bytes]
  std::uint64_t bytes = 0;   // 0: all
  Texels texels = Texels::none;
  Binding(const BufferPtr& whole) : buffer(whole.get()) {}  // implicit: a list of buffers is a list of bindings
  Binding(const BufferPtr& part, std::uint64_t first, std::uint64_t length)
      : buffer(part.get()), offset(first), bytes(length) {}
  Binding(const BufferPtr& whole, Texels format) : buffer(whole.get()), texels(format) {}
};

struct PassOptions {
  std::vector<std::uint32_t> constants;  // specialization, by constant_id
  const GpuImage* image = nullptr;
};

struct Pass {
  const char* name = nullptr;  // its row in the table of times; consecutive passes of one name share a row
  Shader shader{};
  // In the order of the shader's bindings, exactly as many as it has: texel buffers, then storage buffers.
  std::vector<Binding> buffers;
  PassUniforms uniforms;
  Groups groups;
  PassOptions options;
};

// A run writes `first` into the counters and zeros into the buffers to clear, then executes the passes one after the
// other: every pass sees all that was written before it.
class PassList {
 public:
  PassList(const BufferPtr& counters, const Counters& first) : counters_(counters), first_(first) {}

  void clear(const BufferPtr& buffer) { cleared_.push_back(buffer.get()); }
  void add(const char* name, Shader shader, std::vector<Binding> buffers, const PassUniforms& uniforms,
           const Groups& groups, const PassOptions& options = {});

  const BufferPtr& counters() const { return counters_; }
  const Counters& firstCounters() const { return first_; }
  const std::vector<const GpuBuffer*>& cleared() const { return cleared_; }
  const std::vector<Pass>& passes() const { return passes_; }

 private:
  const BufferPtr& counters_;
  Counters first_;
  std::vector<const GpuBuffer*> cleared_;
  std::vector<Pass> passes_;
};

// What scans and sorts need beside their data; shared by all of a frame.
struct Scratch {
  explicit Scratch(GpuDevice& device);
  BufferPtr partition_sums;  // [kMaxPartitions]
  BufferPtr histogram;       // [kDigitCount, kMaxPartitions]
  BufferPtr digit_totals;    // [kDigitCount]
};

// Values equal kScan* of shaders/scan_input.glsl.
enum class ScanInput : std::uint32_t { values = 0, nonZero = 1, ordered = 2 };

// offsets[i] = sum of the inputs before item i of `work`; the grand total makes the work `next_work`, for which there
// are `capacity` places. `order` is read by ScanInput::ordered alone.
struct Scan {
  ScanInput input = ScanInput::values;
  const BufferPtr& values;
  const BufferPtr& order;
  const BufferPtr& offsets;
  std::uint32_t work = 0;
  std::uint32_t next_work = 0;
  std::uint32_t capacity = 0;
  bool runs = false;  // as of Sort
};
void addScan(PassList& list, const char* name, const Scratch& scratch, const Scan& scan);

using PingPong = std::array<BufferPtr, 2>;

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
