// SPDX-License-Identifier: Apache-2.0
// A pool of sleeping workers that join a loop while it has items left.
#include "core/system/parallel.h"

#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <ctime>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "core/system/assert.h"
#include "core/system/serial_loops.h"

namespace tg {
namespace {

constexpr int kBackgroundNiceness = 5;
constexpr int kMaxThreads = 1024;  // far above any machine; keeps a mistyped option from starting a million threads

// Which worker of a running loop this thread is, and of how many; -1 outside of loops.
thread_local int current_worker = -1;
thread_local int current_workers = 0;

struct Loop {
  std::int64_t count;
  std::int64_t grain;
  int threads;
  const std::function<void(std::int64_t, int)>& body;
  std::atomic<std::int64_t> next{0};
  std::atomic<bool> failed{false};
  std::exception_ptr error{};

  void run(int worker) {
    const int outer = std::exchange(current_worker, worker);
    const int outer_workers = std::exchange(current_workers, threads);
    try {
      while (!failed.load(std::memory_order_relaxed)) {
        const std::int64_t begin = next.fetch_add(grain, std::memory_order_relaxed);
        if (begin >= count) break;
        const std::int64_t end = std::min(count, begin + grain);
        for (std::int64_t i = begin; i < end; ++i) body(i, worker);
      }
    } catch (...) {
      if (!failed.exchange(true)) error = std::current_exception();
    }
    current_worker = outer;
    current_workers = outer_workers;
  }
};

// A loop hands out tickets; a worker that wakes takes one and joins. When the caller has run out of items it takes the
// tickets back that nobody has claimed, so a short loop never waits for a sleeper.
class Pool {
 public:
  ~Pool() {
    {
      std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  void run(Loop& loop) {
    std::lock_guard one_loop_at_a_time(loop_mutex_);
    int helpers = loop.threads - 1;
    {
      std::lock_guard lock(mutex_);
      grow(helpers);
      helpers = std::min(helpers, static_cast<int>(threads_.size()));
      loop_ = &loop;
      tickets_ = helpers;
    }
    for (int i = 0; i < helpers; ++i) wake_.notify_one();
    loop.run(0);
    std::unique_lock lock(mutex_);
    tickets_ = 0;
    idle_.wait(lock, [this] { return active_ == 0; });
    loop_ = nullptr;
  }

 private:
  void grow(int helpers) {
    while (static_cast<int>(threads_.size()) < helpers) {
      try {
        threads_.emplace_back([this] { work(); });
      } catch (const std::system_error&) {
        return;  // the machine gives no more threads: fewer workers, same result
      }
    }
  }

  void work() {
    std::unique_lock lock(mutex_);
    for (;;) {
      wake_.wait(lock, [this] { return stop_ || tickets_ > 0; });
      if (stop_) return;
      Loop* loop = loop_;
      const int worker = tickets_--;
      ++active_;
      lock.unlock();
      loop->run(worker);
      lock.lock();
      if (--active_ == 0) idle_.notify_one();
    }
  }

  std::mutex loop_mutex_;  // held by the thread whose loop runs
  std::mutex mutex_;       // guards everything below
  std::condition_variable wake_;
  std::condition_variable idle_;
  std::vector<std::thread> threads_;
  Loop* loop_ = nullptr;
  int tickets_ = 0;
  int active_ = 0;
  bool stop_ = false;
};

// A child of fork() has none of its parent's threads: it leaves their pool as it is and begins one of its own.
struct PoolOwner {
  Pool* pool = new Pool;
  PoolOwner();
  ~PoolOwner() { delete pool; }
  PoolOwner& operator=(PoolOwner&&) = delete;
};

PoolOwner& poolOwner() {
  static PoolOwner instance;
  return instance;
}

PoolOwner::PoolOwner() {
  ::pthread_atfork(nullptr, nullptr, [] { poolOwner().pool = new Pool; });
}

std::atomic<int> requested_threads{0};

}  // namespace

SerialLoops::SerialLoops() : outer_(std::exchange(current_worker, std::max(current_worker, 0))) {}
SerialLoops::~SerialLoops() { current_worker = outer_; }

// On Linux niceness is a thread's own.
void runInBackground() { (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kBackgroundNiceness); }

double threadSeconds() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

bool insideParallelFor() { return current_worker >= 0; }

void setThreadCount(int count) {
  TG_ASSERT(!insideParallelFor(), "the number of threads stays during a loop");
  requested_threads = std::clamp(count, 0, kMaxThreads);
}

int threadCount() {
  if (current_workers > 0) return current_workers;
  const int requested = requested_threads;
  if (requested > 0) return requested;
  return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, kMaxThreads);
}

void parallelForWorkers(std::int64_t count, std::int64_t grain, std::int64_t workers,
                        const std::function<void(std::int64_t item, int worker)>& body) {
  TG_ASSERT(body != nullptr, "a loop has a body");
  TG_ASSERT(workers > current_worker && workers > 0, "a worker's number is below their count");
  if (count <= 0) return;
  grain = std::clamp<std::int64_t>(grain, 1, count);
  const std::int64_t grabs = (count - 1) / grain + 1;
  const int threads = static_cast<int>(std::min({std::int64_t{threadCount()}, grabs, workers}));
  if (threads == 1 || current_worker >= 0) {
    const int worker = std::max(current_worker, 0);  // nested: the number that is ours in the outer loop
    for (std::int64_t i = 0; i < count; ++i) body(i, worker);
    return;
  }
  Loop loop{count, grain, threads, body};
  poolOwner().pool->run(loop);
  if (loop.error) std::rethrow_exception(loop.error);
}

void parallelFor(std::int64_t count, std::int64_t grain, const std::function<void(std::int64_t)>& body) {
  parallelForWorkers(count, grain, kMaxThreads, [&body](std::int64_t item, int) { body(item); });
}

}  // namespace tg
