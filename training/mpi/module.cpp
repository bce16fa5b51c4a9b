// SPDX-License-Identifier: Apache-2.0
// The channel of MPI: the one file that knows it. Ranks that wait sleep, as everything here does: others may need the
// processor.
#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "core/system/error.h"
#include "training/mpi/channel.h"

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kMostBytes = std::size_t{1} << 30;  // of a message: MPI counts in int
constexpr int kTag = 1;
// A rank that waits looks all the time at first, since data that lies in memory comes in pieces; then it sleeps for an
// eighth of what it has waited, so that a wait is not longer by more than that.
constexpr std::chrono::microseconds kAttentive(100), kLongestPause(2000);
constexpr int kPauseShare = 8;

void check(int result, const char* what) {
  if (result == MPI_SUCCESS) return;
  char text[MPI_MAX_ERROR_STRING] = {};
  int length = 0;
  MPI_Error_string(result, text, &length);
  throw tg::Error(tg::ErrorKind::device, "MPI",
                  std::string(what) + ": " + std::string(text, static_cast<std::size_t>(length)));
}

class MpiChannel final : public tg::Channel {
 public:
  MpiChannel() {
    int given = 0;
    check(MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &given), "cannot start");
    check(MPI_Comm_dup(MPI_COMM_WORLD, &comm_), "cannot start");
    check(MPI_Comm_set_errhandler(comm_, MPI_ERRORS_RETURN), "cannot start");
    check(MPI_Comm_rank(comm_, &rank_), "cannot start");
    check(MPI_Comm_size(comm_, &size_), "cannot start");
    MPI_Comm machine;
    check(MPI_Comm_split_type(comm_, MPI_COMM_TYPE_SHARED, rank_, MPI_INFO_NULL, &machine), "cannot start");
    check(MPI_Comm_size(machine, &on_this_machine_), "cannot start");
    check(MPI_Comm_free(&machine), "cannot start");
  }

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  int onThisMachine() const override { return on_this_machine_; }

  void exchange(std::span<const std::span<const std::byte>> to, std::span<const std::span<std::byte>> from) override {
    requests_.clear();
    for (int rank = 0; rank < size_; ++rank) {
      if (rank == rank_) continue;
      const std::span<std::byte> bytes = from[static_cast<std::size_t>(rank)];
      for (std::size_t at = 0; at < bytes.size(); at += kMostBytes) {
        const int count = static_cast<int>(std::min(kMostBytes, bytes.size() - at));
        check(MPI_Irecv(bytes.data() + at, count, MPI_BYTE, rank, kTag, comm_, &requests_.emplace_back()), "receive");
      }
    }
    for (int step = 1; step < size_; ++step) {  // not all to the same rank at once
      const int rank = (rank_ + step) % size_;
      const std::span<const std::byte> bytes = to[static_cast<std::size_t>(rank)];
      for (std::size_t at = 0; at < bytes.size(); at += kMostBytes) {
        const int count = static_cast<int>(std::min(kMostBytes, bytes.size() - at));
        check(MPI_Isend(bytes.data() + at, count, MPI_BYTE, rank, kTag, comm_, &requests_.emplace_back()), "send");
      }
    }
    const std::span<const std::byte> own = to[static_cast<std::size_t>(rank_)];
    if (!own.empty()) std::memcpy(from[static_cast<std::size_t>(rank_)].data(), own.data(), own.size());
    wait();
  }

  void finish() override { check(MPI_Finalize(), "cannot end"); }
  [[noreturn]] void abort(int code) noexcept override {
    MPI_Abort(comm_, code);
    std::_Exit(code);
  }

 private:
  void wait() {
    const Clock::time_point begin = Clock::now();
    for (;;) {
      int done = 0;
      check(MPI_Testall(static_cast<int>(requests_.size()), requests_.data(), &done, MPI_STATUSES_IGNORE), "exchange");
      if (done != 0) return;
      const Clock::duration waited = Clock::now() - begin;
      if (waited < kAttentive) {
        std::this_thread::yield();
      } else {
        std::this_thread::sleep_for(std::min<Clock::duration>(waited / kPauseShare, kLongestPause));
      }
    }
  }

  MPI_Comm comm_ = MPI_COMM_NULL;
  int rank_ = 0, size_ = 1, on_this_machine_ = 1;
  std::vector<MPI_Request> requests_;
};

}  // namespace

extern "C" {
__attribute__((visibility("default"))) tg::Channel* tgOpenChannel() { return new MpiChannel; }
__attribute__((visibility("default"))) const char* tgChannelVersion() { return TG_VERSION; }
}
