// SPDX-License-Identifier: Apache-2.0
// A buffer of the device that is filled beside the kernels. upload.cu implements it with the CUDA runtime,
// tests/support/cuda_upload_host.cpp on the host.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace tg::cuda {

// Bytes go through page-locked memory of the host, on a stream of their own. In turns: begin(), acquire(), launches of
// kernels that read data(), release(). Everything throws Error(device).
class StreamedBuffer {
 public:
  StreamedBuffer();
  ~StreamedBuffer();
  StreamedBuffer& operator=(StreamedBuffer&&) = delete;

  // Starts to copy both parts, one after the other; they may change when this returns, which is when the copy begun
  // before is done. The copy itself waits for the kernels before the last release().
  void begin(std::span<const std::uint8_t> first, std::span<const std::uint8_t> second);
  // Kernels launched from here on wait for the copy.
  void acquire();
  // Kernels launched from here on do not read it.
  void release();
  const std::uint8_t* data() const;

 private:
  struct State;
  const std::unique_ptr<State> state_;
};

}  // namespace tg::cuda
