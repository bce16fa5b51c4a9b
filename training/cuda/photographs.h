// SPDX-License-Identifier: Apache-2.0
// The photographs of a training run on the device: kept while there is room, else sent for their step, beside the
// kernels of the steps before it.
#pragma once
#include <array>
#include <memory>
#include <unordered_map>

#include "training/cuda/memory.h"
#include "training/cuda/upload.h"
#include "training/data/photographs.h"

namespace tg::cuda {

class DevicePhotographs {
 public:
  using Pixels = std::shared_ptr<const ViewPixels>;
  // What the loss reads; as in LossInput.
  struct OnDevice {
    const std::uint8_t* rgb;
    const std::uint8_t* mask;
    double counted;
  };

  // Whether get() needs no photograph of this view; to the end, once it is so.
  bool has(std::size_t view, bool varies) const { return !varies && kept_.contains(view); }
  // For kernels launched until release(). One that does not vary is kept while a quarter of the memory is free.
  OnDevice get(std::size_t view, const Pixels& photograph, bool varies);
  void release();

 private:
  struct Kept {
    Buffer<std::uint8_t> bytes;  // rgb, then the mask
    OnDevice view;
  };

  std::unordered_map<std::size_t, Kept> kept_;
  bool full_ = false;
  std::array<StreamedBuffer, 2> slots_;
  std::size_t current_ = 0;  // of the slots: the one of the next get()
  bool in_use_ = false;      // the current one, by kernels
};

}  // namespace tg::cuda
