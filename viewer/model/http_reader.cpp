// SPDX-License-Identifier: Apache-2.0
// cpp-httplib with a stream of our own: it bounds neither an answer's headers nor how long one may take.
#include "viewer/model/http_reader.h"

#include <httplib.h>
#include <poll.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <utility>

#include "core/file/file.h"
#include "core/system/error.h"

namespace tg {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint64_t kHeaderBytes = 64 << 10;  // of an answer, at most
constexpr std::string_view kScheme = "http://";

// A request and its answer on a connection that stays.
class BoundedStream : public httplib::Stream {
 public:
  // `most`: bytes of the whole answer.
  BoundedStream(int socket, std::uint64_t most, const std::stop_token& stop)
      : socket_(socket), most_(most), stop_(stop) {}

  bool is_readable() const override { return true; }
  bool is_writable() const override { return true; }
  socket_t socket() const override { return socket_; }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}

  // The library asks for single bytes.
  ssize_t read(char* out, std::size_t size) override {
    if (at_ == filled_) {
      if (read_ >= most_ || !ready(POLLIN)) return -1;
      const ssize_t got = ::recv(socket_, buffer_, std::min<std::uint64_t>(sizeof buffer_, most_ - read_), 0);
      if (got <= 0) return got;
      read_ += static_cast<std::uint64_t>(got);
      at_ = 0;
      filled_ = static_cast<std::size_t>(got);
    }
    const std::size_t some = std::min(size, filled_ - at_);
    std::copy_n(buffer_ + at_, some, out);
    at_ += some;
    return static_cast<ssize_t>(some);
  }

  ssize_t write(const char* bytes, std::size_t size) override {
    if (!ready(POLLOUT)) return -1;
    return ::send(socket_, bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
  }

 private:
  // In pieces, so that the end of the program is not held up.
  bool ready(short events) const {
    const auto until =
        std::min(start_ + std::chrono::seconds(kFetchSeconds), Clock::now() + std::chrono::seconds(kFetchStallSeconds));
    while (!stop_.stop_requested() && Clock::now() < until) {
      pollfd asked{socket_, events, 0};
      const int result = ::poll(&asked, 1, 100);
      if (result > 0) return true;
      if (result < 0 && errno != EINTR) return false;
    }
    return false;
  }

  const int socket_;
  const std::uint64_t most_;
  const std::stop_token& stop_;
  const Clock::time_point start_ = Clock::now();
  char buffer_[1 << 14];
  std::uint64_t read_ = 0;
  std::size_t at_ = 0, filled_ = 0;
};

[[noreturn]] void refuse(const std::string& address, const std::string& found) {
  throw tg::Error(ErrorKind::usage, address,
                  "unknown address" + expectedFound("http://HOST[:PORT]/FOLDER/FILE", printable(found)));
}

}  // namespace

class HttpReader::Client : public httplib::ClientImpl {
 public:
  Client(const std::string& host, int port) : httplib::ClientImpl(host, port) {
    set_keep_alive(true);
    set_decompress(false);
    set_connection_timeout(kConnectSeconds);
  }

  // Of the request at hand.
  std::uint64_t most = 0;
  std::stop_token stop;

 private:
  bool process_socket(const Socket& socket, std::function<bool(httplib::Stream&)> callback) override {
    // A body in chunks has a line a chunk beside it.
    BoundedStream stream(socket.sock, most + most / 8 + kHeaderBytes, stop);
    return callback(stream);
  }
};

HttpReader::HttpReader(const std::string& address) {
  if (!address.starts_with(kScheme)) refuse(address, address);
  const std::size_t slash = address.find('/', kScheme.size());
  if (slash == std::string::npos || slash == kScheme.size()) refuse(address, "no path");
  std::string host = address.substr(kScheme.size(), slash - kScheme.size());
  if (host.find('@') != std::string::npos) refuse(address, "a user's name");
  int port = 80;
  const std::size_t colon = host.rfind(':');
  if (colon != std::string::npos && host.find(']', colon) == std::string::npos) {
    const std::string digits = host.substr(colon + 1);
    if (digits.empty() || digits.size() > 5 || digits.find_first_not_of("0123456789") != std::string::npos) {
      refuse(address, "port \"" + digits + "\"");
    }
    port = std::atoi(digits.c_str());
    if (port < 1 || port > 65535) refuse(address, "port " + digits);
    host.resize(colon);
  }
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  if (host.empty()) refuse(address, "no host");
  base_ = address.substr(0, slash);
  const std::string path = address.substr(slash);
  if (path.find_first_of("?# \t\r\n") != std::string::npos) refuse(address, path);
  const std::size_t last = path.rfind('/');
  folder_ = path.substr(0, last + 1);
  file_ = path.substr(last + 1);
  client_ = std::make_unique<Client>(host, port);
}

HttpReader::~HttpReader() = default;

std::vector<std::uint8_t> HttpReader::read(const std::string& relative, std::uint64_t max_bytes,
                                           const std::stop_token& stop) {
  const std::string path = folder_ + (relative.empty() ? file_ : relative), name = base_ + path;
  client_->most = max_bytes;
  client_->stop = stop;
  std::vector<std::uint8_t> bytes;
  int status = 0;
  bool too_long = false;
  std::uint64_t promised = 0;
  const auto begin = [&](const httplib::Response& response) {
    status = response.status;
    promised = response.get_header_value<std::uint64_t>("Content-Length");
    too_long = promised > max_bytes;
    return status == 200 && !too_long;
  };
  const auto take = [&](const char* data, std::size_t size) {
    too_long = size > max_bytes - bytes.size();
    if (too_long) return false;
    bytes.insert(bytes.end(), data, data + size);
    return true;
  };
  const httplib::Result result = client_->Get(path, {{"Accept-Encoding", "identity"}}, begin, take);
  if (stop.stop_requested()) throw ReadCancelled();
  if (too_long) {
    throw tg::Error(ErrorKind::cannotRead, name, "is too long" + atMost(max_bytes, std::max(promised, max_bytes + 1)));
  }
  if (status != 0 && status != 200) {
    throw tg::Error(ErrorKind::cannotRead, name, "the server refuses it" + expectedFound(200, status));
  }
  if (!result) throw tg::Error(ErrorKind::cannotRead, name, "cannot be fetched: " + httplib::to_string(result.error()));
  return bytes;
}

}  // namespace tg
