// SPDX-License-Identifier: Apache-2.0
// What cuda_check.h finds in kernels that are wrong on purpose, and what it lets pass in those that are right.
#include "support/cuda_check.h"

#include <stdexcept>
#include <string>

#include "support/catch.h"
#include "training/cuda/device.h"
#include "training/cuda/memory.h"

using namespace tg;
using namespace tg::cuda;

namespace {

struct Words {
  unsigned values[kThreads];
};

// Each thread reads what another wrote, with what is between.
enum class Between { nothing, shuffle, vote, warpBarrier, blockBarrier };
TG_KERNEL exchangeKernel(Between between, unsigned distance, unsigned* out) {
  TG_BLOCK_SHARED(Words, shared);
  shared.values[threadIdx.x] = 0;
  __syncthreads();
  shared.values[threadIdx.x] = threadIdx.x;
  if (between == Between::shuffle) __shfl_xor_sync(kAllLanes, 1, 1);
  if (between == Between::vote) __any_sync(kAllLanes, 1);
  if (between == Between::warpBarrier) __syncwarp();
  if (between == Between::blockBarrier) __syncthreads();
  out[itemIndex()] = shared.values[(threadIdx.x + distance) % kThreads];
}
// Neighbours in a warp trade places: distance 1 leaves the warp for one lane, so they pair up.
TG_KERNEL pairKernel(Between between, unsigned* out) {
  TG_BLOCK_SHARED(Words, shared);
  shared.values[threadIdx.x] = 0;
  __syncthreads();
  shared.values[threadIdx.x] = threadIdx.x;
  if (between == Between::shuffle) __shfl_xor_sync(kAllLanes, 1, 1);
  if (between == Between::warpBarrier) __syncwarp();
  out[itemIndex()] = shared.values[threadIdx.x ^ 1u];
}
// The second half writes what the first has read, or not.
TG_KERNEL readThenWriteKernel(bool barrier, unsigned* word, unsigned* out) {
  if (threadIdx.x != kThreads - 1) out[threadIdx.x] = *word;
  if (barrier) __syncthreads();
  if (threadIdx.x == kThreads - 1) *word = 7;
}
TG_KERNEL oneWordKernel(unsigned* word, bool atomic) {
  if (threadIdx.x != 0) return;
  if (atomic) {
    atomicAdd(word, 1u);
  } else {
    *word = 1;
  }
}
TG_KERNEL resetThenCountKernel(bool barrier, unsigned* out) {
  TG_BLOCK_SHARED(unsigned, count);
  if (threadIdx.x == 0) count = 0;
  if (barrier) __syncthreads();
  atomicAdd(&count, 1u);
  __syncthreads();
  out[itemIndex()] = count;
}
TG_KERNEL bytesKernel(std::uint8_t* bytes, unsigned divisor) { bytes[itemIndex() / divisor] = 1; }
TG_KERNEL readKernel(const unsigned* from, std::size_t at, unsigned* out) {
  if (threadIdx.x == 0) *out = from[at];
}
TG_KERNEL readAtByteKernel(const std::uint8_t* from, std::size_t at, unsigned* out) {
  if (threadIdx.x == 0) *out = *reinterpret_cast<const unsigned*>(from + at);
}
TG_KERNEL unsetSharedKernel(unsigned* out) {
  TG_BLOCK_SHARED(Words, shared);
  if (threadIdx.x < 32) shared.values[threadIdx.x] = 1;
  __syncthreads();
  out[itemIndex()] = shared.values[threadIdx.x / 8];
  if (threadIdx.x == 0) out[0] = shared.values[32];
}

// What a launch is found to do wrong; empty: nothing.
template <typename Launch>
std::string findingOf(const Launch& launch) {
  try {
    launch();
  } catch (const std::logic_error& error) {
    return error.what();
  }
  return {};
}
bool races(const std::string& finding) { return finding.find("race: ") != std::string::npos; }

Buffer<unsigned> zeros(std::size_t count) {
  Buffer<unsigned> buffer;
  buffer.resize(count);
  buffer.zero();
  return buffer;
}

}  // namespace

TEST_CASE("checked kernels race where no barrier is between two warps", "[checked]") {
  const auto out = zeros(2 * kThreads);
  for (const Between between : {Between::nothing, Between::shuffle, Between::vote, Between::warpBarrier}) {
    CHECK(races(findingOf([&] { launch("exchange", exchangeKernel, 2, between, 128u, out.data()); })));
  }
  CHECK(findingOf([&] { launch("exchange", exchangeKernel, 2, Between::blockBarrier, 128u, out.data()); }).empty());
  CHECK(findingOf([&] { launch("exchange", exchangeKernel, 2, Between::nothing, 0u, out.data()); }).empty());
}

