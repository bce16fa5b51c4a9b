// SPDX-License-Identifier: Apache-2.0
// Ranks as threads of this process: what MPI is to programs, for tests of what does not know it.
#pragma once
#include <atomic>
#include <condition_variable>
#include <cstring>
#include <exception>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

#include "training/mpi/channel.h"

namespace tg::test {

// What the ranks share.
class ThreadRanks {
 public:
  explicit ThreadRanks(int size) : messages_(static_cast<std::size_t>(size)) {}

  int size() const { return static_cast<int>(messages_.size()); }
  // Bytes that went from one rank to another.
  std::size_t sent() const { return sent_; }

  void exchange(int rank, std::span<const std::span<const std::byte>> to, std::span<const std::span<std::byte>> from) {
    messages_[static_cast<std::size_t>(rank)] = to;
    wait();
    for (std::size_t r = 0; r < messages_.size(); ++r) {
      const std::span<const std::byte> message = messages_[r][static_cast<std::size_t>(rank)];
      if (message.size() != from[r].size()) throw std::logic_error("a rank expects a message of another length");
      if (!message.empty()) std::memcpy(from[r].data(), message.data(), message.size());
      if (r != static_cast<std::size_t>(rank)) sent_ += message.size();
    }
    wait();
  }
  // Nobody waits any more: a rank has failed.
  void fail() {
    const std::lock_guard lock(mutex_);
    failed_ = true;
    changed_.notify_all();
  }

 private:
  void wait() {
    std::unique_lock lock(mutex_);
    const int round = round_;
    if (++arrived_ == size()) {
      arrived_ = 0;
      ++round_;
      changed_.notify_all();
    }
    changed_.wait(lock, [&] { return failed_ || round_ != round; });
    if (failed_) throw std::runtime_error("another rank has failed");
  }

  std::vector<std::span<const std::span<const std::byte>>> messages_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<std::size_t> sent_ = 0;
  int arrived_ = 0, round_ = 0;
  bool failed_ = false;
};

class ThreadChannel final : public Channel {
 public:
  ThreadChannel(ThreadRanks& ranks, int rank) : ranks_(ranks), rank_(rank) {}
  int rank() const override { return rank_; }
  int size() const override { return ranks_.size(); }
  int onThisMachine() const override { return ranks_.size(); }
  void exchange(std::span<const std::span<const std::byte>> to, std::span<const std::span<std::byte>> from) override {
    ranks_.exchange(rank_, to, from);
  }
  void finish() override {}
  [[noreturn]] void abort(int) noexcept override { std::terminate(); }

 private:
  ThreadRanks& ranks_;
  const int rank_;
};

// body(channel) at every rank, the first in this thread; throws what the rank that failed first has thrown.
inline void atRanks(ThreadRanks& ranks, const std::function<void(Channel&)>& body) {
  std::exception_ptr first;
  std::mutex mutex;
  const auto run = [&](int rank) {
    ThreadChannel channel(ranks, rank);
    try {
      body(channel);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!first) first = std::current_exception();
      ranks.fail();
    }
  };
  {
    std::vector<std::jthread> threads;
    for (int rank = 1; rank < ranks.size(); ++rank) threads.emplace_back(run, rank);
    run(0);
  }
  if (first) std::rethrow_exception(first);
}

}  // namespace tg::test
