// SPDX-License-Identifier: Apache-2.0
// The thread pool: every item once, errors reach the caller, nesting and shrinking are safe.
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/system/parallel.h"
#include "support/catch.h"

namespace {

struct Threads {
  explicit Threads(int count) { tg::setThreadCount(count); }
  ~Threads() { tg::setThreadCount(0); }
};

}  // namespace

TEST_CASE("every item runs exactly once for any thread count and grain") {
  for (int threads : {1, 2, 3, 8}) {
    const Threads guard(threads);
    for (std::int64_t grain : {std::int64_t{0}, std::int64_t{1}, std::int64_t{7}, std::int64_t{1000}}) {
      for (std::int64_t count : {0, 1, 6, 7, 8, 999}) {
        std::vector<std::atomic<int>> hits(static_cast<std::size_t>(count));
        tg::parallelFor(count, grain, [&](std::int64_t i) { ++hits[static_cast<std::size_t>(i)]; });
        for (const auto& hit : hits) REQUIRE(hit == 1);
      }
    }
  }
}

TEST_CASE("worker numbers stay below the thread count and are never used by two threads at once") {
  const Threads guard(4);
  std::vector<std::atomic<int>> busy(4);
  std::atomic<bool> clash{false};
  tg::parallelForWorkers(2000, 1, 4, [&](std::int64_t, int worker) {
    if (worker < 0 || worker >= 4 || busy[static_cast<std::size_t>(worker)]++ != 0) {
      clash = true;
      return;
    }
    std::this_thread::yield();
    --busy[static_cast<std::size_t>(worker)];
  });
  REQUIRE_FALSE(clash);
}

TEST_CASE("a thread may change the number of threads while others run loops with space for as many as there were") {
  const Threads guard(2);
  std::atomic<bool> done{false}, wrong{false};
  std::thread changer([&] {
    for (int count = 1; !done; count = count % 4 + 1) tg::setThreadCount(count);
  });
  for (int round = 0; round < 2000; ++round) {
    std::vector<std::atomic<int>> space(static_cast<std::size_t>(tg::threadCount()));
    tg::parallelForWorkers(8, 1, std::ssize(space), [&](std::int64_t, int worker) {
      if (worker >= std::ssize(space)) wrong = true;
      std::vector<int> inner(static_cast<std::size_t>(tg::threadCount()));
      tg::parallelForWorkers(2, 1, std::ssize(inner), [&](std::int64_t, int nested) {
        if (nested >= std::ssize(inner)) wrong = true;
      });
    });
  }
  done = true;
  changer.join();
  REQUIRE_FALSE(wrong);
}

TEST_CASE("a child of fork runs loops with threads of its own") {
  const Threads guard(3);
  tg::parallelFor(100, 1, [](std::int64_t) {});
  const pid_t child = ::fork();
  if (child == 0) {
    std::atomic<int> sum{0};
    tg::parallelFor(100, 1, [&](std::int64_t) { ++sum; });
    ::_exit(sum == 100 ? 0 : 1);
  }
  REQUIRE(child > 0);
  int status = -1;
  for (int left = 3000; left > 0 && ::waitpid(child, &status, WNOHANG) == 0; --left) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  ::kill(child, SIGKILL);
  CHECK(status == 0);
}

TEST_CASE("an exception in the body reaches the caller and the pool works on") {
  const Threads guard(4);
  for (int round = 0; round < 20; ++round) {
    REQUIRE_THROWS_AS(tg::parallelFor(1000, 3,
                                      [](std::int64_t i) {
                                        if (i == 500) throw std::runtime_error("x");
                                      }),
                      std::runtime_error);
    std::atomic<int> sum{0};
    tg::parallelFor(100, 1, [&](std::int64_t) { ++sum; });
    REQUIRE(sum == 100);
  }
}

TEST_CASE("a nested loop runs serially, in order, under the number of its worker") {
  const Threads guard(4);
  std::atomic<bool> wrong{false};
  tg::parallelForWorkers(64, 1, 4, [&](std::int64_t, int outer) {
    const std::thread::id here = std::this_thread::get_id();
    std::int64_t expected = 0;
    tg::parallelForWorkers(50, 4, 4, [&](std::int64_t i, int inner) {
      if (std::this_thread::get_id() != here || inner != outer || i != expected++) wrong = true;
    });
  });
  REQUIRE_FALSE(wrong);
}

TEST_CASE("loops started by several threads at once all finish") {
  const Threads guard(3);
  std::atomic<int> sum{0};
  std::vector<std::thread> callers;
  for (int t = 0; t < 4; ++t) {
    callers.emplace_back([&] {
      for (int round = 0; round < 50; ++round) tg::parallelFor(40, 1, [&](std::int64_t) { ++sum; });
    });
  }
  for (std::thread& caller : callers) caller.join();
  REQUIRE(sum == 4 * 50 * 40);
}

TEST_CASE("a grain is one grab: consecutive items run on one thread") {
  const Threads guard(4);
  std::vector<std::thread::id> owner(100);
  tg::parallelFor(100, 10, [&](std::int64_t i) { owner[static_cast<std::size_t>(i)] = std::this_thread::get_id(); });
  for (std::size_t i = 0; i < 100; ++i) REQUIRE(owner[i] == owner[i / 10 * 10]);
}

TEST_CASE("thread count zero means all of the machine") {
  tg::setThreadCount(0);
  REQUIRE(tg::threadCount() >= 1);
  tg::setThreadCount(5);
  REQUIRE(tg::threadCount() == 5);
  tg::setThreadCount(0);
}