TEST_CASE("checked kernels race where a shuffle stands for __syncwarp", "[checked]") {
  const auto out = zeros(kThreads);
  CHECK(races(findingOf([&] { launch("pairs", pairKernel, 1, Between::nothing, out.data()); })));
  CHECK(races(findingOf([&] { launch("pairs", pairKernel, 1, Between::shuffle, out.data()); })));
  CHECK(findingOf([&] { launch("pairs", pairKernel, 1, Between::warpBarrier, out.data()); }).empty());
}

TEST_CASE("checked kernels race where one thread writes what others have read, in any order", "[checked]") {
  const auto word = zeros(1), out = zeros(kThreads);
  for (const Schedule schedule : {Schedule::forward, Schedule::backward, Schedule::scrambled}) {
    setSchedule(schedule, 5);
    CHECK(races(findingOf([&] { launch("write", readThenWriteKernel, 1, false, word.data(), out.data()); })));
    CHECK(findingOf([&] { launch("write", readThenWriteKernel, 1, true, word.data(), out.data()); }).empty());
  }
  setSchedule(Schedule::forward);
}

TEST_CASE("checked kernels race where two blocks write one word, but not by atomics or in two launches", "[checked]") {
  const auto word = zeros(1);
  CHECK(races(findingOf([&] { launch("word", oneWordKernel, 2, word.data(), false); })));
  CHECK(findingOf([&] { launch("word", oneWordKernel, 2, word.data(), true); }).empty());
  CHECK(findingOf([&] {
          launch("word", oneWordKernel, 1, word.data(), false);
          launch("word", oneWordKernel, 1, word.data(), true);
          launch("word", oneWordKernel, 1, word.data(), false);
        }).empty());
}

TEST_CASE("checked kernels race where an atomic meets a plain write", "[checked]") {
  const auto out = zeros(kThreads);
  CHECK(races(findingOf([&] { launch("count", resetThenCountKernel, 1, false, out.data()); })));
  CHECK(findingOf([&] { launch("count", resetThenCountKernel, 1, true, out.data()); }).empty());
}

TEST_CASE("checked kernels race over bytes, not over words that hold them", "[checked]") {
  Buffer<std::uint8_t> bytes;
  bytes.resize(2 * kThreads);
  CHECK(findingOf([&] { launch("bytes", bytesKernel, 2, bytes.data(), 1u); }).empty());
  CHECK(races(findingOf([&] { launch("bytes", bytesKernel, 2, bytes.data(), 2u); })));
}

TEST_CASE("checked kernels may not leave the device's memory, nor read what nothing wrote", "[checked]") {
  const auto out = zeros(kThreads);
  const auto contains = [](const std::string& finding, const char* what) {
    INFO(finding);
    return finding.find(what) != std::string::npos;
  };
  Buffer<unsigned> some;
  some.resize(8);
  const unsigned host[2] = {1, 2};
  copyToDevice(some.data(), host, sizeof(host));
  const auto at = [&](std::size_t index) {
    return findingOf(
        [&] { launch("read", readKernel, 1, static_cast<const unsigned*>(some.data()), index, out.data()); });
  };
  CHECK(at(1).empty());
  CHECK(contains(at(2), "not initialised"));
  CHECK(contains(at(8), "not the device's memory"));
  CHECK(contains(findingOf([&] { launch("read", readKernel, 1, host, std::size_t{0}, out.data()); }),
                 "not the device's memory"));
  Buffer<std::uint8_t> bytes;
  bytes.resize(9);
  bytes.zero();
  const auto byte = [&](std::size_t index) {
    return findingOf([&] {
      launch("read", readAtByteKernel, 1, static_cast<const std::uint8_t*>(bytes.data()), index, out.data());
    });
  };
  CHECK(byte(4).empty());
  CHECK(contains(byte(5), "misaligned"));
  CHECK(contains(byte(8), "out of bounds"));
  CHECK(contains(findingOf([&] { launch("shared", unsetSharedKernel, 1, out.data()); }), "not initialised"));
  unsigned all[8];
  CHECK(contains(findingOf([&] { some.download(all); }), "which nothing wrote"));
}
