// SPDX-License-Identifier: Apache-2.0
// Fibers start by makecontext and switch by _setjmp / _longjmp, which save no signal mask: a switch is some ten
// nanoseconds instead of two system calls. AddressSanitizer is told of them; what watched over the local variables of
// waiting threads, it forgets at a jump.
#include "cuda_host.h"

#include <ucontext.h>
#include <csetjmp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <limits>
#include <memory>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "training/cuda/device.h"
#include "training/cuda/memory.h"
#include "core/system/random.h"
#include "sanitizers.h"

#if TG_ADDRESS_SANITIZER
#include <sanitizer/common_interface_defs.h>
#endif

namespace tg::cuda {
namespace {

constexpr std::size_t kStack = 256 * 1024;
constexpr unsigned kWarps = kThreads / kWarp;
constexpr std::size_t kCanary = 64;  // bytes before and after every allocation
constexpr unsigned char kCanaryByte = 0xc5;

struct Fiber {
  ucontext_t context;
  std::jmp_buf resume;
  void* fake_stack = nullptr;  // AddressSanitizer's
  std::unique_ptr<char[]> stack;
  bool started = false;
  bool done = false;
  const std::uint64_t* waits_for = nullptr;  // a generation that must leave `seen`
  std::uint64_t seen = 0;
};

// Threads that meet. Values of two generations are kept: nobody can be two ahead.
enum class WarpOperation { shuffle, vote, match, barrier };
struct Warp {
  std::uint64_t generation = 0;
  unsigned arrived = 0;
  WarpOperation operation = WarpOperation::shuffle;
  std::array<std::array<std::uint64_t, kWarp>, 2> values;
};
struct Barrier {
  std::uint64_t generation = 0;
  unsigned arrived = 0;
  std::array<int, 2> count{};
};

Schedule schedule = Schedule::forward;
Random order_random(0);
std::size_t launches = 0;
std::array<Fiber, kThreads> fibers;
std::array<Warp, kWarps> warps;
Barrier barrier;
std::jmp_buf scheduler;
unsigned running = 0;
void (*body)(const void*) = nullptr;
const void* body_of = nullptr;
std::vector<char> shared;
std::string failure;
std::size_t bytes_to_device = 0;
std::size_t bytes_to_host = 0;
std::size_t allocated_bytes = 0;
std::size_t peak_bytes = 0;
std::size_t free_memory = std::size_t{1} << 30;

#if TG_ADDRESS_SANITIZER
void* scheduler_fake_stack = nullptr;
const void* scheduler_stack = nullptr;
std::size_t scheduler_stack_bytes = 0;

void leaveScheduler() { __sanitizer_start_switch_fiber(&scheduler_fake_stack, fibers[running].stack.get(), kStack); }
void enterScheduler() { __sanitizer_finish_switch_fiber(scheduler_fake_stack, nullptr, nullptr); }
void leaveFiber() {
  __sanitizer_start_switch_fiber(&fibers[running].fake_stack, scheduler_stack, scheduler_stack_bytes);
}
void enterFiber(void* fake_stack) {
  __sanitizer_finish_switch_fiber(fake_stack, &scheduler_stack, &scheduler_stack_bytes);
}
#else
void leaveScheduler() {}
void enterScheduler() {}
void leaveFiber() {}
void enterFiber(void*) {}
#endif

void pause() {
  leaveFiber();
  if (_setjmp(fibers[running].resume) == 0) _longjmp(scheduler, 1);
  enterFiber(fibers[running].fake_stack);
}

void fiberMain() {
  enterFiber(nullptr);
  for (;;) {
    body(body_of);
    fibers[running].done = true;
    pause();
  }
}

void resume(unsigned thread) {
  Fiber& fiber = fibers[thread];
  running = thread;
  threadIdx = {thread, 0, 0};
  if (!fiber.stack) fiber.stack = std::make_unique<char[]>(kStack);
  check::runThread(thread, fiber.stack.get(), kStack);
  leaveScheduler();
  if (_setjmp(scheduler) != 0) {
    enterScheduler();
    return;
  }
  if (fiber.started) _longjmp(fiber.resume, 1);
  fiber.started = true;
  getcontext(&fiber.context);
  fiber.context.uc_stack = {fiber.stack.get(), 0, kStack};
  fiber.context.uc_link = nullptr;
  makecontext(&fiber.context, fiberMain, 0);
  setcontext(&fiber.context);
}

void waitFor(const std::uint64_t& generation, std::uint64_t seen) {
  fibers[running].waits_for = &generation;
  fibers[running].seen = seen;
  while (generation == seen) pause();
  fibers[running].waits_for = nullptr;
}

// What all lanes brought; every lane may read it until its next call.
const std::uint64_t* exchangeInWarp(WarpOperation operation, unsigned mask, std::uint64_t value) {
  Warp& warp = warps[running / kWarp];
  const std::uint64_t generation = warp.generation;
  if (mask != kAllLanes) failure = "a warp operation for some lanes alone, which this host does not know";
  if (warp.arrived == 0) warp.operation = operation;
  if (warp.operation != operation) failure = "lanes of a warp meet in different operations";
  auto& values = warp.values[generation % 2];
  values[running % kWarp] = value;
  if (++warp.arrived == kWarp) {
    warp.arrived = 0;
    ++warp.generation;
    if (operation == WarpOperation::barrier) check::warpBarrier(running / kWarp);
  } else {
    waitFor(warp.generation, generation);
  }
  return values.data();
}

template <typename Order>
void arrange(Order& order) {
  std::iota(order.begin(), order.end(), typename Order::value_type{0});
  if (schedule == Schedule::backward) std::reverse(order.begin(), order.end());
  if (schedule == Schedule::scrambled) order_random.shuffle(order);
}

// The fibers stay where they are, for good: the next kernel gets new ones.
[[noreturn]] void fail(const char* name, const std::string& what) {
  for (Fiber& fiber : fibers) fiber.started = false;
  check::endLaunch();
  throw std::logic_error(std::string(name) + ": " + what);
}

void runBlock(const char* name) {
  std::fill(shared.begin(), shared.end(), static_cast<char>(0xff));
  barrier = {};
  for (Warp& warp : warps) warp = {};
  for (Fiber& fiber : fibers) fiber.done = false, fiber.waits_for = nullptr;
  // One warp after the other runs until all its threads wait for others: their stacks stay in the cache.
  std::array<unsigned, kWarps> warp_order;
  std::array<unsigned, kWarp> lane_order;
  for (unsigned left = kThreads; left > 0;) {
    const unsigned left_before = left;
    const std::uint64_t barrier_before = barrier.generation;
    arrange(warp_order);
    for (const unsigned warp : warp_order) {
      for (bool progress = true; progress;) {
        progress = false;
        arrange(lane_order);
        for (const unsigned lane : lane_order) {
          Fiber& fiber = fibers[warp * kWarp + lane];
          if (fiber.done || (fiber.waits_for && *fiber.waits_for == fiber.seen)) continue;
          resume(warp * kWarp + lane);
          progress = true;
          left -= fiber.done;
          if (failure.empty()) failure = check::takeFinding();
          if (!failure.empty()) fail(name, std::exchange(failure, {}));
        }
      }
    }
    if (left == left_before && barrier.generation == barrier_before) {
      fail(name, std::to_string(left) + " threads wait for others that ended or wait elsewhere");
    }
  }
}

}  // namespace

void setSchedule(Schedule s, std::uint64_t seed) {
  schedule = s;
  order_random = Random(seed);
}

std::size_t launchCount() { return launches; }

void runBlocks(const char* name, std::size_t blocks, void (*kernel)(const void*), const void* of) {
  ++launches;
  body = kernel;
  body_of = of;
  check::beginLaunch();
  gridDim = {static_cast<unsigned>(blocks), 1, 1};
  std::vector<unsigned> order(blocks);
  arrange(order);
  for (const unsigned block : order) {
    blockIdx = {block, 0, 0};
    check::beginBlock(block);
    runBlock(name);
  }
  check::endLaunch();
}

void* sharedBytes(std::size_t bytes) {
  if (shared.size() < bytes) shared.assign(48 * 1024, static_cast<char>(0xff));
  check::useShared(shared.data(), bytes);
  return shared.data();
}

std::uint64_t valueOfLane(unsigned mask, std::uint64_t value, unsigned lane) {
  return exchangeInWarp(WarpOperation::shuffle, mask, value)[lane];
}
unsigned lanesWith(unsigned mask, bool predicate) {
  const std::uint64_t* lanes = exchangeInWarp(WarpOperation::vote, mask, predicate);
  unsigned bits = 0;
  for (unsigned lane = 0; lane < kWarp; ++lane) bits |= static_cast<unsigned>(lanes[lane]) << lane;
  return bits;
}
unsigned lanesWithMine(unsigned mask, std::uint64_t value) {
  const std::uint64_t* lanes = exchangeInWarp(WarpOperation::match, mask, value);
  unsigned bits = 0;
  for (unsigned lane = 0; lane < kWarp; ++lane) bits |= static_cast<unsigned>(lanes[lane] == value) << lane;
  return bits;
}
void warpBarrier(unsigned mask) { exchangeInWarp(WarpOperation::barrier, mask, 0); }

int blockBarrier(int value) {
  const std::uint64_t generation = barrier.generation;
  int& count = barrier.count[generation % 2];
  if (barrier.arrived == 0) count = 0;
  count += value != 0;
  if (++barrier.arrived == kThreads) {
    barrier.arrived = 0;
    ++barrier.generation;
    check::blockBarrier();
  } else {
    waitFor(barrier.generation, generation);
  }
  return count;
}

// ---- memory.h

std::string openDevice() { return "host"; }

void setFreeMemory(std::size_t bytes) { free_memory = bytes; }
std::size_t allocatedBytes() { return allocated_bytes; }
std::size_t takePeakBytes() { return std::exchange(peak_bytes, allocated_bytes); }
DeviceMemory deviceMemory() { return {free_memory, std::size_t{1} << 30}; }

void* allocate(std::size_t bytes) {
  if (bytes == 0) return nullptr;
  auto* memory = static_cast<unsigned char*>(std::malloc(bytes + 2 * kCanary));
  if (!memory) throw Error(ErrorKind::device, "host", "out of memory");
  allocated_bytes += bytes;
  peak_bytes = std::max(peak_bytes, allocated_bytes);
  std::memset(memory, kCanaryByte, kCanary);
  std::memcpy(memory, &bytes, sizeof(bytes));
  std::memset(memory + kCanary, 0xff, bytes);  // no float holds a number
  std::memset(memory + kCanary + bytes, kCanaryByte, kCanary);
  check::allocated(memory + kCanary, bytes);
  return memory + kCanary;
}

void release(void* memory) noexcept {
  if (!memory) return;
  check::released(memory);
  auto* first = static_cast<unsigned char*>(memory) - kCanary;
  std::size_t bytes = 0;
  std::memcpy(&bytes, first, sizeof(bytes));
  allocated_bytes -= bytes;
  const auto intact = [](const unsigned char* from, const unsigned char* to) {
    return std::all_of(from, to, [](unsigned char c) { return c == kCanaryByte; });
  };
  if (!intact(first + sizeof(bytes), first + kCanary) ||
      !intact(first + kCanary + bytes, first + 2 * kCanary + bytes)) {
    std::fputs("a kernel wrote beside its buffer\n", stderr);
    std::abort();
  }
  std::free(first);
}

void copyToDevice(void* to, const void* from, std::size_t bytes) {
  bytes_to_device += bytes;
  check::wrote(to, bytes);
  if (bytes > 0) std::memcpy(to, from, bytes);
}
std::size_t bytesToDevice() { return bytes_to_device; }
std::size_t bytesToHost() { return bytes_to_host; }
void copyToHost(void* to, const void* from, std::size_t bytes) {
  bytes_to_host += bytes;
  check::reads(from, bytes);
  if (bytes > 0) std::memcpy(to, from, bytes);
}
void copyOnDevice(void* to, const void* from, std::size_t bytes) {
  check::reads(from, bytes);
  check::wrote(to, bytes);
  if (bytes > 0) std::memcpy(to, from, bytes);
}
void fillZero(void* memory, std::size_t bytes) {
  check::wrote(memory, bytes);
  if (bytes > 0) std::memset(memory, 0, bytes);
}

void Primitives::sortPairs(const std::uint32_t* keys, std::uint32_t* sorted_keys, const std::uint32_t* values,
                           std::uint32_t* sorted_values, std::size_t count, int bits) {
  for (const std::uint32_t* from : {keys, values}) check::reads(from, 4 * count);
  for (const std::uint32_t* to : {sorted_keys, sorted_values}) check::wrote(to, 4 * count);
  const std::uint32_t mask = bits >= 32 ? ~0u : (1u << bits) - 1;
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return (keys[a] & mask) < (keys[b] & mask); });
  for (std::size_t i = 0; i < count; ++i) {
    sorted_keys[i] = keys[order[i]];
    sorted_values[i] = values[order[i]];
  }
}

