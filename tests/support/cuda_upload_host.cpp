// SPDX-License-Identifier: Apache-2.0
// A copy beside the kernels at its most inconvenient: from begin() to acquire() the buffer holds no numbers, and what
// the turns of upload.h forbid throws.
#include <algorithm>
#include <stdexcept>
#include <vector>

#include "cuda_check.h"
#include "training/cuda/memory.h"
#include "training/cuda/upload.h"

namespace tg::cuda {

struct StreamedBuffer::State {
  enum class Turn { begin, acquire, release };
  Turn turn = Turn::begin;
  std::vector<std::uint8_t> staging;
  Buffer<std::uint8_t> buffer;

  void take(Turn now, Turn next) {
    if (turn != now) throw std::logic_error("a streamed buffer is used out of turn");
    turn = next;
  }
};

StreamedBuffer::StreamedBuffer() : state_(std::make_unique<State>()) {}
StreamedBuffer::~StreamedBuffer() = default;

void StreamedBuffer::begin(std::span<const std::uint8_t> first, std::span<const std::uint8_t> second) {
  state_->take(State::Turn::begin, State::Turn::acquire);
  state_->staging.assign(first.begin(), first.end());
  state_->staging.insert(state_->staging.end(), second.begin(), second.end());
  state_->buffer.resize(state_->staging.size());
  std::fill_n(state_->buffer.data(), state_->staging.size(), std::uint8_t{0xff});
  check::forget(state_->buffer.data(), state_->staging.size());
}
void StreamedBuffer::acquire() {
  state_->take(State::Turn::acquire, State::Turn::release);
  check::wrote(state_->buffer.data(), state_->staging.size());
  std::copy(state_->staging.begin(), state_->staging.end(), state_->buffer.data());
}
// What a kernel reads from here on may be the next copy.
void StreamedBuffer::release() {
  state_->take(State::Turn::release, State::Turn::begin);
  check::forget(state_->buffer.data(), state_->staging.size());
}
const std::uint8_t* StreamedBuffer::data() const { return state_->buffer.data(); }

}  // namespace tg::cuda
