// SPDX-License-Identifier: Apache-2.0
// Files over HTTP, from the project's own server and from sockets that mean no good.
#include "viewer/model/http_reader.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "converter/serve/http.h"
#include "core/file/file.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;
using test::messageOf;

namespace {

using Bytes = std::vector<std::uint8_t>;

// Serves /scene/a.bin (1000 bytes), /scene/b/c.bin (3 bytes), one with other signs (2 bytes), and nothing else.
HttpServer makeServer() {
  return HttpServer("127.0.0.1", 0, [](const HttpRequest& request) -> HttpAnswer {
    const auto bytes = [](std::size_t count) { return std::make_shared<const Bytes>(count, std::uint8_t{7}); };
    if (request.path == "/scene/a.bin") return {.text = {}, .bytes = bytes(1000)};
    if (request.path == "/scene/b/c.bin") return {.text = {}, .bytes = bytes(3)};
    if (request.path == "/scene/a b/(1)+\u00e9.bin") return {.text = {}, .bytes = bytes(2)};
    return {.status = 404, .text = "no", .bytes = {}};
  });
}

// A socket of this machine alone, at that port or any (0), with so many connections that nobody has accepted yet.
int opened(int& port, int waiting = 4) {
  const int made = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int again = 1;
  (void)::setsockopt(made, SOL_SOCKET, SO_REUSEADDR, &again, sizeof again);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  socklen_t size = sizeof address;
  auto* const place = reinterpret_cast<sockaddr*>(&address);
  if (::bind(made, place, size) != 0 || ::listen(made, waiting) != 0 || ::getsockname(made, place, &size) != 0)
    return -1;
  port = ntohs(address.sin_port);
  return made;
}

int listening(int& port, int waiting = 4) {
  const int made = opened(port, waiting);
  REQUIRE(made >= 0);
  return made;
}

// Keeps no connection, and does not say so.
class ClosingServer {
 public:
  ClosingServer() {
    socket_ = listening(port_);
    thread_ = std::jthread([this] {
      for (int client; (client = ::accept(socket_, nullptr, nullptr)) >= 0; ++connections) {
        char asked[4096];
        const std::string answer = "HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nabc";
        if (::recv(client, asked, sizeof asked, 0) > 0)
          (void)::send(client, answer.data(), answer.size(), MSG_NOSIGNAL);
        // The next request comes before it ends, too.
        (void)::recv(client, asked, sizeof asked, 0);
        ::close(client);
      }
    });
  }
  ~ClosingServer() {
    ::shutdown(socket_, SHUT_RDWR);
    thread_.join();
    ::close(socket_);
  }
  ClosingServer& operator=(ClosingServer&&) = delete;

  std::string address() const { return "http://127.0.0.1:" + std::to_string(port_) + "/scene/a.bin"; }
  std::atomic<int> connections{0};

 private:
  int socket_ = -1;
  int port_ = 0;
  std::jthread thread_;
};

// Answers each connection with its head, those beyond with the last one, then `times` times with `rest`, and closes it
// at once or when the client or the server ends.
class RawServer {
 public:
  RawServer(const std::string& head, const std::string& rest, std::size_t times, bool holds)
      : RawServer(std::vector{head}, rest, times, holds) {}
  RawServer(std::vector<std::string> heads, std::string rest, std::size_t times, bool holds) {
    socket_ = listening(port_);
    thread_ = std::jthread([this, heads, rest, times, holds](const std::stop_token& stop) {
      for (int client; (client = ::accept(socket_, nullptr, nullptr)) >= 0;) {
        const std::string& head =
            heads[std::min<std::size_t>(static_cast<std::size_t>(connections++), heads.size() - 1)];
        char asked[4096];
        if (::recv(client, asked, sizeof asked, 0) > 0) (void)::send(client, head.data(), head.size(), MSG_NOSIGNAL);
        for (std::size_t i = 0; i < times; ++i) {
          if (::send(client, rest.data(), rest.size(), MSG_NOSIGNAL) <= 0) break;
        }
        while (holds && !stop.stop_requested() && ::recv(client, asked, sizeof asked, MSG_DONTWAIT) != 0) {
          std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        ::close(client);
      }
    });
  }
  ~RawServer() {
    thread_.request_stop();
    ::shutdown(socket_, SHUT_RDWR);
    thread_.join();
    ::close(socket_);
  }
  RawServer& operator=(RawServer&&) = delete;

  std::string address() const { return "http://127.0.0.1:" + std::to_string(port_) + "/scene/a.bin"; }
  std::atomic<int> connections{0};

 private:
  int socket_ = -1;
  int port_ = 0;
  std::jthread thread_;
};

// Answers once with that, is gone, and after `away`, if that is not 0, answers once more, with "abc".
class RestartedServer {
 public:
  RestartedServer(const std::string& first, std::chrono::milliseconds away) {
    const int socket = listening(port_);
    thread_ = std::jthread([this, socket, first, away] {
      answerOnce(socket, first);
      if (away.count() == 0) return;
      std::this_thread::sleep_for(away);
      answerOnce(opened(port_), kWhole);
    });
  }

