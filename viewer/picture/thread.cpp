// SPDX-License-Identifier: Apache-2.0
// The mailbox, and the way out when a device fails.
#include "viewer/picture/thread.h"

#include <algorithm>
#include <limits>
#include <new>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "viewer/picture/maker.h"

namespace tg {
namespace {

constexpr double kRecordAhead = 2;  // [ms] before the device is expected to be free
constexpr double kLook = 0.5;       // [ms] between looks at what is asked for, while the device draws

}  // namespace

PictureThread::PictureThread(std::function<std::unique_ptr<PictureDevice>()> make_device, int frames_in_flight,
                             std::string backend, std::function<void()> wake, std::chrono::milliseconds device_rest)
    : make_device_(std::move(make_device)),
      frames_in_flight_(static_cast<std::size_t>(frames_in_flight)),
      backend_(std::move(backend)),
      device_rest_(device_rest),
      results_(std::move(wake)),
      thread_(startWorker(results_, [this](const std::stop_token& stop) { run(stop); })) {}

void PictureThread::ask(PictureRequest request) {
  TG_ASSERT(request.model != nullptr, "a picture is of a model");
  TG_ASSERT(request.camera.size.x > 0 && request.camera.size.y > 0, "a picture has pixels");
  asked_.give({std::move(request), ++asked_number_});
}

// Whatever is asked for beside it tidies, too.
void PictureThread::tidy() {
  asked_.give({}, [](Asked&, Asked&) {});
}

PictureThread::News PictureThread::take() {
  Result result = results_.poll().value_or(Result());
  const bool given_up = result.given_up == asked_number_ && asked_number_ > 0;
  return {std::move(result.picture), std::move(result.problem), given_up};
}

void PictureThread::run(const std::stop_token& stop) {
  std::unique_ptr<PictureDevice> device;
  std::unique_ptr<PictureMaker> maker;
  std::optional<Asked> newest;  // of those begun; none: none is under way
  bool resting = false;         // the device, while the CPU draws
  std::chrono::milliseconds rest = device_rest_;
  std::chrono::steady_clock::time_point tried_again;
  std::string failure;  // the last one that was told
  const std::size_t most = frames_in_flight_;
  while (!stop.stop_requested()) {
    const std::size_t under_way = maker ? maker->underWay() : 0;
    std::optional<Asked> asked;
    if (under_way == 0) {
      newest.reset();  // it holds its model
      asked = asked_.take(stop);
      if (!asked) return;
    } else if (under_way < most && maker->expectedRest() < kRecordAhead) {
      asked = asked_.poll();
    }

    if (asked && !asked->request) {
      if (maker) maker->tidy();
      if (under_way == 0) continue;
      asked.reset();
    }

    if (resting && asked && under_way == 0 && !asked->request->in_run &&
        std::chrono::steady_clock::now() >= tried_again) {
      maker.reset();
      resting = false;
    }
    Result result;
    std::optional<Asked> refused;
    for (;;) {
      std::string reason;
      bool device_failed = true;
      try {
        if (!device) device = make_device_();
        if (!maker) maker = std::make_unique<PictureMaker>(*device, resting ? "cpu" : backend_);
        if (asked && !maker->begin(*asked->request)) refused = std::exchange(asked, std::nullopt);
        if (asked) newest = asked;
        // With room for another one, it looks up now and then for a request.
        const bool alone = most == 1 || maker->underWay() == most || refused;
        if (auto done = maker->finish(alone ? std::numeric_limits<double>::infinity() : kLook)) {
          result.picture = std::make_shared<const Picture>(std::move(*done));
          if (!resting) {
            rest = device_rest_;
            failure.clear();
          }
        }
        break;
      } catch (const std::bad_alloc&) {
        reason = "not enough memory";
      } catch (const Error& error) {
        reason = error.what();
        device_failed = error.kind == ErrorKind::device;
      } catch (const std::exception& error) {
        reason = error.what();
      }
      maker.reset();  // whatever it held makes room
      if (asked) newest = asked;
      if (backend_ == "cpu" || resting || !device_failed) {
        result.problem = "The picture cannot be drawn: " + reason;
        result.given_up = newest->number;
        break;
      }
      resting = true;
      tried_again = std::chrono::steady_clock::now() + rest;
      rest = std::min(2 * rest, kLongestDeviceRest);
      if (reason != failure) result.problem = "The device failed, the CPU renders meanwhile: " + reason;
      failure = reason;
      asked = newest;
    }

    if (refused) asked_.give(std::move(*refused), [](Asked&, Asked&) {});  // a newer one stays
    if (!result.picture && result.problem.empty()) continue;
    results_.give(std::move(result), [](Result& held, Result& fresh) {
      if (fresh.picture) held.picture = std::move(fresh.picture);
      if (!fresh.problem.empty()) held.problem = std::move(fresh.problem);
      held.given_up = std::max(held.given_up, fresh.given_up);
    });
  }
}

}  // namespace tg
