// SPDX-License-Identifier: Apache-2.0
// The mailbox, and the way out when a device fails.
#include "viewer/picture_thread.h"

#include <chrono>
#include <new>
#include <utility>

#include "core/error.h"
#include "viewer/picture_maker.h"

namespace tg {

PictureThread::PictureThread(Screen& screen, std::string backend, std::function<void()> wake)
    : screen_(screen), backend_(std::move(backend)), wake_(std::move(wake)), thread_([this] { run(); }) {}

PictureThread::~PictureThread() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void PictureThread::ask(PictureRequest request) {
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

bool PictureThread::idle() const {
  const std::lock_guard lock(mutex_);
  return !asked_ && !working_;
}

PictureThread::News PictureThread::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(news_, {});
}

void PictureThread::run() {
  std::unique_ptr<PictureDevice> device;
  std::unique_ptr<PictureMaker> maker;
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stop_ || asked_; });
    if (stop_) return;
    const PictureRequest request = std::move(*std::exchange(asked_, std::nullopt));
    working_ = true;
    const bool lose = std::exchange(lose_, false);
    const std::chrono::duration<double> delay(std::exchange(delay_, 0));
    lock.unlock();
    std::this_thread::sleep_for(delay);

    std::shared_ptr<const Picture> picture;
    std::string problem;
    while (!picture) {
      std::string reason;
      bool device_failed = true;
      try {
        if (lose && backend_ != "cpu") throw Error(ErrorKind::device, "device lost, as a script wants it");
        if (!device) device = screen_.makePictureDevice();
        if (!maker) maker = std::make_unique<PictureMaker>(*device, backend_);
        picture = std::make_shared<const Picture>(maker->draw(request));
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
        break;
      }
      backend_ = "cpu";
      problem = "The device failed, the CPU renders from here on: " + reason;
    }

    lock.lock();
    working_ = false;
    if (picture)
      news_.picture = std::move(picture);
    else if (!asked_)
      news_.given_up = true;
    if (!problem.empty()) news_.problem = std::move(problem);
    lock.unlock();
    wake_();
    lock.lock();
  }
}

}  // namespace tg
