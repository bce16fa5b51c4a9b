// SPDX-License-Identifier: Apache-2.0
// Scan and sort as passes.
#include "render/gpu/passes.h"

#include <utility>

#include "core/system/assert.h"

namespace tg {
namespace {

constexpr std::uint32_t kDigitsPerScanGroup = 16;  // shaders/sort_scan.comp

}  // namespace

void PassList::add(const char* name, Shader shader, std::vector<Binding> buffers, const PassUniforms& uniforms,
                   const Groups& groups, const PassOptions& options) {
  TG_ASSERT(buffers.size() == moduleOf(shader).texel_count + moduleOf(shader).buffer_count,
            "as many buffers as the shader has");
  TG_ASSERT((options.image != nullptr) == moduleOf(shader).image, "an image where the shader has one");
  passes_.push_back({name, shader, std::move(buffers), uniforms, groups, options});
}

Scratch::Scratch(GpuDevice& device)
    : partition_sums(device.makeBuffer("partition sums", kMaxPartitions * 4)),
      histogram(device.makeBuffer("histogram", std::uint64_t{kDigitCount} * kMaxPartitions * 4)),
      digit_totals(device.makeBuffer("digit totals", kDigitCount * 4)) {}

void addScan(PassList& list, const char* name, const Scratch& scratch, const Scan& scan) {
  TG_ASSERT(scan.values && scan.order && scan.offsets, "a scan has its buffers");
  TG_ASSERT(scan.work != scan.next_work, "a scan's total makes other work");
  PassUniforms uniforms{};
  uniforms.work = scan.work;
  uniforms.next_work = scan.next_work;
  uniforms.capacity = scan.capacity;
  const PassOptions input{{static_cast<std::uint32_t>(scan.input)}};
  const Groups groups = scan.runs ? Groups::fixed(kMaxPartitions / kRunThreads) : Groups::perPartition(scan.work);
  const bool ordered = scan.input == ScanInput::ordered;
  const Binding values_texels(scan.values, ordered ? Texels::r32ui : Texels::rgba32ui);
  const Binding order_texels(scan.order, Texels::rgba32ui);
  if (scan.runs) {
    list.add(name, Shader::scanReduceRuns, {values_texels, order_texels, list.counters(), scratch.partition_sums},
             uniforms, groups, input);
  } else {
    list.add(name, Shader::scanReduce, {list.counters(), scan.values, scan.order, scratch.partition_sums}, uniforms,
             groups, input);
  }
  list.add(name, Shader::scanPartitions, {list.counters(), scratch.partition_sums}, uniforms, Groups::fixed(1));
  if (scan.runs) {
    list.add(name, Shader::scanApplyRuns,
             {values_texels, order_texels, list.counters(), scratch.partition_sums, scan.offsets}, uniforms, groups,
             input);
  } else {
    list.add(name, Shader::scanApply, {list.counters(), scan.values, scan.order, scratch.partition_sums, scan.offsets},
             uniforms, groups, input);
  }
}

int addSort(PassList& list, const char* name, const Scratch& scratch, const Sort& sort) {
  TG_ASSERT(sort.first_bit + sort.bits <= 32, "a sort by bits of the keys");
  PassUniforms uniforms{};
  uniforms.work = sort.work;
  int from = 0;
  for (std::uint32_t bit = 0; bit < sort.bits; bit += kDigitBits, from = 1 - from) {
    const int to = 1 - from;
    const BufferPtr& keys = sort.keys[from];
    const BufferPtr& values = sort.values[from];
    const Groups runs = Groups::fixed(kMaxPartitions / kRunThreads);
    const Groups groups = Groups::perPartition(sort.work);
    uniforms.shift = sort.first_bit + bit;
    if (sort.runs) {
      list.add(name, Shader::sortCountRuns, {{keys, Texels::r32ui}, list.counters(), scratch.histogram}, uniforms,
               runs);
    } else {
      list.add(name, Shader::sortCount, {list.counters(), keys, scratch.histogram}, uniforms, groups);
    }
    list.add(name, Shader::sortScan, {list.counters(), scratch.histogram, scratch.digit_totals}, uniforms,
             Groups::fixed(kDigitCount / kDigitsPerScanGroup));
    if (sort.runs) {
      list.add(name, Shader::sortScatterRuns,
               {{keys, Texels::r32ui},
                {values, Texels::r32ui},
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
