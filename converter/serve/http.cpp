// SPDX-License-Identifier: Apache-2.0
// cpp-httplib on bounded streams.
#include "converter/serve/http.h"

#include <httplib.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "converter/serve/bounded_stream.h"
#include "core/system/error.h"
#include "core/system/worker.h"

namespace tg {
namespace {

// One request a connection.
constexpr StreamLimits kLimits{.most_read = kMaxRequestBytes,
                               .read_seconds = kRequestSeconds,
                               .write_seconds = kAnswerSeconds,
                               .read_stall_seconds = kRequestSeconds,
                               .write_stall_seconds = kStallSeconds};

// A bounded queue before a fixed number of threads; while it is full, the system keeps new connections waiting.
class BoundedPool : public httplib::TaskQueue {
  using Enqueued = decltype(std::declval<httplib::TaskQueue&>().enqueue({}));  // void in Debian 12's version

 public:
  // Throws std::system_error where there are no threads.
  BoundedPool() : tasks_(kServedAtOnce) {
    try {
      for (int i = 0; i < kServedAtOnce; ++i) {
        threads_.emplace_back([this] {
          while (const auto task = tasks_.take()) (*task)();
        });
      }
    } catch (...) {
      end();
      throw;
    }
  }
  ~BoundedPool() override { end(); }
  Enqueued enqueue(std::function<void()> task) override {
    tasks_.give(std::move(task));
    return static_cast<Enqueued>(true);
  }
  void shutdown() override { end(); }

 private:
  void end() {
    tasks_.close();
    threads_.clear();
  }

  Queue<std::function<void()>> tasks_;
  std::vector<std::jthread> threads_;
};

HttpAnswer refusal(int status, const std::string& why) { return {.status = status, .text = why + "\n"}; }

HttpAnswer answerTo(const httplib::Request& request, const HttpServer::Answer& answer) {
  if (request.method != "GET" && request.method != "HEAD") return refusal(405, "this server is only read from");
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
    new_task_queue = [this] { return pool_.release(); };
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
      // Who asks for a range gets the whole: a thousand of one text would be a thousand copies of it. What the library
      // calls const it made for this answer.
      const_cast<httplib::Request&>(request).ranges.clear();
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
    BoundedStream stream(socket, kLimits, [this] { return stopping_.load(); });
    const bool done = process(*this, stream);
    ::shutdown(socket, SHUT_RDWR);
    ::close(socket);
    return done;
  }

  // Newer versions of cpp-httplib, as Debian 13's, ask for the addresses of both ends, which no answer depends on.
  static bool process(auto& server, httplib::Stream& stream) {
    bool closed = false;
    if constexpr (requires { server.process_request(stream, true, closed, nullptr); }) {
      return server.process_request(stream, true, closed, nullptr);
    } else {
      return server.process_request(stream, "", 0, "", 0, true, closed, nullptr);
    }
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
        },
        [sent = std::move(answer.sent)](bool all) {
          if (all && sent) sent();
        });
  }

  const Answer answer_;
  std::atomic<bool> stopping_{false}, ended_{false};
  std::unique_ptr<BoundedPool> pool_ = std::make_unique<BoundedPool>();  // until the library takes it, in thread_
  int port_ = -1;
  std::jthread thread_;
};

HttpServer::HttpServer(const std::string& host, int port, Answer answer)
    : server_(std::make_unique<Server>(host, port, std::move(answer))) {}
HttpServer::~HttpServer() = default;
int HttpServer::port() const { return server_->port(); }

}  // namespace tg
