// SPDX-License-Identifier: Apache-2.0
// What the CUDA trainer asks of a device, for code that no CUDA compiler reads: memory, copies, sort and scan.
// device.cu implements it with the CUDA runtime and cub, tests/support/cuda_host.cpp in host memory.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/system/assert.h"

namespace tg::cuda {

// Everything here throws Error(device) saying what failed and why.

// Takes the first device, whose name it returns. Errors: no driver, a driver too old, no device, one that this program
// holds no code for.
std::string openDevice();

struct DeviceMemory {
  std::size_t free, total;  // [bytes]
};
DeviceMemory deviceMemory();

void* allocate(std::size_t bytes);
void release(void* memory) noexcept;
void copyToDevice(void* to, const void* from, std::size_t bytes);
void copyToHost(void* to, const void* from, std::size_t bytes);  // waits for all kernels before it
void copyOnDevice(void* to, const void* from, std::size_t bytes);
std::size_t bytesToDevice();  // copied by copyToDevice() so far
std::size_t bytesToHost();    // copied by copyToHost() so far
void fillZero(void* memory, std::size_t bytes);

// Memory of the device, or of nothing.
template <typename T>
class Buffer {
 public:
  Buffer() = default;
  ~Buffer() { release(data_); }
  Buffer(Buffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }

  // Room for `size` entries; what it held is lost when it grows, from the second time on by a quarter more than needed.
  void resize(std::size_t size) {
    if (size > capacity_ && data_ != nullptr) reserve(size + size / 4);
    resizeExactly(size);
  }
  // The same, with room for no more than needed.
  void resizeExactly(std::size_t size) {
    reserve(size);
    size_ = size;
  }
  void zero() { fillZero(data_, size_ * sizeof(T)); }
  // Of an array-like in host memory, whose entries may hold several T.
  template <typename Range>
  void upload(const Range& from) {
    const std::span all(from);
    static_assert(sizeof(all[0]) % sizeof(T) == 0);
    resize(all.size() * (sizeof(all[0]) / sizeof(T)));
    copyToDevice(data_, all.data(), all.size_bytes());
  }
  // `to` must have the buffer's size in bytes.
  template <typename Range>
  void download(Range&& to) const {
    TG_ASSERT(std::span(to).size_bytes() == size_ * sizeof(T), "the target has the buffer's size");
    const std::span all(to);
    copyToHost(all.data(), data_, all.size_bytes());
  }
  // Resizes the vector, whose entries may hold several T.
  template <typename Entry>
  void downloadAll(std::vector<Entry>& to) const {
    static_assert(sizeof(Entry) % sizeof(T) == 0);
    to.resize(size_ / (sizeof(Entry) / sizeof(T)));
    download(to);
  }
  // The entry at `index`. Waits for all kernels before.
  T read(std::size_t index) const {
    TG_ASSERT(index < size_, "the buffer has this entry");
    T value;
    copyToHost(&value, data_ + index, sizeof(T));
    return value;
  }
  T* data() const { return data_; }
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return capacity_ * sizeof(T); }

 private:
  void reserve(std::size_t room) {
    if (room <= capacity_) return;
    release(std::exchange(data_, nullptr));
    size_ = capacity_ = 0;
    data_ = static_cast<T*>(allocate(room * sizeof(T)));
    capacity_ = room;
  }

  T* data_ = nullptr;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

// A stable sort of (key, value) pairs by the lowest `bits` bits of the keys, and exclusive sums. They keep scratch
// space between calls.
class Primitives {
 public:
  void sortPairs(const std::uint32_t* keys, std::uint32_t* sorted_keys, const std::uint32_t* values,
                 std::uint32_t* sorted_values, std::size_t count, int bits);
  void exclusiveSum(const std::uint32_t* from, std::uint32_t* to, std::size_t count);
  void exclusiveSum(const std::uint64_t* from, std::uint64_t* to, std::size_t count);

 private:
  Buffer<std::byte> scratch_;
};

}  // namespace tg::cuda
