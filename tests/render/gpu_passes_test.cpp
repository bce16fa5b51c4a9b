// SPDX-License-Identifier: Apache-2.0
// Prefix sum, radix sort and tile ranges, each alone on data of its own.
#define CATCH_CONFIG_EXTERNAL_INTERFACES  // version 2: listeners
#include <algorithm>
#include <cstring>
#include <functional>
#include <numeric>
#include <random>

#include "gpu_device.h"
#include "render/gpu/frame.h"
#include "render/gpu/passes.h"
#include "shared/layout.h"
#include "shared/limits.h"
#include "support/catch.h"

using namespace tg;
using namespace tg::test;

namespace {

using Numbers = std::vector<std::uint32_t>;

// Data on the device and passes over it, without a frame around them.
class PassBench {
  std::unique_ptr<GpuDevice> owned_;

 public:
  PassBench()
      : owned_(makePassDevice()),
        device(*owned_),
        counters(device.makeBuffer("counters", sizeof(Counters))),
        scratch(device) {}

  // The bytes of `numbers`, `room` of them at least.
  BufferPtr put(const Numbers& numbers, std::size_t room = 0) {
    const std::size_t bytes = numbers.size() * 4;
    BufferPtr buffer = device.makeBuffer("test", std::max(bytes, room * 4));
    device.upload(buffer, bytes, 4, [&](std::uint64_t first, std::span<std::byte> out) {
      std::memcpy(out.data(), reinterpret_cast<const std::byte*>(numbers.data()) + first, out.size());
    });
    return buffer;
  }
  Numbers get(const BufferPtr& buffer, std::size_t count) {
    Numbers numbers(count);
    device.download(buffer, std::as_writable_bytes(std::span(numbers)));
    return numbers;
  }
  BufferPtr room(std::size_t count) { return device.makeBuffer("room", count * 4); }

  // Runs the passes on `count` items of kind `work`; returns what they left in Counters.
  Counters run(std::uint32_t work, std::uint32_t count, const std::function<void(PassList&)>& build) {
    Counters first{};
    first.work[work] = makeWork(count, count);
    PassList list(counters, first);
    build(list);
    const std::unique_ptr<PassProgram> program = device.prepare(list);
    device.run(*program, {});
    return program->counters();
  }

  GpuDevice& device;
  BufferPtr counters;
  Scratch scratch;
};

#if __has_include(<catch2/catch_all.hpp>)
using Listener = Catch::EventListenerBase;
#else
using Listener = Catch::TestEventListenerBase;
#endif
class EndOfRun : public Listener {
 public:
  using Listener::Listener;
  void testRunEnded(const Catch::TestRunStats& stats) override {
    for (; !endings().empty(); endings().pop_back()) endings().back()();
    Listener::testRunEnded(stats);
  }
};
CATCH_REGISTER_LISTENER(EndOfRun)

PassBench& bench() {
  static std::unique_ptr<PassBench> passes;
  if (!passes) {
    passes = std::make_unique<PassBench>();
    endings().emplace_back([] { passes.reset(); });
  }
  return *passes;
}

Numbers randomNumbers(std::size_t count, std::uint32_t most) {
  std::mt19937 random(static_cast<unsigned>(count) + most);
  Numbers numbers(count);
  for (std::uint32_t& number : numbers) number = static_cast<std::uint32_t>(random() % (most + 1u));
  return numbers;
}

}  // namespace

TEST_CASE("work is cut into at most 512 partitions that cover it", "[scan]") {
  for (const std::uint32_t count : {0u, 1u, 2048u, 2049u, 1048576u, 1048577u, 33554432u, 4294967295u}) {
    const Work work = makeWork(count, count);
    CHECK(work.partitions <= kMaxPartitions);
    CHECK(std::uint64_t{work.partitions} * work.partition_items >= count);
    CHECK((count == 0 || std::uint64_t{work.partitions - 1} * work.partition_items < count));
    CHECK(std::uint64_t{work.item_groups.x} * work.item_groups.y * kGroupSize >= count);
    CHECK(std::max(work.item_groups.x, work.item_groups.y) <= 65535u);
  }
}

TEST_CASE("where loops are bounded, no more pairs are allowed than a thread of a sort can walk over", "[sort]") {
  const GpuLimits limits{"", ~0u, ~0u, 16384};
  const std::uint32_t most = maxPairCapacity(limits, {true, true, 4});
  const Work work = makeWork(most, most);
  CHECK(work.partition_items + kDigitCount <= 65535);
  CHECK(makeWork(most + kMaxPartitions, most + kMaxPartitions).partition_items + kDigitCount > 65535);
  CHECK(maxPairCapacity(limits, {true, false, 4}) == (~0u) / 16 * 4);
  CHECK(maxPairCapacity({"", 4000, 600, 16384}, {true, true, 4}) == 600);
}

