// SPDX-License-Identifier: Apache-2.0
// cpp-httplib on bounded streams.
#include "viewer/model/http_reader.h"

#include <fcntl.h>
#include <httplib.h>
#include <netdb.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <sstream>
#include <utility>

#include "converter/serve/bounded_stream.h"
#include "core/file/file.h"
#include "core/system/descriptor.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

constexpr std::uint64_t kHeaderBytes = 64 << 10;  // of an answer, at most
constexpr std::uint64_t kLineBytes = 8 << 10;     // of it; the library matches the first by recursion, a level a byte
constexpr std::chrono::seconds kKeptConnectionEnds{1};  // what takes longer is a server that says nothing
constexpr std::string_view kScheme = "http://";
constexpr const char* kPlain = "identity";  // the encoding that is none

[[noreturn]] void refuse(const std::string& address, const std::string& found) {
  throw tg::Error(ErrorKind::usage, address,
                  "unknown address" + expectedFound("http://HOST[:PORT]/FOLDER/FILE", printable(found)));
}

std::string seconds(int count) { return std::to_string(count) + " s"; }

// `status`: 0 where the answer's head never came.
std::string reasonOf(httplib::Error error, StreamEnd ended, int status, int stall_seconds) {
  if (error == httplib::Error::Connection) return "nobody answers there";
  if (error != httplib::Error::Read) return httplib::to_string(error);
  switch (ended) {
    case StreamEnd::closed:
      return "the answer ends early";
    case StreamEnd::stalled:
      return (status == 0 ? "no answer within " : "nothing more came for ") + seconds(stall_seconds);
    case StreamEnd::late:
      return "the answer takes longer than " + seconds(kFetchSeconds);
    case StreamEnd::spent:
      return "the answer does not end";
    case StreamEnd::line:
      return "a line of the answer's head is longer than " + std::to_string(kLineBytes) + " bytes";
    case StreamEnd::none:
      break;
  }
  return status == 0 ? "the answer is not HTTP" : "the answer's chunks are broken";
}

// What a server, or a proxy before it, says that may answer soon.
bool isPassing(int status) { return status == 502 || status == 503 || status == 504; }

// Of the names in a Content-Encoding, which may be wrong about bytes that are plain.
bool isPacking(const std::string& encodings) {
  std::istringstream names(lowerCase(encodings));
  for (std::string name; std::getline(names, name, ',');) {
    std::erase_if(name, [](char c) { return c == ' ' || c == '\t'; });
    for (const char* packing : {"gzip", "x-gzip", "deflate", "compress", "x-compress", "br", "zstd", "dcb", "dcz"}) {
      if (name == packing) return true;
    }
  }
  return false;
}

HttpStamp stampOf(const httplib::Response& response) {
  return {response.get_header_value("Last-Modified"), response.get_header_value("ETag")};
}

}  // namespace

bool sameEdition(const HttpStamp& a, const HttpStamp& b) {
  if (!a.modified.empty() && !b.modified.empty()) return a.modified == b.modified;
  return a.tag.empty() || b.tag.empty() || a.tag == b.tag;
}

class HttpReader::Client : public httplib::ClientImpl {
 public:
  Client(const std::string& host, int port, int stall_seconds, std::chrono::milliseconds pause)
      : httplib::ClientImpl(host, port), stall_seconds_(stall_seconds), pause_(pause) {
    set_keep_alive(true);
    set_decompress(false);
  }

  // Of the request at hand.
  std::uint64_t most = 0;
  std::stop_token stop;
  // Of the one before.
  StreamEnd ended = StreamEnd::none;

  // What fetch() gives; `status` stays 0 until an answer begins. Servers close connections that they kept, and may do
  // so just as they are asked: once more then.
  template <typename Fetch>
  httplib::Result ask(const Fetch& fetch, const int& status) {
    const auto asked = std::chrono::steady_clock::now();
    httplib::Result result = fetch();
    const bool closed = !result && status == 0 && std::chrono::steady_clock::now() - asked < kKeptConnectionEnds;
    if (closed && std::exchange(kept_, false) && !stop.stop_requested()) result = fetch();
    kept_ = static_cast<bool>(result);
    return result;
  }

  // The same, and once more after each pause while what is in the way may pass: connections that end before their
  // answers do, statuses, and a server that was there and is not, as one that is started anew.
  template <typename Fetch>
  httplib::Result askPatiently(const Fetch& fetch, const int& status) {
    bool was_there = kept_;
    httplib::Result result = ask(fetch, status);
    for (const std::chrono::milliseconds pause : {pause_, 2 * pause_}) {
      const bool cut = !result && result.error() == httplib::Error::Read && ended == StreamEnd::closed;
      was_there = was_there || cut || status != 0;
      const bool gone = !result && result.error() == httplib::Error::Connection && was_there;
      if (!cut && !gone && !isPassing(status)) break;
      constexpr int kNoSocket = -1;
      waitFor(kNoSocket, 0, std::chrono::steady_clock::now() + pause, [this] { return stop.stop_requested(); });
      if (stop.stop_requested()) break;
      result = ask(fetch, status);
    }
    return result;
  }

