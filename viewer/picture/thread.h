// SPDX-License-Identifier: Apache-2.0
// A thread that draws pictures, so that the window answers however long one takes.
#pragma once
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "viewer/picture/picture.h"

namespace tg {

// Draws the newest request; one that has not begun when the next comes is dropped. Where two pictures may be in
// flight, the second is recorded shortly before the device is expected to be done with the first: so late,
// because a request that has begun no longer gives way to a newer one. When the device fails, it goes on with the CPU
// renderer and says so. All members may be called from one other thread, none of them waits for a picture.
class PictureThread {
 public:
  // `make_device` is called in this thread; what it draws on must outlive this and every picture. frames_in_flight: of
  // pictures. backend: as --backend has it. `wake` is called in this thread when there is news.
  PictureThread(std::function<std::unique_ptr<PictureDevice>()> make_device, int frames_in_flight, std::string backend,
                std::function<void()> wake);
  // Waits for the picture at hand, drops the one asked for.
  ~PictureThread();
  PictureThread(const PictureThread&) = delete;
  PictureThread& operator=(const PictureThread&) = delete;

  void ask(PictureRequest request);
  // For tests: the next picture fails as it would on a lost device.
  void loseDevice();
  // For tests: the next picture takes that much longer [s].
  void delay(double seconds);
  // Whether what was asked for last has not begun.
  bool waiting() const;

  struct News {
    std::shared_ptr<const Picture> picture;  // the last one finished since; may be null
    std::string problem;                     // what went wrong since, for the user; "" = nothing
    bool given_up = false;                   // the newest request will not come
  };
  News take();

 private:
  void run();

  const std::function<std::unique_ptr<PictureDevice>()> make_device_;
  const std::size_t frames_in_flight_;
  std::string backend_;  // of the thread, once it runs
  const std::function<void()> wake_;
  mutable std::mutex mutex_;  // guards all below but the thread
  std::condition_variable changed_;
  std::optional<PictureRequest> asked_;
  bool lose_ = false;
  double delay_ = 0;  // [s]
  bool stop_ = false;
  News news_;
  std::thread thread_;
};

}  // namespace tg