TEST_CASE("a prefix sum equals std::exclusive_scan at every size around a boundary", "[scan]") {
  // 1100000: more than 512 partitions of the smallest size.
  const std::uint32_t count =
      GENERATE(0u, 1u, 3u, 63u, 255u, 256u, 257u, 1023u, 1025u, 2047u, 2048u, 2049u, 100000u, 1100000u);
  const bool runs = GENERATE(false, true);
  const Numbers values = randomNumbers(count, 1000);
  PassBench& b = bench();
  const BufferPtr input = b.put(values);
  const BufferPtr offsets = b.room(count);
  const Counters counters = b.run(kWorkGaussians, count, [&](PassList& list) {
    addScan(list, "scan", b.scratch,
            {ScanInput::values, input, input, offsets, kWorkGaussians, kWorkVisible, /*capacity=*/500, runs});
  });
  Numbers expected(count);
  std::exclusive_scan(values.begin(), values.end(), expected.begin(), 0u);
  CHECK(b.get(offsets, count) == expected);
  const std::uint32_t total = std::accumulate(values.begin(), values.end(), 0u);
  CHECK(counters.work[kWorkVisible].total == total);
  CHECK(counters.work[kWorkVisible].count == std::min(total, 500u));
  CHECK(validationMessages() == "");
}

TEST_CASE("a prefix sum counts what is not zero, or follows an order", "[scan]") {
  const std::uint32_t count = GENERATE(4999u, 5000u);
  const bool runs = GENERATE(false, true);
  const Numbers values = randomNumbers(count, 3);
  Numbers order(count);
  std::iota(order.rbegin(), order.rend(), 0u);
  PassBench& b = bench();
  const BufferPtr input = b.put(values);
  const BufferPtr backwards = b.put(order);
  const BufferPtr counted = b.room(count);
  const BufferPtr ordered = b.room(count);
  b.run(kWorkGaussians, count, [&](PassList& list) {
    addScan(list, "scan", b.scratch,
            {ScanInput::nonZero, input, input, counted, kWorkGaussians, kWorkVisible, count, runs});
    addScan(list, "scan", b.scratch,
            {ScanInput::ordered, input, backwards, ordered, kWorkGaussians, kWorkPairs, count, runs});
  });
  Numbers expected(count);
  std::transform_exclusive_scan(values.begin(), values.end(), expected.begin(), 0u, std::plus<>{},
                                [](std::uint32_t value) { return std::min(value, 1u); });
  CHECK(b.get(counted, count) == expected);
  std::exclusive_scan(values.rbegin(), values.rend(), expected.begin(), 0u);
  CHECK(b.get(ordered, count) == expected);
  CHECK(validationMessages() == "");
}

TEST_CASE("a prefix sum beyond 32 bits stops at the largest number instead of wrapping", "[scan]") {
  const bool runs = GENERATE(false, true);
  const Numbers values(9000, 1u << 20);
  PassBench& b = bench();
  const BufferPtr input = b.put(values);
  const BufferPtr offsets = b.room(values.size());
  const Counters counters = b.run(kWorkGaussians, 9000, [&](PassList& list) {
    addScan(list, "scan", b.scratch,
            {ScanInput::values, input, input, offsets, kWorkGaussians, kWorkPairs, /*capacity=*/100, runs});
  });
  CHECK(counters.work[kWorkPairs].total == ~0u);
  CHECK(counters.work[kWorkPairs].count == 100);
  const Numbers result = b.get(offsets, values.size());
  CHECK(result[4095] == 4095u << 20);
  CHECK(std::all_of(result.begin() + 4096, result.end(), [](std::uint32_t offset) { return offset == ~0u; }));
}

