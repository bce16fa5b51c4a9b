// SPDX-License-Identifier: Apache-2.0
// A mailbox around metricsOf().
#include "viewer/picture/metrics_thread.h"

#include <new>
#include <utility>

#include "core/system/assert.h"

namespace tg {

MetricsThread::MetricsThread(std::function<void()> wake) : wake_(std::move(wake)), thread_([this] { run(); }) {}

MetricsThread::~MetricsThread() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void MetricsThread::ask(std::shared_ptr<const PicturePair> pair) {
  TG_ASSERT(pair != nullptr, "there is a pair to measure");
  TG_ASSERT(pair->first.width == pair->other.width && pair->first.height == pair->other.height, "a pair has one size");
  {
    const std::lock_guard lock(mutex_);
    asked_ = std::move(pair);
  }
  changed_.notify_all();
}

std::optional<MetricsThread::Result> MetricsThread::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(result_, std::nullopt);
}

void MetricsThread::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stop_ || asked_; });
    if (stop_) return;
    const std::shared_ptr<const PicturePair> pair = std::exchange(asked_, nullptr);
    lock.unlock();
    std::optional<PictureMetrics> metrics;
    try {
      metrics = metricsOf(pair->first, pair->other, pair->mask);
    } catch (const std::bad_alloc&) {  // then there are no numbers
    }
    lock.lock();
    result_ = Result{pair, metrics};
    lock.unlock();
    wake_();
    lock.lock();
  }
}

}  // namespace tg
