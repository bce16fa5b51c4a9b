// SPDX-License-Identifier: Apache-2.0
// Kernels run on the default stream. The copy's stream does not wait for it by itself: events order the two.
#include "training/cuda/upload.h"

#include <cuda_runtime.h>

#include <cstring>
#include <string>

#include "core/system/error.h"
#include "training/cuda/memory.h"

namespace tg::cuda {
namespace {

void check(cudaError_t status) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // clears it
  throw Error(ErrorKind::device, "CUDA, copy beside the kernels", cudaGetErrorString(status));
}

}  // namespace

struct StreamedBuffer::State {
  cudaStream_t stream = nullptr;
  cudaEvent_t copied = nullptr, released = nullptr;
  std::uint8_t* staging = nullptr;
  std::size_t staging_bytes = 0;
  Buffer<std::uint8_t> buffer;

  State() {
    check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking));
    check(cudaEventCreateWithFlags(&copied, cudaEventDisableTiming));
    check(cudaEventCreateWithFlags(&released, cudaEventDisableTiming));
  }
  ~State() {
    if (stream) cudaStreamSynchronize(stream);
    if (released) cudaEventDestroy(released);
    if (copied) cudaEventDestroy(copied);
    if (stream) cudaStreamDestroy(stream);
    if (staging) cudaFreeHost(staging);
  }
  State& operator=(State&&) = delete;

  void reserve(std::size_t bytes) {
    if (bytes <= staging_bytes) return;
    if (staging) cudaFreeHost(staging);
    staging = nullptr;
    staging_bytes = 0;
    check(cudaHostAlloc(reinterpret_cast<void**>(&staging), bytes, cudaHostAllocDefault));
    staging_bytes = bytes;
  }
};

StreamedBuffer::StreamedBuffer() : state_(std::make_unique<State>()) {}
StreamedBuffer::~StreamedBuffer() = default;

void StreamedBuffer::begin(std::span<const std::uint8_t> first, std::span<const std::uint8_t> second) {
  State& s = *state_;
  const std::size_t bytes = first.size() + second.size();
  check(cudaEventSynchronize(s.copied));  // the staging memory is free; at once where nothing was recorded
  s.reserve(bytes);
  std::memcpy(s.staging, first.data(), first.size());
  if (!second.empty()) std::memcpy(s.staging + first.size(), second.data(), second.size());
  s.buffer.resize(bytes);  // cudaFree() and cudaMalloc() wait for whatever still reads the old one
  check(cudaStreamWaitEvent(s.stream, s.released, 0));
  check(cudaMemcpyAsync(s.buffer.data(), s.staging, bytes, cudaMemcpyHostToDevice, s.stream));
  check(cudaEventRecord(s.copied, s.stream));
}

void StreamedBuffer::acquire() { check(cudaStreamWaitEvent(nullptr, state_->copied, 0)); }
void StreamedBuffer::release() { check(cudaEventRecord(state_->released, nullptr)); }
const std::uint8_t* StreamedBuffer::data() const { return state_->buffer.data(); }

}  // namespace tg::cuda
