// SPDX-License-Identifier: Apache-2.0
// Each word has three records: who wrote it last, whose atomics it saw, who read it. A record of several threads says
// how far apart they are, not who they were: whatever then conflicts with one of them conflicts with the record.
#include "cuda_check.h"

#include <link.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "cuda_host.h"
#include "training/cuda/device.h"

namespace tg::cuda::check {
namespace {

constexpr std::size_t kWord = 4;  // [bytes]

enum class Spread : std::uint8_t { thread, warp, block, grid };
struct Record {
  std::uint32_t launch = 0;  // 0: none
  std::uint32_t block = 0, block_epoch = 0, warp_epoch = 0;
  std::uint8_t thread = 0;
  Spread spread = Spread::thread;
};
struct Cell {
  Record write, atomic, read;
};
enum class Kind { read, write, atomic };

// A piece of device memory, or the block's shared memory.
struct Region {
  std::uintptr_t begin = 0;
  std::size_t bytes = 0;
  bool shared = false;
  std::vector<std::uint8_t> written;  // [bytes]
  std::vector<Cell> words;            // made when a kernel first comes
  std::vector<Cell> single;           // [bytes], made when a kernel first accesses less than a word
};

std::map<std::uintptr_t, Region> regions;  // by begin
Region shared_region;
struct Recent {
  std::uintptr_t page = 0;
  Region* region = nullptr;
};
std::array<Recent, 256> recent;

bool running = false;
std::uint32_t launch_number = 0;
std::uint32_t block_number = 0;
std::uint32_t block_epoch = 0;
std::array<std::uint32_t, kThreads / kWarp> warp_epochs{};
unsigned thread_number = 0;
std::uintptr_t stack_begin = 0;
std::size_t stack_size = 0;
std::string finding;

struct Range {
  std::uintptr_t begin, end;
};
// Of the program and its libraries: tables of constants, which a device has, too.
const std::vector<Range>& constants() {
  static const std::vector<Range> ranges = [] {
    std::vector<Range> found;
    dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t, void* to) {
          for (int k = 0; k < info->dlpi_phnum; ++k) {
            const ElfW(Phdr)& segment = info->dlpi_phdr[k];
            const bool constant =
                segment.p_type == PT_GNU_RELRO || (segment.p_type == PT_LOAD && !(segment.p_flags & PF_W));
            const std::uintptr_t begin = info->dlpi_addr + segment.p_vaddr;
            if (constant) static_cast<std::vector<Range>*>(to)->push_back({begin, begin + segment.p_memsz});
          }
          return 0;
        },
        &found);
    return found;
  }();
  return ranges;
}

Region* findRegion(std::uintptr_t at) {
  Recent& hint = recent[at / 4096 % recent.size()];
  if (hint.region && hint.page == at / 4096 && at - hint.region->begin < hint.region->bytes) return hint.region;
  auto next = regions.upper_bound(at);
  if (next == regions.begin()) return nullptr;
  Region& region = std::prev(next)->second;
  if (at - region.begin >= region.bytes) return nullptr;
  hint = {at / 4096, &region};
  return &region;
}

// Whether all that the record stands for happens before what the running thread does now.
bool ordered(const Record& r, bool shared) {
  if (r.launch != launch_number) return true;
  if (r.block != block_number || r.spread == Spread::grid) return shared;
  if (r.block_epoch != block_epoch) return true;
  const unsigned warp = thread_number / kWarp;
  if (r.spread == Spread::block || r.thread / kWarp != warp) return false;
  if (r.warp_epoch != warp_epochs[warp]) return true;
  return r.spread == Spread::thread && r.thread == thread_number;
}

void note(Record& r, bool shared) {
  Spread spread = Spread::thread;
  if (!ordered(r, shared)) {
    if (r.block != block_number || r.spread == Spread::grid) {
      spread = Spread::grid;
    } else if (r.spread == Spread::block || r.thread / kWarp != thread_number / kWarp) {
      spread = Spread::block;
    } else {
      spread = Spread::warp;
    }
  }
  r = {launch_number,
       block_number,
       block_epoch,
       warp_epochs[thread_number / kWarp],
       static_cast<std::uint8_t>(thread_number),
       spread};
}

const char* verb(Kind kind) {
  return kind == Kind::read ? "reads" : kind == Kind::write ? "writes" : "adds atomically to";
}

std::string place(const Region& region, std::uintptr_t at) {
  return "byte " + std::to_string(at - region.begin) + " of " +
         (region.shared ? "the shared memory" : std::to_string(region.bytes) + " bytes of the device's");
}
std::string who() { return "thread " + std::to_string(thread_number) + " of block " + std::to_string(block_number); }
std::string whose(const Record& r) {
  switch (r.spread) {
    case Spread::thread:
      return "thread " + std::to_string(r.thread) + " of block " + std::to_string(r.block);
    case Spread::warp:
      return "several lanes of warp " + std::to_string(r.thread / kWarp) + " of block " + std::to_string(r.block);
    case Spread::block:
      return "several warps of block " + std::to_string(r.block);
    case Spread::grid:
      break;
  }
  return "several blocks";
}

