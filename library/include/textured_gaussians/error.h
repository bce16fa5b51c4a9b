// SPDX-License-Identifier: Apache-2.0
// What every function of the library throws, but for std::bad_alloc.
#pragma once
#include <stdexcept>
#include <string>

namespace textured_gaussians {

// The exit codes of the programs.
enum class ErrorKind {
  usage = 1,       // arguments or settings that are wrong or contradict each other
  cannotRead = 2,  // a file or folder that is not there or may not be read
  badData = 3,     // a file, a model or a data set that breaks its own rules
  cannotWrite = 4,
  device = 5,
};

// what() is one line for users, without control characters: `path: what is wrong (expected X, found Y)`.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
  ErrorKind kind() const { return kind_; }

 private:
  ErrorKind kind_;
};

}  // namespace textured_gaussians