  std::string address() const { return "http://127.0.0.1:" + std::to_string(port_) + "/scene/a.bin"; }

  static constexpr const char* kWhole = "HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nabc";

 private:
  static void answerOnce(int socket, const std::string& answer) {
    const int client = ::accept(socket, nullptr, nullptr);
    ::close(socket);
    char asked[4096];
    if (::recv(client, asked, sizeof asked, 0) > 0) (void)::send(client, answer.data(), answer.size(), MSG_NOSIGNAL);
    ::close(client);
  }

  int port_ = 0;
  std::jthread thread_;
};

// Accepts nothing, and has no room for another one that waits to be accepted.
class FullServer {
 public:
  FullServer() : socket_(listening(port_, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port_));
    for (bool connects = true; connects;) {
      const int client = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
      REQUIRE(client >= 0);
      clients_.push_back(client);
      connects = ::connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
      pollfd asked{client, POLLOUT, 0};
      connects = connects || ::poll(&asked, 1, 200) > 0;
    }
  }
  ~FullServer() {
    for (const int client : clients_) ::close(client);
    ::close(socket_);
  }
  FullServer& operator=(FullServer&&) = delete;

  std::string address() const { return "http://127.0.0.1:" + std::to_string(port_) + "/scene/a.bin"; }

 private:
  int port_ = 0;
  int socket_ = -1;
  std::vector<int> clients_;
};

std::string addressOf(const HttpServer& server, const std::string& path) {
  return "http://127.0.0.1:" + std::to_string(server.port()) + path;
}

}  // namespace

TEST_CASE("files come over HTTP as they are, the address's own and those beside it") {
  const HttpServer server = makeServer();
  HttpReader reader(addressOf(server, "/scene/a.bin"));
  CHECK(reader.read("", 1000, {}) == Bytes(1000, 7));
  CHECK(reader.read("b/c.bin", 1000, {}) == Bytes(3, 7));
  CHECK(reader.read("a.bin", 1000, {}) == Bytes(1000, 7));
  CHECK(reader.read("a b/(1)+\u00e9.bin", 1000, {}) == Bytes(2, 7));
}

TEST_CASE("a server that closes the connection that it kept is asked once more on another one") {
  ClosingServer server;
  HttpReader reader(server.address());
  for (int k = 0; k < 4; ++k) CHECK(reader.read("", 1000, {}) == Bytes({'a', 'b', 'c'}));
  CHECK(server.connections >= 3);
}

TEST_CASE("a file over HTTP is asked for twice more where its connection ends early or the server has none now") {
  const std::string whole = "HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nabc";
  const std::string cut = "HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nx";
  const auto refused = [](int status) {
    return "HTTP/1.1 " + std::to_string(status) + " No\r\nContent-Encoding: gzip\r\nContent-Length: 900\r\n\r\nno";
  };
  for (const std::vector<std::string>& heads : {std::vector{cut, cut, whole},
                                                {std::string(), whole},
                                                {refused(502), cut, whole},
                                                {refused(503), refused(504), whole}}) {
    INFO(heads.front());
    const RawServer server(heads, "", 0, false);
    HttpReader reader(server.address());
    CHECK(reader.read("", 100, {}) == Bytes({'a', 'b', 'c'}));
    CHECK(server.connections == static_cast<int>(heads.size()));
  }
  const auto tries = [](const std::string& head, const std::string& said) {
    INFO(head);
    const RawServer server(head, "", 0, false);
    HttpReader reader(server.address());
    const auto asked = std::chrono::steady_clock::now();
    CHECK_THAT(messageOf([&] { reader.read("", 100, {}); }, ErrorKind::cannotRead), Contains(said));
    if (server.connections > 1) CHECK(std::chrono::steady_clock::now() - asked >= std::chrono::milliseconds(1500));
    return server.connections.load();
  };
  CHECK(tries(cut, "cannot be fetched: the answer ends early") == 3);
  CHECK(tries(refused(503), "the server refuses it (expected 200, found 503)") == 3);
  CHECK(tries(refused(404), "the server refuses it (expected 200, found 404)") == 1);
  CHECK(tries(refused(500), "the server refuses it (expected 200, found 500)") == 1);
  CHECK(tries("SSH-2.0-OpenSSH_9.2\r\n", "cannot be fetched: the answer is not HTTP") == 1);
}

