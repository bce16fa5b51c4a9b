// SPDX-License-Identifier: Apache-2.0
// The one exception that programs show to users, and the exit code it maps to.
#pragma once
#include <cerrno>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <system_error>

namespace tg {

// Exit codes of every program: 0 means success.
enum class ErrorKind { usage = 1, cannotRead = 2, badData = 3, cannotWrite = 4, device = 5 };

// Text that may hold bytes of a file, fit for a terminal: one line, no control characters.
inline std::string printable(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = c == '\n' ? ' ' : '?';
  }
  return text;
}

// " (expected X, found Y)", the end of a message.
inline std::string expectedFound(const std::string& expected, const std::string& found) {
  return " (expected " + expected + ", found " + found + ")";
}
inline std::string expectedFound(std::uint64_t expected, std::uint64_t found) {
  return expectedFound(std::to_string(expected), std::to_string(found));
}
inline std::string atMost(std::uint64_t most, std::uint64_t found) {
  return expectedFound("at most " + std::to_string(most), std::to_string(found));
}

// Of errno; strerror is not thread-safe.
inline std::string systemReason() { return std::generic_category().message(errno); }

// what() is one printable line for the user: `path: what is wrong (expected X, found Y)`. Thrown by input, output and
// set-up code only, never from kernels; caught once, in main.
struct Error : std::runtime_error {
  ErrorKind kind;
  Error(ErrorKind k, const std::string& message) : std::runtime_error(printable(message)), kind(k) {}
  Error(ErrorKind k, const std::string& path, const std::string& message) : Error(k, path + ": " + message) {}
};

inline int exitCode(const Error& error) { return static_cast<int>(error.kind); }

}  // namespace tg
