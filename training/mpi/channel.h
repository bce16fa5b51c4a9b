// SPDX-License-Identifier: Apache-2.0
// How the processes of one training reach each other. The one behind MPI is a module of its own (module.cpp), which is
// loaded where mpirun has started the program; tests have one between threads.
#pragma once
#include <cstddef>
#include <span>

namespace tg {

class Channel {
 public:
  virtual ~Channel() = default;
  virtual int rank() const = 0;  // in [0, size())
  virtual int size() const = 0;
  virtual int onThisMachine() const = 0;  // how many of them, this one included

  // Sends to[r] to rank r and receives its message in from[r], this rank's own among them; [size()] both. All ranks
  // call it, and each knows how long what it receives is. Throws Error(device).
  virtual void exchange(std::span<const std::span<const std::byte>> to, std::span<const std::span<std::byte>> from) = 0;

  // All ranks call it, last of all. Throws Error(device).
  virtual void finish() = 0;
  // Ends the processes of all ranks; the program that started them exits with `code`.
  [[noreturn]] virtual void abort(int code) noexcept = 0;
};

// What the module has, by these names: what opens the channel, or throws Error(device), and the version that it is of.
using OpenChannel = Channel*();
constexpr const char* kOpenChannelName = "tgOpenChannel";
using ChannelVersion = const char*();
constexpr const char* kChannelVersionName = "tgChannelVersion";

}  // namespace tg
