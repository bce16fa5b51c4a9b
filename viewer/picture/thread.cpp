// SPDX-License-Identifier: Apache-2.0
// The mailbox, and the way out when a device fails.
#include "viewer/picture/thread.h"

#include <chrono>
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
                             std::string backend, std::function<void()> wake)
    : make_device_(std::move(make_device)),
      frames_in_flight_(static_cast<std::size_t>(frames_in_flight)),
      backend_(std::move(backend)),
      wake_(std::move(wake)),
      thread_([this] { run(); }) {}

PictureThread::~PictureThread() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void PictureThread::ask(PictureRequest request) {
  TG_ASSERT(request.model != nullptr, "a picture is of a model");
  TG_ASSERT(request.camera.width > 0 && request.camera.height > 0, "a picture has pixels");
  {
    const std::lock_guard lock(mutex_);
    asked_ = std::move(request);
    news_.given_up = false;
  }
  changed_.notify_all();
}

void PictureThread::loseDevice() {
  const std::lock_guard lock(mutex_);
  lose_ = true;
}

void PictureThread::delay(double seconds) {
  const std::lock_guard lock(mutex_);
  delay_ = seconds;
}

bool PictureThread::waiting() const {
  const std::lock_guard lock(mutex_);
  return asked_.has_value();
}

PictureThread::News PictureThread::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(news_, {});
}

void PictureThread::run() {
  std::unique_ptr<PictureDevice> device;
  std::unique_ptr<PictureMaker> maker;
  std::optional<PictureRequest> newest;  // of those begun
  const std::size_t most = frames_in_flight_;
  std::unique_lock lock(mutex_);
  for (;;) {
    const std::size_t under_way = maker ? maker->underWay() : 0;
    if (under_way == 0) changed_.wait(lock, [this] { return stop_ || asked_; });
    if (stop_) return;
    std::optional<PictureRequest> request;
    if (asked_ && under_way < most && (under_way == 0 || maker->expectedRest() < kRecordAhead)) {
      request = std::exchange(asked_, std::nullopt);
    }
    const bool lose = request && std::exchange(lose_, false);
    const std::chrono::duration<double> delay(request ? std::exchange(delay_, 0) : 0);
    lock.unlock();
    std::this_thread::sleep_for(delay);

    std::shared_ptr<const Picture> picture;
    std::optional<PictureRequest> refused;
    std::string problem;
    bool given_up = false;
    while (!given_up) {
      std::string reason;
      bool device_failed = true;
      try {
        if (lose && backend_ != "cpu") throw Error(ErrorKind::device, "device lost, as a script wants it");
        if (!device) device = make_device_();
        if (!maker) maker = std::make_unique<PictureMaker>(*device, backend_);
        if (request) newest = request;
        if (request && !maker->begin(*request)) refused = request;
        // With room for another one, it looks up now and then for a request.
        const bool alone = most == 1 || maker->underWay() == most || refused;
        if (auto done = maker->finish(alone ? std::numeric_limits<double>::infinity() : kLook))
          picture = std::make_shared<const Picture>(std::move(*done));
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
      if (backend_ == "cpu" || !device_failed) {
        problem = "The picture cannot be drawn: " + reason;
        given_up = true;
      } else {
        backend_ = "cpu";
        problem = "The device failed, the CPU renders from here on: " + reason;
        request = newest;
      }
    }

    lock.lock();
    if (refused && !asked_) asked_ = std::move(refused);
    const bool news = picture || given_up || !problem.empty();
    if (picture)
      news_.picture = std::move(picture);
    else if (given_up && !asked_)
      news_.given_up = true;
    if (!problem.empty()) news_.problem = std::move(problem);
    if (!news) continue;
    lock.unlock();
    wake_();
    lock.lock();
  }
}

}  // namespace tg
