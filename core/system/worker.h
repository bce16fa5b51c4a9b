// SPDX-License-Identifier: Apache-2.0
// A thread that works for another one, and the mailboxes between them: the latest value, or a queue. All members of a
// mailbox may be called from any thread.
#pragma once
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>

namespace tg {

// What LatestValue and Queue share.
template <typename T>
class Mailbox {
 public:
  Mailbox& operator=(Mailbox&&) = delete;

  // Waits for a value. None: `stop` was asked for, or the box is closed and empty. Throws what closed it, if anything.
  std::optional<T> take(const std::stop_token& stop = {}) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return closed_ || !values_.empty(); });
    return stop.stop_requested() ? std::nullopt : takeFirst();
  }

  // The same without waiting; none also while nothing is there.
  std::optional<T> poll() {
    const std::lock_guard lock(mutex_);
    return takeFirst();
  }

  bool empty() const {
    const std::lock_guard lock(mutex_);
    return values_.empty();
  }

  // What is there can still be taken, what is given is dropped. With a failure, give throws it, and so do take and poll
  // once the box is empty.
  void close(std::exception_ptr failure = nullptr) {
    const bool failed = failure != nullptr;
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
      if (failed) failure_ = std::move(failure);
    }
    announce(failed);
  }

 protected:
  // `wake` is called after a value was given and after a failure, by the thread that did it, without a lock.
  explicit Mailbox(std::function<void()> wake) : wake_(std::move(wake)) {}
  ~Mailbox() = default;

  // With the lock held.
  bool takesMore() const {
    if (failure_) std::rethrow_exception(failure_);
    return !closed_;
  }
  void announce(bool news) {
    changed_.notify_all();
    if (news && wake_) wake_();
  }

  mutable std::mutex mutex_;  // guards all below but wake_
  std::condition_variable_any changed_;
  std::deque<T> values_;
  bool closed_ = false;

 private:
  std::optional<T> takeFirst() {
    if (values_.empty()) {
      (void)takesMore();
      return std::nullopt;
    }
    std::optional<T> value(std::move(values_.front()));
    values_.pop_front();
    changed_.notify_all();
    return value;
  }

  std::exception_ptr failure_;
  const std::function<void()> wake_;
};

// Holds at most one value.
template <typename T>
class LatestValue : public Mailbox<T> {
 public:
  explicit LatestValue(std::function<void()> wake = {}) : Mailbox<T>(std::move(wake)) {}

  // Replaces the value that nobody has taken yet.
  void give(T value) {
    give(std::move(value), [](T& held, T& fresh) { held = std::move(fresh); });
  }
  // merge(held, fresh) makes one of the two, in `held`, where nobody has taken the one before. It is called with the
  // lock held.
  template <typename Merge>
  void give(T value, Merge merge) {
    {
      const std::lock_guard lock(this->mutex_);
      if (!this->takesMore()) return;
      if (this->values_.empty()) {
        this->values_.push_back(std::move(value));
      } else {
        merge(this->values_.front(), value);
      }
    }
    this->announce(true);
  }
};

// Holds values in the order in which they were given.
template <typename T>
class Queue : public Mailbox<T> {
 public:
  static constexpr std::size_t kUnlimited = std::numeric_limits<std::size_t>::max();

  explicit Queue(std::size_t limit = kUnlimited, std::function<void()> wake = {})
      : Mailbox<T>(std::move(wake)), limit_(limit) {}

  // Waits while the queue is full. False: the value was dropped, because `stop` was asked for or the queue is closed.
  bool give(T value, const std::stop_token& stop = {}) {
    {
      std::unique_lock lock(this->mutex_);
      this->changed_.wait(lock, stop, [this] { return !isFull(); });
      if (stop.stop_requested() || !this->takesMore()) return false;
      this->values_.push_back(std::move(value));
    }
    this->announce(true);
    return true;
  }

  // Whether give would wait.
  bool full() const {
    const std::lock_guard lock(this->mutex_);
    return isFull();
  }

  // Drops what is there, and says how many values that was.
  std::size_t clear() {
    std::deque<T> dropped;
    {
      const std::lock_guard lock(this->mutex_);
      dropped.swap(this->values_);
    }
    this->announce(false);
    return dropped.size();
  }

 private:
  bool isFull() const { return !this->closed_ && this->values_.size() >= limit_; }

  const std::size_t limit_;
};

// Whether that time passed; false as soon as `stop` is asked for.
inline bool sleepUnlessStopped(const std::stop_token& stop, std::chrono::milliseconds time) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  return !std::condition_variable_any().wait_for(lock, stop, time, [&stop] { return stop.stop_requested(); });
}

// Runs work(stop) in a thread of its own. At its end `box` is closed, with the exception that left it if one did:
// whoever takes what the thread makes, or gives it more to do, hears of that. Destroying the thread asks it to stop and
// waits for it, so declare it after everything that `work` uses. Throws std::system_error where there is no thread.
template <typename T, typename Work>
std::jthread startWorker(Mailbox<T>& box, Work work) {
  return std::jthread([&box, work = std::move(work)](const std::stop_token& stop) {
    std::exception_ptr failure;
    try {
      work(stop);
    } catch (...) {
      failure = std::current_exception();
    }
    box.close(std::move(failure));
  });
}

}  // namespace tg
