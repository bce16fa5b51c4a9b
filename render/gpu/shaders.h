// SPDX-License-Identifier: Apache-2.0
// The compiled passes by name.
#pragma once
#include <cstdint>
#include <span>

namespace tg {

// All share the two uniform blocks of shaders/pass.glsl; other bindings go by position: the image where there is one,
// uniform texel buffers, storage buffers.
enum class Shader {
  project,
  scanReduce,
  scanPartitions,
  scanApply,
  scanReduceRuns,
  scanApplyRuns,
  compact,
  sortCount,
  sortScan,
  sortScatter,
  sortCountRuns,
  sortScatterRuns,
  emitKeys,
  tileRanges,
  blend,
  solid,
  outputRange,
  present,
};

constexpr std::uint32_t kViewBinding = 16;  // shaders/pass.glsl
constexpr std::uint32_t kPassBinding = 17;

struct ShaderModule {
  const char* name = nullptr;
  std::span<const std::uint32_t> code;  // SPIR-V 1.0
  const char* text = nullptr;           // the same as GLSL 4.50, includes and macros resolved
  std::uint32_t texel_count = 0;        // uniform texel buffers, which come first
  std::uint32_t buffer_count = 0;       // storage buffers
  bool image = false;                   // at binding 0, before both
  // SPIR-V 1.0 that reads storage buffers where `code` reads texel buffers; empty: there are none.
  std::span<const std::uint32_t> storage{};
};
const ShaderModule& moduleOf(Shader shader);
std::span<const ShaderModule> shaderModules();  // all of them

}  // namespace tg
