// SPDX-License-Identifier: Apache-2.0
// cpp-httplib with sockets of our own: it bounds neither a request's headers nor how long one may take.
#include "converter/serve/http.h"

#include <httplib.h>
#include <poll.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <utility>

#include "core/system/error.h"
#include "core/system/worker.h"

namespace tg {
namespace {

using Clock = std::chrono::steady_clock;

// One connection, which carries one request.
class BoundedStream : public httplib::Stream {
 public:
  BoundedStream(int socket, const std::atomic<bool>& stopping) : socket_(socket), stopping_(stopping) {}

  bool is_readable() const override { return true; }
  bool is_writable() const override { return true; }
  socket_t socket() const override { return socket_; }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}

  // The library asks for single bytes.
  ssize_t read(char* out, std::size_t size) override {
    if (at_ == filled_) {
      if (read_ >= kMaxRequestBytes || !ready(POLLIN, start_ + std::chrono::seconds(kRequestSeconds))) return -1;
      const ssize_t got = ::recv(socket_, buffer_, std::min(sizeof buffer_, kMaxRequestBytes - read_), 0);
      if (got <= 0) return got;
      read_ += static_cast<std::size_t>(got);
      at_ = 0;
      filled_ = static_cast<std::size_t>(got);
    }
    const std::size_t some = std::min(size, filled_ - at_);
    std::copy_n(buffer_ + at_, some, out);
    at_ += some;
    return static_cast<ssize_t>(some);
  }

  ssize_t write(const char* bytes, std::size_t size) override {
    const auto stalled = Clock::now() + std::chrono::seconds(kStallSeconds);
    if (!ready(POLLOUT, std::min(start_ + std::chrono::seconds(kAnswerSeconds), stalled))) return -1;
    return ::send(socket_, bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
  }

 private:
  // In pieces, so that the end of the program is not held up.
  bool ready(short events, Clock::time_point until) const {
    while (!stopping_ && Clock::now() < until) {
      pollfd asked{socket_, events, 0};
      const int result = ::poll(&asked, 1, 100);
      if (result > 0) return true;
      if (result < 0 && errno != EINTR) return false;
    }
    return false;
  }

  const int socket_;
  const std::atomic<bool>& stopping_;
  const Clock::time_point start_ = Clock::now();
  char buffer_[4096];
  std::size_t read_ = 0, at_ = 0, filled_ = 0;
};

// A bounded queue before a fixed number of threads; while it is full, the system keeps new connections waiting.
class BoundedPool : public httplib::TaskQueue {
 public:
  BoundedPool() : tasks_(kServedAtOnce) {
    for (int i = 0; i < kServedAtOnce; ++i) {
      threads_.emplace_back([this] {
        while (const auto task = tasks_.take()) (*task)();
      });
    }
  }
  void enqueue(std::function<void()> task) override { tasks_.give(std::move(task)); }
  void shutdown() override {
    tasks_.close();
    threads_.clear();
  }

 private:
  Queue<std::function<void()>> tasks_;
  std::vector<std::jthread> threads_;
};

HttpAnswer refusal(int status, const std::string& why) { return {.status = status, .text = why + "\n"}; }

HttpAnswer answerTo(const httplib::Request& request, const HttpServer::Answer& answer) {
  if (request.method != "GET" && request.method != "HEAD") return refusal(405, "this server is only read from");
  // A thousand ranges of one text would be a thousand copies of it.
  if (request.has_header("Range")) return refusal(416, "ranges are not served");
  try {
    return answer({request.path, request.get_header_value("Host"), request.get_header_value("Authorization"),
                   [&](const char* name) { return request.get_param_value(name); }});
  } catch (const std::exception& error) {
    return refusal(500, printable(error.what()));
  }
}

}  // namespace

class HttpServer::Server : public httplib::Server {
 public:
  Server(const std::string& host, int port, Answer answer) : answer_(std::move(answer)) {
    new_task_queue = [] { return new BoundedPool; };
    // The library's own options let two programs share a port.
    set_socket_options([](socket_t socket) {
      const int yes = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
    set_default_headers(
        {{"Cache-Control", "no-store"},
         {"Content-Security-Policy",
          "default-src 'none'; script-src 'unsafe-inline' blob:; worker-src blob:; style-src 'unsafe-inline'; "
          "img-src blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
         {"Cross-Origin-Resource-Policy", "same-origin"},
         {"Referrer-Policy", "no-referrer"},
         {"X-Content-Type-Options", "nosniff"}});
    set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      give(answerTo(request, answer_), response);
      return HandlerResponse::Handled;
    });
    errno = 0;
    port_ = port == 0 ? bind_to_any_port(host) : bind_to_port(host, port) ? port : -1;
    if (port_ < 0) {
      const std::string reason = errno != 0 ? systemReason() : "no such address on this machine";
      throw tg::Error(ErrorKind::device, host + ":" + std::to_string(port), "cannot listen here: " + reason);
    }
    thread_ = std::jthread([this] {
      listen_after_bind();
      ended_ = true;
    });
    while (!is_running() && !ended_) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ~Server() override {
    stopping_ = true;
    stop();
    if (thread_.joinable()) thread_.join();
  }

  int port() const { return port_; }

 private:
  bool process_and_close_socket(socket_t socket) override {
    BoundedStream stream(socket, stopping_);
    bool closed = false;
    const bool done = process_request(stream, true, closed, nullptr);
    ::shutdown(socket, SHUT_RDWR);
    ::close(socket);
    return done;
  }

  void give(HttpAnswer answer, httplib::Response& response) const {
    response.status = answer.status;
    if (!answer.bytes) {
      response.set_content(answer.text, answer.type);
      return;
    }
    if (answer.bytes->empty()) return;
    response.set_content_provider(
        answer.bytes->size(), answer.type,
        [bytes = answer.bytes](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
          constexpr std::size_t kPiece = 1 << 16;
          return sink.write(reinterpret_cast<const char*>(bytes->data()) + offset, std::min(length, kPiece));
        });
  }

  const Answer answer_;
  std::atomic<bool> stopping_{false}, ended_{false};
  int port_ = -1;
  std::jthread thread_;
};

HttpServer::HttpServer(const std::string& host, int port, Answer answer)
    : server_(std::make_unique<Server>(host, port, std::move(answer))) {}
HttpServer::~HttpServer() = default;
int HttpServer::port() const { return server_->port(); }

}  // namespace tg