TEST_CASE("the radix sort equals std::stable_sort for every size, kind of key and number of bits", "[sort][slow]") {
  const std::uint32_t count =
      GENERATE(0u, 1u, 2u, 63u, 64u, 65u, 255u, 256u, 257u, 2047u, 2048u, 2049u, 5000u, 100000u);
  const std::uint32_t bits = GENERATE(0u, 5u, 8u, 13u, 32u);
  const bool runs = GENERATE(false, true);
  enum Kind { random, equal, ascending, descending, alternating, topByte, oneOdd, kinds };
  PassBench& b = bench();
  for (int kind = 0; kind < kinds; ++kind) {
    if (count == 100000 && kind != random && bits != 13) continue;  // the rest in a second or two
    Numbers keys = randomNumbers(count, ~0u - 1u);
    for (std::uint32_t i = 0; i < count; ++i) {
      if (kind == equal) keys[i] = 0x12345678u;
      if (kind == ascending) keys[i] = i;
      if (kind == descending) keys[i] = count - i;
      if (kind == alternating) keys[i] = i % 2 ? ~0u : 0u;
      if (kind == topByte) keys[i] &= 0xFF000000u;
      if (kind == oneOdd) keys[i] = i == count / 2 ? 0u : ~0u;
      if (bits < 32) keys[i] &= (1u << bits) - 1;
    }
    Numbers numbers(count);
    std::iota(numbers.begin(), numbers.end(), 0u);
    const PingPong key_buffers{b.put(keys), b.room(count)};
    const PingPong value_buffers{b.put(numbers), b.room(count)};
    int result = 0;
    b.run(kWorkVisible, count, [&](PassList& list) {
      result = addSort(list, "sort", b.scratch, {key_buffers, value_buffers, kWorkVisible, 0, bits, runs});
    });
    Numbers order = numbers;
    std::stable_sort(order.begin(), order.end(), [&](std::uint32_t i, std::uint32_t j) { return keys[i] < keys[j]; });
    INFO("in runs " << runs << ", kind of key " << kind << ", count " << count << ", bits " << bits);
    REQUIRE(b.get(value_buffers[result], count) == order);
    Numbers sorted = keys;
    std::stable_sort(sorted.begin(), sorted.end());
    REQUIRE(b.get(key_buffers[result], count) == sorted);
  }
  CHECK(validationMessages() == "");
}

TEST_CASE("a sort of a million keys uses partitions of more than the smallest size", "[sort][slow]") {
  const bool runs = GENERATE(false, true);
  const std::uint32_t first_bit = GENERATE(0u, 16u);
  const std::uint32_t count = 1100000;
  Numbers keys = randomNumbers(count, 255);
  for (std::uint32_t& key : keys) key <<= first_bit;
  Numbers numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0u);
  PassBench& b = bench();
  const PingPong key_buffers{b.put(keys), b.room(count)};
  const PingPong value_buffers{b.put(numbers), b.room(count)};
  b.run(kWorkPairs, count, [&](PassList& list) {
    addSort(list, "sort", b.scratch, {key_buffers, value_buffers, kWorkPairs, first_bit, 8, runs});
  });
  std::stable_sort(numbers.begin(), numbers.end(), [&](std::uint32_t i, std::uint32_t j) { return keys[i] < keys[j]; });
  CHECK(b.get(value_buffers[1], count) == numbers);
}

TEST_CASE("tile ranges find every tile in more pairs than one row of groups holds") {
  const std::uint32_t per_tile = 1000;
  const std::uint32_t tiles = kMaxGroupsPerRow * kGroupSize / per_tile + 200;
  Numbers pair_tiles(std::size_t{tiles} * per_tile);
  for (std::size_t i = 0; i < pair_tiles.size(); ++i) {
    pair_tiles[i] = static_cast<std::uint32_t>(i / per_tile) * 2 << kBlockBits | static_cast<std::uint32_t>(i % 0xFFFF);
  }
  const auto count = static_cast<std::uint32_t>(pair_tiles.size());
  REQUIRE(makeWork(count, count).item_groups.y == 2);
  PassBench& b = bench();
  const BufferPtr input = b.put(pair_tiles);
  const BufferPtr ranges = b.put(Numbers(std::size_t{tiles} * 4, 0u));
  b.run(kWorkPairs, count, [&](PassList& list) {
    list.add("tile_ranges", Shader::tileRanges, {{input, Texels::r32ui}, list.counters(), ranges}, {},
             Groups::perItem(kWorkPairs));
  });
  const Numbers result = b.get(ranges, std::size_t{tiles} * 4);
  std::uint32_t wrong = 0;
  for (std::uint32_t tile = 0; tile < tiles; ++tile) {  // every second tile has none
    wrong += result[4 * tile] != tile * per_tile || result[4 * tile + 1] != (tile + 1) * per_tile;
    wrong += result[4 * tile + 2] != 0 || result[4 * tile + 3] != 0;
  }
  CHECK(wrong == 0);
  CHECK(validationMessages() == "");
}