namespace {

template <typename T>
void scan(const T* from, T* to, std::size_t count) {
  check::reads(from, sizeof(T) * count);
  check::wrote(to, sizeof(T) * count);
  std::exclusive_scan(from, from + count, to, T{0});
}

}  // namespace

void Primitives::exclusiveSum(const std::uint32_t* from, std::uint32_t* to, std::size_t count) {
  scan(from, to, count);
}
void Primitives::exclusiveSum(const std::uint64_t* from, std::uint64_t* to, std::size_t count) {
  scan(from, to, count);
}

// ---- timing.h

namespace {

using Clock = std::chrono::steady_clock;
bool timing = false;
Clock::time_point launch_start;
std::vector<KernelTime> times;
std::size_t launched = 0;  // of `times`

}  // namespace

LaunchTimer::LaunchTimer(const char* name) {
  if (!timing) return;
  auto at = std::find_if(times.begin(), times.end(), [&](const KernelTime& t) { return t.name == name; });
  if (at == times.end()) at = times.insert(times.end(), {name, 0, 0.0});
  launched = static_cast<std::size_t>(at - times.begin());
  launch_start = Clock::now();
}
LaunchTimer::~LaunchTimer() {
  if (!timing) return;
  ++times[launched].launches;
  times[launched].milliseconds += std::chrono::duration<double, std::milli>(Clock::now() - launch_start).count();
}

void timeKernels(bool on) {
  timing = on;
  if (on) times.clear();
}

std::vector<KernelTime> kernelTimes() { return times; }

}  // namespace tg::cuda
