// SPDX-License-Identifier: Apache-2.0
// A thread that draws pictures, so that the window answers however long one takes.
#pragma once
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "core/system/worker.h"
#include "viewer/picture/picture.h"

namespace tg {

constexpr std::chrono::milliseconds kLongestDeviceRest = std::chrono::minutes(5);

// Draws the newest request; one that has not begun when the next comes is dropped. Where two pictures may be in
// flight, the second is recorded shortly before the device is expected to be done with the first: so late,
// because a request that has begun no longer gives way to a newer one. When the device fails, for want of memory for
// one view, say, it says so and goes on with the CPU renderer; after a while it tries the device again. All members may
// be called from one other thread, none of them waits for a picture. Its destructor waits for the picture at hand and
// drops the one asked for.
class PictureThread {
 public:
  // `make_device` is called in this thread; what it draws on must outlive this and every picture. frames_in_flight: of
  // pictures. backend: as --backend has it. `wake` is called in this thread when there is news. device_rest: how long a
  // device that failed is left alone; twice as long each time that it fails again, up to kLongestDeviceRest.
  PictureThread(std::function<std::unique_ptr<PictureDevice>()> make_device, int frames_in_flight, std::string backend,
                std::function<void()> wake, std::chrono::milliseconds device_rest = std::chrono::seconds(5));

  void ask(PictureRequest request);
  // Lets go of the memory of models that nobody else holds any more, on host and device; what was asked for stays.
  void tidy();
  // Whether what was asked for last has not begun.
  bool waiting() const { return !asked_.empty(); }

  struct News {
    std::shared_ptr<const Picture> picture;  // the last one finished since; may be null
    std::string problem;                     // what went wrong since, for the user; "" = nothing
    bool given_up = false;                   // the newest request will not come
  };
  News take();

 private:
  struct Asked {
    std::optional<PictureRequest> request;  // none: tidy()
    std::uint64_t number = 0;
  };
  struct Result {
    std::shared_ptr<const Picture> picture;
    std::string problem;
    std::uint64_t given_up = 0;  // the last request that will not come; 0: none
  };
  void run(const std::stop_token& stop);

  const std::function<std::unique_ptr<PictureDevice>()> make_device_;
  const std::size_t frames_in_flight_;
  const std::string backend_;
  const std::chrono::milliseconds device_rest_;
  std::uint64_t asked_number_ = 0;
  LatestValue<Asked> asked_;
  LatestValue<Result> results_;
  std::jthread thread_;
};

}  // namespace tg
