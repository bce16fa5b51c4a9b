// SPDX-License-Identifier: Apache-2.0
// Memory, sort and scan by the CUDA runtime and cub.
#include "training/cuda/device.h"

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <limits>

#include "core/system/error.h"
#include "training/cuda/memory.h"

namespace tg::cuda {
namespace {

void check(cudaError_t status, const std::string& what) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // clears it
  throw Error(ErrorKind::device, what, cudaGetErrorString(status));
}

std::string megabytes(std::size_t bytes) { return std::to_string((bytes >> 20) + 1) + " MiB"; }

int itemCount(std::size_t count) {
  if (count > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    throw Error(ErrorKind::device, "CUDA",
                "too many Gaussians or (tile, splat) pairs (expected below 2^31, found " + std::to_string(count) + ")");
  }
  return static_cast<int>(count);
}

template <typename T>
void scan(const T* from, T* to, std::size_t count, Buffer<std::byte>& scratch) {
  if (count == 0) return;
  const LaunchTimer timer("scan");
  std::size_t bytes = 0;
  check(cub::DeviceScan::ExclusiveSum(nullptr, bytes, from, to, itemCount(count)), "CUDA, scan");
  scratch.resize(bytes);
  check(cub::DeviceScan::ExclusiveSum(scratch.data(), bytes, from, to, itemCount(count)), "CUDA, scan");
}

__global__ void probe() {}

std::size_t bytes_to_device = 0;
std::size_t bytes_to_host = 0;

}  // namespace

std::string openDevice() {
  int driver = 0;  // stays 0 where none is installed, which cudaGetDeviceCount would call too old
  check(cudaDriverGetVersion(&driver), "CUDA");
  if (driver == 0) throw Error(ErrorKind::device, "CUDA", "no driver");
  int count = 0;
  check(cudaGetDeviceCount(&count), "CUDA");
  if (count == 0) throw Error(ErrorKind::device, "CUDA", "no device");
  check(cudaSetDevice(0), "CUDA");
  cudaDeviceProp properties;
  check(cudaGetDeviceProperties(&properties, 0), "CUDA");
  const std::string name = std::string("CUDA, ") + properties.name + ", compute capability " +
                           std::to_string(properties.major) + "." + std::to_string(properties.minor) +
                           ", driver for CUDA " + std::to_string(driver / 1000) + "." +
                           std::to_string(driver % 1000 / 10);
  probe<<<1, 1>>>();  // "no kernel image" is only known from a launch
  checkLaunch(name.c_str());
  return name;
}

void checkLaunch(const char* what) { check(cudaGetLastError(), std::string("CUDA, ") + what); }

DeviceMemory deviceMemory() {
  DeviceMemory memory{};
  check(cudaMemGetInfo(&memory.free, &memory.total), "CUDA");
  return memory;
}

void* allocate(std::size_t bytes) {
  void* memory = nullptr;
  if (bytes == 0) return memory;
  const cudaError_t status = cudaMalloc(&memory, bytes);
  if (status == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    const auto [free, total] = deviceMemory();
    throw Error(ErrorKind::device, "CUDA",
                "out of device memory (expected " + megabytes(bytes) + ", found " + megabytes(free) + " free of " +
                    megabytes(total) + "): train fewer Gaussians or texels, smaller pictures, or with --device cpu");
  }
  check(status, "CUDA");
  return memory;
}

void release(void* memory) noexcept { cudaFree(memory); }

void copyToDevice(void* to, const void* from, std::size_t bytes) {
  bytes_to_device += bytes;
  if (bytes > 0) check(cudaMemcpy(to, from, bytes, cudaMemcpyHostToDevice), "CUDA, copy to the device");
}
std::size_t bytesToDevice() { return bytes_to_device; }
std::size_t bytesToHost() { return bytes_to_host; }
void copyToHost(void* to, const void* from, std::size_t bytes) {
  bytes_to_host += bytes;
  if (bytes > 0) check(cudaMemcpy(to, from, bytes, cudaMemcpyDeviceToHost), "CUDA, copy to the host");
}
void copyOnDevice(void* to, const void* from, std::size_t bytes) {
  if (bytes > 0) check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToDevice), "CUDA, copy");
}
void fillZero(void* memory, std::size_t bytes) {
  if (bytes > 0) check(cudaMemsetAsync(memory, 0, bytes), "CUDA, fill");
}

void Primitives::sortPairs(const std::uint32_t* keys, std::uint32_t* sorted_keys, const std::uint32_t* values,
                           std::uint32_t* sorted_values, std::size_t count, int bits) {
  if (count == 0) return;
  const LaunchTimer timer("sort");
  std::size_t bytes = 0;
  check(cub::DeviceRadixSort::SortPairs(nullptr, bytes, keys, sorted_keys, values, sorted_values, itemCount(count), 0,
                                        bits),
        "CUDA, sort");
  scratch_.resizeExactly(bytes);
  check(cub::DeviceRadixSort::SortPairs(scratch_.data(), bytes, keys, sorted_keys, values, sorted_values,
                                        itemCount(count), 0, bits),
        "CUDA, sort");
}

void Primitives::exclusiveSum(const std::uint32_t* from, std::uint32_t* to, std::size_t count) {
  scan(from, to, count, scratch_);
}
void Primitives::exclusiveSum(const std::uint64_t* from, std::uint64_t* to, std::size_t count) {
  scan(from, to, count, scratch_);
}

}  // namespace tg::cuda