void found(const std::string& what, const void* code) {
  if (!finding.empty()) return;
  char text[40];
  std::snprintf(text, sizeof text, " (code at %p)", code);
  finding = what + text;
}

// The cell's records against the access, and the access into the one that holds it where `keeps`.
void checkCell(Cell& cell, const Region& region, std::uintptr_t at, Kind kind, bool keeps, const void* code) {
  const auto against = [&](const Record& r, const char* did) {
    if (ordered(r, region.shared)) return;
    found("race: " + who() + " " + verb(kind) + " " + place(region, at) + ", which " + whose(r) + " " + did, code);
  };
  against(cell.write, "wrote");
  if (kind != Kind::atomic) against(cell.atomic, "added to");
  if (kind != Kind::read) against(cell.read, "read");
  if (!keeps) return;
  if (kind == Kind::read) note(cell.read, region.shared);
  if (kind == Kind::write) cell.write = {}, note(cell.write, region.shared);
  if (kind == Kind::atomic) note(cell.atomic, region.shared);
}

void checkRegion(Region& region, std::uintptr_t at, std::size_t bytes, Kind kind, const void* code) {
  const std::size_t first = at - region.begin;
  if (region.bytes - first < bytes) {
    found("out of bounds: " + who() + " " + verb(kind) + " " + std::to_string(bytes) + " bytes from " +
              place(region, at) + " on",
          code);
    return;
  }
  const auto written = region.written.begin() + static_cast<std::ptrdiff_t>(first);
  const auto end = written + static_cast<std::ptrdiff_t>(bytes);
  if (kind != Kind::write && std::find(written, end, 0) != end) {
    found("not initialised: " + who() + " " + verb(kind) + " " + std::to_string(bytes) + " bytes from " +
              place(region, at) + " on, and nothing wrote them all",
          code);
  }
  if (kind != Kind::read) std::fill(written, end, std::uint8_t{1});
  if (region.words.empty()) region.words.resize((region.bytes + kWord - 1) / kWord);
  for (std::size_t byte = first; byte < first + bytes;) {
    Cell& word = region.words[byte / kWord];
    if (byte % kWord == 0 && first + bytes - byte >= kWord) {
      checkCell(word, region, region.begin + byte, kind, true, code);
      if (!region.single.empty()) {
        for (std::size_t k = byte; k < byte + kWord; ++k) {
          checkCell(region.single[k], region, region.begin + k, kind, false, code);
        }
      }
      byte += kWord;
    } else {
      if (region.single.empty()) region.single.resize((region.bytes + kWord - 1) / kWord * kWord);
      checkCell(word, region, region.begin + byte, kind, false, code);
      checkCell(region.single[byte], region, region.begin + byte, kind, true, code);
      ++byte;
    }
  }
}

void access(const void* memory, std::size_t bytes, Kind kind, const void* code) {
  const auto at = reinterpret_cast<std::uintptr_t>(memory);
  if (!running || at - stack_begin < stack_size || bytes == 0) return;
  if (at - shared_region.begin < shared_region.bytes) {
    checkRegion(shared_region, at, bytes, kind, code);
    return;
  }
  if (memory == &threadIdx || memory == &blockIdx || memory == &gridDim) return;
  if (Region* region = findRegion(at)) {
    checkRegion(*region, at, bytes, kind, code);
    return;
  }
  if (kind == Kind::read) {
    for (const Range& range : constants()) {
      if (at >= range.begin && at < range.end) return;
    }
  }
  found("not the device's memory: " + who() + " " + verb(kind) + " " + std::to_string(bytes) + " bytes", code);
}

// An access whose size is its alignment on a device.
void aligned(const void* memory, std::size_t bytes, Kind kind, const void* code) {
  if (running && reinterpret_cast<std::uintptr_t>(memory) % bytes != 0) {
    found("misaligned: " + who() + " " + verb(kind) + " " + std::to_string(bytes) + " bytes", code);
  }
  access(memory, bytes, kind, code);
}

Region& hostRegion(const void* memory, std::size_t bytes) {
  const auto at = reinterpret_cast<std::uintptr_t>(memory);
  Region* region = findRegion(at);
  if (!region || region->bytes - (at - region->begin) < bytes) {
    throw std::logic_error("a copy or fill of " + std::to_string(bytes) + " bytes beyond the device's memory");
  }
  return *region;
}
auto writtenFrom(Region& region, const void* memory) {
  return region.written.begin() + static_cast<std::ptrdiff_t>(reinterpret_cast<std::uintptr_t>(memory) - region.begin);
}

}  // namespace