TEST_CASE("a file over HTTP is asked for again where the server is started anew") {
  const std::string busy = "HTTP/1.1 503 No\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
  constexpr std::chrono::milliseconds kAway(200);
  const Bytes abc = {'a', 'b', 'c'};
  const RestartedServer whole(RestartedServer::kWhole, kAway), passing(busy, kAway), gone(busy, {});
  HttpReader second(whole.address()), first(passing.address()), never(gone.address());
  for (int k = 0; k < 2; ++k) CHECK(second.read("", 100, {}) == abc);
  CHECK(first.read("", 100, {}) == abc);
  CHECK_THAT(messageOf([&] { never.read("", 100, {}); }, ErrorKind::cannotRead), Contains("nobody answers there"));
  CHECK(never.answered());
}

TEST_CASE("what does not come over HTTP is named in a line") {
  const HttpServer server = makeServer();
  HttpReader reader(addressOf(server, "/scene/a.bin"));
  const std::string folder = addressOf(server, "/scene/");
  const auto said = [](HttpReader& from, const std::string& file, std::uint64_t most) {
    return messageOf([&] { from.read(file, most, {}); }, ErrorKind::cannotRead);
  };
  CHECK(said(reader, "", 999) == folder + "a.bin: is too long (expected at most 999, found 1000)");
  CHECK(said(reader, "none", 999) == folder + "none: the server refuses it (expected 200, found 404)");
  CHECK(said(reader, "none", 1) == folder + "none: the server refuses it (expected 200, found 404)");
  CHECK(reader.read("b/c.bin", 3, {}) == Bytes(3, 7));  // the connection is none the worse
  HttpReader nobody("http://127.0.0.1:1/scene/a.bin");
  CHECK_THAT(said(nobody, "", 1), Contains("http://127.0.0.1:1/scene/a.bin: cannot be fetched: nobody answers there"));
  const RawServer cut("HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nshort", "", 0, false);
  HttpReader half(cut.address());
  CHECK_THAT(said(half, "", 1000), Contains("/scene/a.bin: cannot be fetched: the answer ends early"));
  const RawServer silent("", "", 0, true);
  HttpReader waiting(silent.address(), 1);
  CHECK(said(waiting, "", 1000) == silent.address() + ": cannot be fetched: no answer within 1 s");
  const RawServer closing("", "", 0, false);
  HttpReader hung_up(closing.address(), 1);
  CHECK(said(hung_up, "", 1000) == closing.address() + ": cannot be fetched: the answer ends early");
}

