// SPDX-License-Identifier: Apache-2.0
// Mailboxes and their threads: order, limits, exceptions, and ends at the worst moment.
#include "core/system/worker.h"

#include <atomic>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/catch.h"

using namespace tg;
using namespace std::chrono_literals;

namespace {

// Passes on what it takes; waits in each value until it may go on. Counts what it began.
struct Echo {
  std::atomic<int> begun{0};
  std::atomic<bool> held{false};
  LatestValue<int> asked;
  Queue<int> answers;
  std::jthread thread;

  Echo()
      : thread(startWorker(answers, [this](const std::stop_token& stop) {
          while (const auto value = asked.take(stop)) {
            ++begun;
            begun.notify_all();
            held.wait(true);
            if (*value < 0) throw std::runtime_error("negative");
            answers.give(*value);
          }
        })) {}
  void hold(bool on) {
    held = on;
    held.notify_all();
  }
};

}  // namespace

TEST_CASE("a queue keeps the order and hands out what is there after it was closed") {
  Queue<int> queue;
  for (int i = 0; i < 5; ++i) CHECK(queue.give(i));
  queue.close();
  CHECK_FALSE(queue.give(9));
  for (int i = 0; i < 5; ++i) CHECK(queue.take() == i);
  CHECK_FALSE(queue.take());
  CHECK_FALSE(queue.poll());
}

TEST_CASE("the latest value replaces the one before, or is merged with it") {
  LatestValue<std::string> latest;
  CHECK_FALSE(latest.poll());
  latest.give("a");
  latest.give("b");
  latest.give("c", [](std::string& held, std::string& fresh) { held += fresh; });
  CHECK_FALSE(latest.empty());
  CHECK(latest.take() == "bc");
  CHECK(latest.empty());
  latest.give("d", [](std::string&, std::string&) { FAIL("there is nothing to merge with"); });
  CHECK(latest.poll() == "d");
}

TEST_CASE("a mailbox wakes for each value and for a failure, not for an end, and without its lock") {
  int woken = 0;
  Queue<int> queue(2, [&] {
    ++woken;
    (void)queue.empty();
  });
  queue.give(1);
  queue.give(2);
  CHECK(queue.clear() == 2);
  CHECK(woken == 2);
  queue.close();
  CHECK(woken == 2);
  queue.close(std::make_exception_ptr(std::runtime_error("x")));
  CHECK(woken == 3);
}

TEST_CASE("a bounded queue never holds more than its limit, and loses nothing between several threads") {
  constexpr int kEach = 500;
  Queue<int> queue(3);
  std::vector<std::jthread> givers;
  for (int giver = 0; giver < 3; ++giver) {
    givers.emplace_back([&queue, giver] {
      for (int i = 0; i < kEach; ++i) queue.give(giver * kEach + i);
    });
  }
  std::atomic<int> taken{0};
  std::vector<std::atomic<int>> count(3 * kEach);
  std::vector<std::jthread> takers;
  for (int taker = 0; taker < 2; ++taker) {
    takers.emplace_back([&] {
      while (const auto value = queue.take()) {
        ++count[static_cast<std::size_t>(*value)];
        ++taken;
      }
    });
  }
  for (std::jthread& giver : givers) giver.join();
  queue.close();
  for (std::jthread& taker : takers) taker.join();
  CHECK(taken == 3 * kEach);
  for (const auto& times : count) REQUIRE(times == 1);

  Queue<int> full(2);
  full.give(1);
  CHECK_FALSE(full.full());
  full.give(2);
  CHECK(full.full());
  std::atomic<bool> given{false};
  std::jthread waits([&] { given = full.give(3); });
  std::this_thread::sleep_for(10ms);
  CHECK_FALSE(given);
  CHECK(full.take() == 1);
  waits.join();
  CHECK(given);
  CHECK(full.take() == 2);
  CHECK(full.take() == 3);
}

TEST_CASE("a worker that is busy begins with the newest of what it was asked meanwhile") {
  Echo echo;
  echo.hold(true);
  echo.asked.give(1);
  echo.begun.wait(0);
  for (int i = 2; i < 9; ++i) echo.asked.give(i);
  echo.hold(false);
  CHECK(echo.answers.take() == 1);
  CHECK(echo.answers.take() == 8);
  CHECK(echo.begun == 2);
}

TEST_CASE("an exception comes after the values before it, to every taker, and ends the worker") {
  Echo echo;
  echo.asked.give(1);
  CHECK(echo.answers.take() == 1);
  echo.asked.give(2);
  while (echo.answers.empty()) std::this_thread::yield();
  echo.asked.give(-1);
  echo.thread.join();
  CHECK(echo.answers.take() == 2);
  for (int i = 0; i < 2; ++i) {
    CHECK_THROWS_WITH(echo.answers.take(), "negative");
    CHECK_THROWS_WITH(echo.answers.poll(), "negative");
  }
}

TEST_CASE("whoever waits to give hears of the exception that ended the worker") {
  Queue<int> queue(1);
  const std::jthread thread = startWorker(queue, [&](const std::stop_token& stop) {
    while (const auto value = queue.take(stop)) {
      if (*value == 2) throw std::runtime_error("no twos");
    }
  });
  const auto giveAll = [&] {
    for (;;) queue.give(2);
  };
  CHECK_THROWS_WITH(giveAll(), "no twos");
  CHECK_FALSE(queue.full());
}

TEST_CASE("a worker that waits, to take or to give, ends with its owner") {
  for (int round = 0; round < 200; ++round) {
    Echo waits_for_work;
    Queue<int> answers(1);
    const std::jthread waits_for_room = startWorker(answers, [&](const std::stop_token& stop) {
      int i = 0;
      while (answers.give(i, stop)) ++i;
    });
    if (round % 2 == 0) CHECK(answers.take() == 0);
  }
}

TEST_CASE("a sleep lasts its time, and ends with its owner") {
  const auto start = std::chrono::steady_clock::now();
  CHECK(sleepUnlessStopped({}, 5ms));
  CHECK(std::chrono::steady_clock::now() - start >= 5ms);
  std::atomic<bool> slept{true};
  {
    const std::jthread sleeper([&](const std::stop_token& stop) { slept = sleepUnlessStopped(stop, 1h); });
  }
  CHECK_FALSE(slept);
}

TEST_CASE("destroying a busy worker waits for what it has begun and drops the rest") {
  constexpr int kLast = 5;  // that it begins: it is at work on it until it is to end
  std::atomic<int> begun{0};
  for (int round = 0; round < 200; ++round) {
    begun = 0;
    auto finished = std::make_shared<std::atomic<int>>(0);
    Queue<int> asked;
    {
      const std::jthread thread = startWorker(asked, [&begun, finished, &asked](const std::stop_token& stop) {
        while (const auto value = asked.take(stop)) {
          ++begun;
          begun.notify_all();
          while (*value == kLast && !stop.stop_requested()) std::this_thread::yield();
          std::this_thread::sleep_for(100us);
          ++*finished;
        }
      });
      for (int i = 1; i <= 1000; ++i) asked.give(i);
      begun.wait(0);
    }
    REQUIRE(*finished == begun);
    REQUIRE(begun <= kLast);
  }
}

TEST_CASE("a failure and the end of the owner may come at once") {
  for (int round = 0; round < 200; ++round) {
    Echo echo;
    echo.asked.give(round % 3 - 1);
    if (round % 2 == 0) {
      try {
        (void)echo.answers.take();
      } catch (const std::runtime_error& error) {
        REQUIRE(std::string(error.what()) == "negative");
      }
    }
  }
}