void allocated(const void* memory, std::size_t bytes) {
  Region region;
  region.begin = reinterpret_cast<std::uintptr_t>(memory);
  region.bytes = bytes;
  region.written.resize(bytes);
  regions[region.begin] = std::move(region);
}
void released(const void* memory) {
  recent.fill({});
  regions.erase(reinterpret_cast<std::uintptr_t>(memory));
}
void wrote(const void* memory, std::size_t bytes) {
  if (bytes > 0) std::fill_n(writtenFrom(hostRegion(memory, bytes), memory), bytes, std::uint8_t{1});
}
void forget(const void* memory, std::size_t bytes) {
  if (bytes > 0) std::fill_n(writtenFrom(hostRegion(memory, bytes), memory), bytes, std::uint8_t{0});
}
void reads(const void* memory, std::size_t bytes) {
  if (bytes == 0) return;
  const auto from = writtenFrom(hostRegion(memory, bytes), memory);
  const auto missing = std::find(from, from + static_cast<std::ptrdiff_t>(bytes), 0);
  if (missing != from + static_cast<std::ptrdiff_t>(bytes)) {
    throw std::logic_error("a copy or sort of " + std::to_string(bytes) + " bytes reads byte " +
                           std::to_string(missing - from) + ", which nothing wrote");
  }
}

void beginLaunch() {
  ++launch_number;
  running = true;
}
void endLaunch() {
  running = false;
  shared_region.bytes = 0;
}
void beginBlock(unsigned block) {
  block_number = block;
  block_epoch = 0;
  warp_epochs = {};
  shared_region.bytes = 0;
}
void useShared(const void* memory, std::size_t bytes) {
  if (shared_region.bytes >= bytes) return;
  shared_region.begin = reinterpret_cast<std::uintptr_t>(memory);
  shared_region.bytes = bytes;
  shared_region.shared = true;
  shared_region.written.assign(bytes, 0);
  shared_region.words.resize(std::max(shared_region.words.size(), (bytes + kWord - 1) / kWord));
  if (!shared_region.single.empty()) shared_region.single.resize(std::max(shared_region.single.size(), bytes));
}
void runThread(unsigned thread, const void* stack, std::size_t stack_bytes) {
  thread_number = thread;
  stack_begin = reinterpret_cast<std::uintptr_t>(stack);
  stack_size = stack_bytes;
}
void blockBarrier() { ++block_epoch; }
void warpBarrier(unsigned warp) { ++warp_epochs[warp]; }
void atomic(const void* memory, std::size_t bytes) {
  aligned(memory, bytes, Kind::atomic, __builtin_return_address(0));
}
std::string takeFinding() { return std::exchange(finding, {}); }

}  // namespace tg::cuda::check

// ---- What compilers call under -fsanitize=thread
using tg::cuda::check::Kind;
extern "C" {
#define TG_ACCESS(size)                                                           \
  void __tsan_read##size(const void* at) {                                        \
    tg::cuda::check::aligned(at, size, Kind::read, __builtin_return_address(0));  \
  }                                                                               \
  void __tsan_write##size(const void* at) {                                       \
    tg::cuda::check::aligned(at, size, Kind::write, __builtin_return_address(0)); \
  }                                                                               \
  void __tsan_unaligned_read##size(const void* at) {                              \
    tg::cuda::check::access(at, size, Kind::read, __builtin_return_address(0));   \
  }                                                                               \
  void __tsan_unaligned_write##size(const void* at) {                             \
    tg::cuda::check::access(at, size, Kind::write, __builtin_return_address(0));  \
  }
TG_ACCESS(1)
TG_ACCESS(2)
TG_ACCESS(4)
TG_ACCESS(8)
TG_ACCESS(16)
#undef TG_ACCESS
void __tsan_read_range(const void* at, unsigned long bytes) {
  tg::cuda::check::access(at, bytes, Kind::read, __builtin_return_address(0));
}
void __tsan_write_range(const void* at, unsigned long bytes) {
  tg::cuda::check::access(at, bytes, Kind::write, __builtin_return_address(0));
}
void* __tsan_memcpy(void* to, const void* from, unsigned long bytes) {
  tg::cuda::check::access(from, bytes, Kind::read, __builtin_return_address(0));
  tg::cuda::check::access(to, bytes, Kind::write, __builtin_return_address(0));
  return std::memcpy(to, from, bytes);
}
void* __tsan_memmove(void* to, const void* from, unsigned long bytes) {
  tg::cuda::check::access(from, bytes, Kind::read, __builtin_return_address(0));
  tg::cuda::check::access(to, bytes, Kind::write, __builtin_return_address(0));
  return std::memmove(to, from, bytes);
}
void* __tsan_memset(void* to, int value, unsigned long bytes) {
  tg::cuda::check::access(to, bytes, Kind::write, __builtin_return_address(0));
  return std::memset(to, value, bytes);
}
void __tsan_init() {}
void __tsan_func_entry(const void*) {}
void __tsan_func_exit() {}
void __tsan_vptr_update(void*, void*) {}
void __tsan_vptr_read(void*) {}
}
