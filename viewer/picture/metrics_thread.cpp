// SPDX-License-Identifier: Apache-2.0
// Measures the newest picture and drops those it missed.
#include "viewer/picture/metrics_thread.h"

#include <new>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/serial_loops.h"
#include "viewer/view/camera_controller.h"

namespace tg {

Camera measuredCamera(const Camera& taken) {
  int times = 1;
  const auto pixels = [&] { return std::int64_t{taken.size.x / times} * (taken.size.y / times); };
  while (pixels() > kMostMeasured) ++times;
  return times == 1 ? taken : fitted(taken, taken.size.x / times, taken.size.y / times);
}

MetricsThread::MetricsThread(std::function<void()> wake)
    : results_(std::move(wake)), thread_(startWorker(results_, [this](const std::stop_token& stop) {
        while (auto asked = asked_.take(stop)) {
          Result result{asked->number, std::nullopt};
          try {
            result.metrics = measure(*asked);
          } catch (const std::bad_alloc&) {  // then there are no numbers
          } catch (const Error&) {           // that of the same picture on screen is told
          }
          asked.reset();  // it holds its model
          results_.give(result);
        }
      })) {}

std::optional<PictureMetrics> MetricsThread::measure(const Asked& asked) {
  if (asked.pair) return metricsOf(asked.pair->first, asked.pair->other, asked.pair->mask);
  const Camera camera = measuredCamera(asked.request.other->taken);
  RenderSettings settings = asked.request.settings;
  settings.exposure = 0;
  settings.outputs = {asked.request.output};
  const SerialLoops alone;  // a picture of the view does not wait for this one
  const std::unique_ptr<Renderer> renderer = makeCpuRenderer();
  renderer->setModel(asked.request.model);
  const Image first = visualize(renderer->render(camera, settings), asked.request.output, settings);
  const ResampledPhotograph seen =
      resampled(*asked.photograph, asked.request.other->taken, camera, settings.background);
  return metricsOf(first, seen.image, seen.mask);
}

std::uint64_t MetricsThread::ask(const Picture& picture) {
  TG_ASSERT(hasFigures(picture), "there is something to measure");
  const Image &first = picture.pair->first, &other = picture.pair->other;
  TG_ASSERT(first.width == other.width && first.height == other.height, "a pair has one size");
  Asked asked{++number_, nullptr, {}, picture.photograph};
  if (picture.photograph) {
    asked.request = picture.request;
  } else {
    asked.pair = picture.pair;
  }
  asked_.give(std::move(asked));
  return number_;
}

}  // namespace tg