 private:
  // The library's own waits to its end, whoever is told to stop.
  bool create_and_connect_socket(Socket& socket, httplib::Error& error) override {
    addrinfo wanted{};
    wanted.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    if (::getaddrinfo(host_.c_str(), std::to_string(port_).c_str(), &wanted, &found) == 0) {
      for (const addrinfo* at = found; at && !socket.is_open(); at = at->ai_next) socket.sock = connected(*at);
      ::freeaddrinfo(found);
    }
    if (!socket.is_open()) error = httplib::Error::Connection;
    return socket.is_open();
  }

  // -1: nobody answers in time, or `stop` was asked for.
  int connected(const addrinfo& address) const {
    Descriptor made(::socket(address.ai_family, address.ai_socktype | SOCK_CLOEXEC, address.ai_protocol));
    const int flags = ::fcntl(made.get(), F_GETFL);
    if (flags < 0 || ::fcntl(made.get(), F_SETFL, flags | O_NONBLOCK) != 0) return -1;
    if (::connect(made.get(), address.ai_addr, address.ai_addrlen) != 0) {
      const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(kConnectSeconds);
      int problem = 0;
      socklen_t size = sizeof problem;
      if (errno != EINPROGRESS || !waitFor(made.get(), POLLOUT, until, [this] { return stop.stop_requested(); })) {
        return -1;
      }
      if (::getsockopt(made.get(), SOL_SOCKET, SO_ERROR, &problem, &size) != 0 || problem != 0) return -1;
    }
    return ::fcntl(made.get(), F_SETFL, flags) == 0 ? made.release() : -1;
  }

  bool process_socket(const Socket& socket, std::function<bool(httplib::Stream&)> callback) override {
    // A body in chunks has a line a chunk beside it.
    const StreamLimits limits{.most_read = most + most / 8 + kHeaderBytes,
                              .read_seconds = kFetchSeconds,
                              .write_seconds = kFetchSeconds,
                              .read_stall_seconds = stall_seconds_,
                              .write_stall_seconds = stall_seconds_,
                              .most_line = kLineBytes};
    BoundedStream stream(socket.sock, limits, [this] { return stop.stop_requested(); });
    const bool whole = callback(stream);
    ended = stream.ended();
    return whole;
  }

  const int stall_seconds_;
  const std::chrono::milliseconds pause_;
  bool kept_ = false;  // the last answer was whole, its connection may be kept
};

HttpReader::HttpReader(const std::string& address, int stall_seconds, std::chrono::milliseconds pause)
    : stall_seconds_(stall_seconds) {
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
  client_ = std::make_unique<Client>(host, port, stall_seconds, pause);
}

HttpReader::~HttpReader() = default;

std::vector<std::uint8_t> HttpReader::read(const std::string& relative, std::uint64_t max_bytes,
                                           const std::stop_token& stop, HttpStamp* stamp) {
  const std::string path = folder_ + (relative.empty() ? file_ : relative), name = base_ + path;
  client_->most = max_bytes;
  client_->stop = stop;
  std::vector<std::uint8_t> bytes;
  int status = 0;
  bool too_long = false;
  std::uint64_t promised = 0;
  std::string packing;  // that nobody asked for
  const auto begin = [&](const httplib::Response& response) {
    status = response.status;
    if (stamp) *stamp = stampOf(response);
    promised = parseWhole<std::uint64_t>(response.get_header_value("Content-Length")).value_or(0);
    too_long = status == 200 && promised > max_bytes;
    packing = response.get_header_value("Content-Encoding");
    if (!isPacking(packing)) packing.clear();
    answered_ = true;
    return status == 200 && packing.empty() && !too_long;
  };
  const auto take = [&](const char* data, std::size_t size) {
    too_long = size > max_bytes - bytes.size();
    if (too_long) return false;
    bytes.insert(bytes.end(), data, data + size);
    return true;
  };
  const auto fetch = [&] {
    bytes.clear();
    status = 0;
    return client_->Get(path, {{"Accept-Encoding", kPlain}}, begin, take);
  };
  answered_ = false;
  const httplib::Result result = client_->askPatiently(fetch, status);
  if (stop.stop_requested()) throw ReadCancelled();
  if (status == 200 && !packing.empty()) {
    throw tg::Error(ErrorKind::cannotRead, name,
                    "the server sends it packed" + expectedFound("no Content-Encoding", printable(packing)));
  }
  if (too_long) {
    throw tg::Error(ErrorKind::cannotRead, name, "is too long" + atMost(max_bytes, std::max(promised, max_bytes + 1)));
  }
  if (status != 0 && status != 200) {
    throw tg::Error(ErrorKind::cannotRead, name, "the server refuses it" + expectedFound(200, status));
  }
  if (!result) {
    throw tg::Error(ErrorKind::cannotRead, name,
                    "cannot be fetched: " + reasonOf(result.error(), client_->ended, status, stall_seconds_));
  }
  return bytes;
}

std::optional<HttpStamp> HttpReader::stampNow(const std::stop_token& stop) {
  client_->most = 0;
  client_->stop = stop;
  const auto fetch = [&] { return client_->Head(folder_ + file_, {{"Accept-Encoding", kPlain}}); };
  const httplib::Result result = client_->ask(fetch, 0);
  if (stop.stop_requested()) throw ReadCancelled();
  if (!result || result->status != 200) return std::nullopt;
  return stampOf(*result);
}

}  // namespace tg
