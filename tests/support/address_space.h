// SPDX-License-Identifier: Apache-2.0
// Steps that must not take memory by the gigabyte.
#pragma once
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <stdexcept>

#include "support/sanitizers.h"

namespace tg::test {

// For TG_SKIP_IF.
inline const char* noAddressSpaceLimit() {
  return TG_ADDRESS_SANITIZER || TG_THREAD_SANITIZER ? "sanitizers take address space without a bound" : "";
}

// While it lives the process may take so many bytes more, beyond which memory runs out.
class AddressSpaceLimit {
 public:
  explicit AddressSpaceLimit(std::uint64_t bytes) {
    std::uint64_t pages = 0;
    if (!(std::ifstream("/proc/self/statm") >> pages) || ::getrlimit(RLIMIT_AS, &before_) != 0) fail();
    const rlim_t most = pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)) + bytes;
    const rlimit limit{std::min({most, before_.rlim_cur, before_.rlim_max}), before_.rlim_max};
    if (::setrlimit(RLIMIT_AS, &limit) != 0) fail();
  }
  ~AddressSpaceLimit() { (void)::setrlimit(RLIMIT_AS, &before_); }
  AddressSpaceLimit& operator=(AddressSpaceLimit&&) = delete;

 private:
  [[noreturn]] static void fail() { throw std::runtime_error("the address space cannot be limited"); }

  rlimit before_{};
};

}  // namespace tg::test
