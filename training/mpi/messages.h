// SPDX-License-Identifier: Apache-2.0
// Messages between ranks: numbers as they lie in memory, since all ranks are one program.
#pragma once
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/system/error.h"
#include "training/mpi/channel.h"

namespace tg {

using Message = std::vector<std::byte>;

class MessageWriter {
 public:
  template <typename T>
  void put(const T& value) {
    put(std::span(&value, 1));
  }
  template <typename T>
  void put(std::span<const T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    const std::span<const std::byte> bytes = std::as_bytes(values);
    message_.insert(message_.end(), bytes.begin(), bytes.end());
  }
  template <typename T>
  void put(const std::vector<T>& values) {
    put(std::span(values));
  }
  void put(const std::string& text) {
    put(text.size());
    put(std::span(text.data(), text.size()));
  }
  void reserve(std::size_t bytes) { message_.reserve(bytes); }
  Message take() { return std::move(message_); }

 private:
  Message message_;
};

// Throws Error(device) where the message ends early: ranks that do not do the same.
class MessageReader {
 public:
  explicit MessageReader(std::span<const std::byte> message) : left_(message) {}
  template <typename T>
  T get() {
    T value;
    get(std::span(&value, 1));
    return value;
  }
  template <typename T>
  void get(std::span<T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (values.size_bytes() > left_.size()) {
      throw Error(ErrorKind::device,
                  "a message between ranks ends early" +
                      expectedFound(std::to_string(values.size_bytes()) + " bytes", std::to_string(left_.size())));
    }
    if (!values.empty()) std::memcpy(static_cast<void*>(values.data()), left_.data(), values.size_bytes());
    left_ = left_.subspan(values.size_bytes());
  }
  template <typename T>
  std::vector<T> get(std::size_t count) {
    if (count > left_.size() / sizeof(T)) {
      throw Error(ErrorKind::device, "a message between ranks ends early" + expectedFound(count, left_.size()));
    }
    std::vector<T> values(count);
    get(std::span(values));
    return values;
  }
  std::string getText() {
    const std::vector<char> text = get<char>(get<std::size_t>());
    return {text.begin(), text.end()};
  }
  bool empty() const { return left_.empty(); }

 private:
  std::span<const std::byte> left_;
};

// [ranks] A message to each, and what each has sent here. All ranks call these.
std::vector<Message> exchangeMessages(Channel& channel, std::span<const std::span<const std::byte>> out);
std::vector<Message> exchangeMessages(Channel& channel, std::vector<Message> out);
// The same message to all: [ranks] theirs.
std::vector<Message> exchangeWithAll(Channel& channel, std::span<const std::byte> out);
// What the first rank has said; the others' arguments do not count.
Message fromFirst(Channel& channel, std::span<const std::byte> said);
// [ranks] What all have said at the first rank, empty elsewhere.
std::vector<Message> toFirst(Channel& channel, std::span<const std::byte> said);

}  // namespace tg
