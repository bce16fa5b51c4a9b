// SPDX-License-Identifier: Apache-2.0
// A small HTTP server for requests that only read: bounded in bytes, time and connections.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace tg {

struct HttpRequest {
  std::string path;  // decoded, without what follows "?"
  std::string host;  // the headers of these names; "": none
  std::string authorization;
  std::function<std::string(const char* name)> query;  // a parameter of the address; "": none
};

struct HttpAnswer {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string text;                                             // compressed where the client asks for it
  std::shared_ptr<const std::vector<std::uint8_t>> bytes = {};  // instead of it, as they are
  std::function<void()> sent = {};                              // called when the client has them all
};

// What a request may cost.
constexpr std::size_t kMaxRequestBytes = 16 << 10;
constexpr int kRequestSeconds = 10;  // from the connection to the end of the request
constexpr int kAnswerSeconds = 600;  // to the end of the answer
constexpr int kStallSeconds = 20;    // without a byte taken
constexpr int kServedAtOnce = 16;    // connections; as many more wait

class HttpServer {
 public:
  using Answer = std::function<HttpAnswer(const HttpRequest&)>;

  // Serves GET and HEAD in threads of its own; `answer` is called in several of them at once. `host`: an address or a
  // name of this machine. Port 0: a free one. Throws Error(device) where it cannot listen.
  HttpServer(const std::string& host, int port, Answer answer);
  ~HttpServer();  // does not wait for slow clients
  HttpServer& operator=(HttpServer&&) = delete;

  int port() const;

 private:
  class Server;
  std::unique_ptr<Server> server_;
};

}  // namespace tg
