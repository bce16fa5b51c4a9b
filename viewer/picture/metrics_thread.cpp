// SPDX-License-Identifier: Apache-2.0
// Measures the newest pair and drops those it missed.
#include "viewer/picture/metrics_thread.h"

#include <new>
#include <utility>

#include "core/system/assert.h"

namespace tg {

MetricsThread::MetricsThread(std::function<void()> wake)
    : results_(std::move(wake)), thread_(startWorker(results_, [this](const std::stop_token& stop) {
        while (const auto pair = asked_.take(stop)) {
          Result result{*pair, std::nullopt};
          try {
            result.metrics = metricsOf((*pair)->first, (*pair)->other, (*pair)->mask);
          } catch (const std::bad_alloc&) {  // then there are no numbers
          }
          results_.give(std::move(result));
        }
      })) {}

void MetricsThread::ask(std::shared_ptr<const PicturePair> pair) {
  TG_ASSERT(pair != nullptr, "there is a pair to measure");
  TG_ASSERT(pair->first.width == pair->other.width && pair->first.height == pair->other.height, "a pair has one size");
  asked_.give(std::move(pair));
}

}  // namespace tg
