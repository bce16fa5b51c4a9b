// SPDX-License-Identifier: Apache-2.0
// A socket for cpp-httplib, which bounds neither headers nor how long a request or an answer may take.
#pragma once
#include <httplib.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <utility>

namespace tg {

struct StreamLimits {
  std::uint64_t most_read = 0;                          // [bytes]
  int read_seconds = 0, write_seconds = 0;              // from the beginning of the stream
  int read_stall_seconds = 0, write_stall_seconds = 0;  // without a byte
  std::uint64_t most_line = std::numeric_limits<std::uint64_t>::max();  // [bytes] of a head
};

// Why nothing more was read: the other side closed it, `read_stall_seconds` or `read_seconds` were over, its bytes or
// those of a line.
enum class StreamEnd { none, closed, stalled, late, spent, line };

// Whether poll() has one of `events` to tell of that socket before then. `stopped`, asked ten times a second, ends the
// wait, too.
inline bool waitFor(int socket, short events, std::chrono::steady_clock::time_point until,
                    const std::function<bool()>& stopped) {
  while (!stopped() && std::chrono::steady_clock::now() < until) {
    pollfd asked{socket, events, 0};
    const int result = ::poll(&asked, 1, 100);
    if (result > 0) return true;
    if (result < 0 && errno != EINTR) return false;
  }
  return false;
}

// A request and its answer on a connection that stays open. `stopped`: as of waitFor().
class BoundedStream : public httplib::Stream {
 public:
  BoundedStream(int socket, const StreamLimits& limits, std::function<bool()> stopped)
      : socket_(socket), limits_(limits), stopped_(std::move(stopped)) {}

  bool is_readable() const override { return true; }
  bool is_writable() const override { return true; }
  socket_t socket() const override { return socket_; }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  StreamEnd ended() const { return ended_; }

  // The library asks for single bytes.
  ssize_t read(char* out, std::size_t size) override {
    if (at_ == filled_) {
      if (read_ >= limits_.most_read) return end(StreamEnd::spent, -1);
      if (!ready(POLLIN, limits_.read_seconds, limits_.read_stall_seconds)) {
        const bool late = Clock::now() >= start_ + std::chrono::seconds(limits_.read_seconds);
        return end(late ? StreamEnd::late : StreamEnd::stalled, -1);
      }
      const auto most = std::min<std::uint64_t>(sizeof buffer_, limits_.most_read - read_);
      const ssize_t got = ::recv(socket_, buffer_, most, 0);
      if (got <= 0) return end(StreamEnd::closed, got);
      read_ += static_cast<std::uint64_t>(got);
      at_ = 0;
      filled_ = static_cast<std::size_t>(got);
    }
    const std::size_t some = std::min(size, filled_ - at_);
    std::copy_n(buffer_ + at_, some, out);
    at_ += some;
    if (!endsLines(out, static_cast<std::size_t>(some))) return end(StreamEnd::line, -1);
    return static_cast<ssize_t>(some);
  }

  ssize_t write(const char* bytes, std::size_t size) override {
    if (!ready(POLLOUT, limits_.write_seconds, limits_.write_stall_seconds)) return -1;
    return ::send(socket_, bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
  }

 private:
  using Clock = std::chrono::steady_clock;

  ssize_t end(StreamEnd reason, ssize_t result) {
    ended_ = reason;
    return result;
  }

  // Whether lines of heads are short enough: a head ends with an empty one, and another follows one of status 1xx.
  bool endsLines(const char* bytes, std::size_t size) {
    constexpr std::uint64_t kStatusAt = 9;  // behind "HTTP/1.1 "
    for (std::size_t i = 0; in_head_ && i < size; ++i) {
      if (bytes[i] != '\n') {
        if (first_line_ && line_ == kStatusAt) status_ = bytes[i];
        if (++line_ > limits_.most_line) return false;
        continue;
      }
      const bool empty = line_ <= 1;
      if (empty && !first_line_) in_head_ = status_ == '1';
      first_line_ = empty;
      line_ = 0;
    }
    return true;
  }

  bool ready(short events, int seconds, int stall_seconds) const {
    const auto until =
        std::min(start_ + std::chrono::seconds(seconds), Clock::now() + std::chrono::seconds(stall_seconds));
    return waitFor(socket_, events, until, stopped_);
  }

  const int socket_;
  const StreamLimits limits_;
  const std::function<bool()> stopped_;
  const Clock::time_point start_ = Clock::now();
  char buffer_[1 << 14];
  std::uint64_t read_ = 0;
  std::size_t at_ = 0, filled_ = 0;
  StreamEnd ended_ = StreamEnd::none;
  bool in_head_ = true, first_line_ = true;
  char status_ = 0;         // the first digit
  std::uint64_t line_ = 0;  // [bytes] so far
};

}  // namespace tg
