// SPDX-License-Identifier: Apache-2.0
// Files of an HTTP server, read whole: bounded in bytes and time.
#pragma once
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

namespace tg {

constexpr int kConnectSeconds = 10;
constexpr int kFetchStallSeconds = 20;  // without a byte received
constexpr int kFetchSeconds = 600;      // of a whole file
constexpr std::chrono::milliseconds kFetchPause(500);

// What a server says of a file's edition; "": nothing.
struct HttpStamp {
  std::string modified, tag;  // Last-Modified and ETag
};
// Like is held against like, Last-Modified first: of several servers behind one address, each may have ETags of its
// own. True also where they have nothing in common.
bool sameEdition(const HttpStamp& a, const HttpStamp& b);

// Keeps its connection from file to file. To be used by one thread at a time.
class HttpReader {
 public:
  // `address`: "http://HOST[:PORT]/FOLDER/FILE". Throws Error(usage) for any other, also for https. stall_seconds: how
  // long no byte may come. pause: before a file is asked for a second time; twice as long before the third.
  explicit HttpReader(const std::string& address, int stall_seconds = kFetchStallSeconds,
                      std::chrono::milliseconds pause = kFetchPause);
  ~HttpReader();
  HttpReader& operator=(HttpReader&&) = delete;

  // The bytes of a file beside the address's own; "" is that one. Asked for up to three times, with 1.5 s of
  // pauses, where the connection ends early, the status is 502, 503 or 504 or a server that was there is not; besides,
  // at once where a connection that was kept has ended. Throws Error(cannotRead) for what does not come, is longer than
  // that, packed or has another status than 200, and ReadCancelled when `stop` is asked for. `stamp`, where not null,
  // becomes the file's.
  std::vector<std::uint8_t> read(const std::string& relative, std::uint64_t max_bytes, const std::stop_token& stop,
                                 HttpStamp* stamp = nullptr);
  // Whether the last read() had any answer.
  bool answered() const { return answered_; }
  // That of the address's own file now, without reading it; none where the server does not say. Throws ReadCancelled.
  std::optional<HttpStamp> stampNow(const std::stop_token& stop);

 private:
  class Client;
  const int stall_seconds_;
  std::string base_;    // "http://HOST:PORT", as typed
  std::string folder_;  // of the path, with slashes at both ends
  std::string file_;
  bool answered_ = false;
  std::unique_ptr<Client> client_;
};

}  // namespace tg