TEST_CASE("why an answer over HTTP is not whole is told apart") {
  const auto said = [](const std::string& head, const std::string& rest, std::size_t times) {
    const RawServer server(head, rest, times, true);
    HttpReader reader(server.address(), 1);
    const std::string text = messageOf([&] { reader.read("", 100'000, {}); }, ErrorKind::cannotRead);
    const std::string before = server.address() + ": cannot be fetched: ";
    REQUIRE(text.starts_with(before));
    return text.substr(before.size());
  };
  const std::string ok = "HTTP/1.1 200 OK\r\n";
  constexpr std::size_t kEndless = std::size_t{1} << 30;
  CHECK(said(ok + "Content-Length: 100\r\n\r\nshort", "", 0) == "nothing more came for 1 s");
  CHECK(said(ok + "Transfer-Encoding: chunked\r\n\r\n5\r\nshort\r\n", "", 0) == "nothing more came for 1 s");
  CHECK(said(ok + "Content-Length: 1", "", 0) == "no answer within 1 s");
  CHECK(said(ok, "X: y\r\n", kEndless) == "the answer does not end");
  CHECK(said(ok + "X: ", std::string(9000, 'y'), 1) == "a line of the answer's head is longer than 8192 bytes");
  CHECK(said(ok + "Transfer-Encoding: chunked\r\n\r\nno length\r\n", "", 0) == "the answer's chunks are broken");
  CHECK(said("SSH-2.0-OpenSSH_9.2\r\n", "", 0) == "the answer is not HTTP");
}

TEST_CASE("a file that an HTTP server packs unasked is refused by the packing's name") {
  const auto headOf = [](const std::string& encoding) {
    return "HTTP/1.1 200 OK\r\nContent-Encoding: " + encoding + "\r\nContent-Length: 3\r\n\r\nabc";
  };
  for (const std::string encoding : {"gzip", "br", "aws-chunked, gzip"}) {
    const RawServer server(headOf(encoding), "", 0, true);
    HttpReader reader(server.address());
    for (const std::uint64_t most : {1000u, 1u}) {
      CHECK(messageOf([&] { reader.read("", most, {}); }, ErrorKind::cannotRead) ==
            server.address() + ": the server sends it packed (expected no Content-Encoding, found " + encoding + ")");
    }
  }
  for (const std::string encoding : {"Identity", "utf-8", "aws-chunked", "identity, identity"}) {
    const RawServer plain(headOf(encoding), "", 0, true);
    HttpReader reader(plain.address());
    CHECK(reader.read("", 1000, {}) == Bytes({'a', 'b', 'c'}));
  }
}

TEST_CASE("an address that is none of HTTP is refused before anything is sent") {
  for (const char* address : {"https://a/b", "http://", "http://host", "http:///b", "http://a:99999/b", "http://a:/b",
                              "http://a:x/b", "http://me@a/b", "http://a/b?c", "http://a/b c", "ftp://a/b", "a/b"}) {
    INFO(address);
    CHECK_THAT(messageOf([&] { HttpReader reader(address); }, ErrorKind::usage),
               Contains("expected http://HOST[:PORT]/FOLDER/FILE"));
  }
}

TEST_CASE("an answer over HTTP that does not end, in its headers or its body, is given up when its bytes are spent") {
  const std::string status = "HTTP/1.1 200 OK\r\n";
  for (const auto& [head, rest] : {std::pair<std::string, std::string>(status + "X-Long: ", std::string(4000, 'x')),
                                   {status, "X: y\r\n"},
                                   {status + "\r\n", std::string(4000, 'b')}}) {
    INFO(head + rest.substr(0, 10));
    constexpr std::size_t kTimes = std::size_t{1} << 30;
    const RawServer server(head, rest, kTimes, true);
    HttpReader reader(server.address());
    CHECK_THROWS_AS(reader.read("", 100'000, {}), tg::Error);
  }
}

TEST_CASE("an answer over HTTP whose first line goes on is no answer") {
  for (const std::string before : {"", "HTTP/1.1 100 Continue\r\n\r\n"}) {
    INFO(before);
    const RawServer server(before + "HTTP/1.1 200 ", std::string(4000, 'A'), 100, true);
    HttpReader reader(server.address());
    CHECK_THROWS_AS(reader.read("", std::uint64_t{64} << 20, {}), tg::Error);
  }
}

TEST_CASE("a fetch from a server that does not connect or says nothing or is busy ends as soon as it is told to stop") {
  const RawServer silent("", "", 0, true);
  const RawServer busy("HTTP/1.1 503 No\r\n\r\n", "", 0, false);  // waited for
  const FullServer full;
  for (const std::string& address : {silent.address(), busy.address(), full.address()}) {
    INFO(address);
    HttpReader reader(address, kFetchStallSeconds, std::chrono::minutes(1));
    std::stop_source stop;
    const std::jthread stopper([&stop] {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      stop.request_stop();
    });
    const auto asked = std::chrono::steady_clock::now();
    CHECK_THROWS_AS(reader.read("", 100, stop.get_token()), ReadCancelled);
    CHECK(std::chrono::steady_clock::now() - asked < std::chrono::seconds(kConnectSeconds / 2));
  }
  CHECK(busy.connections == 1);
}
