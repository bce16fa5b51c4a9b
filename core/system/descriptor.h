// SPDX-License-Identifier: Apache-2.0
// A file descriptor with an owner.
#pragma once
#include <unistd.h>

#include <utility>

namespace tg {

// Closed at the end; below 0: none.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor() { close(); }
  Descriptor& operator=(Descriptor&&) = delete;

  int get() const { return number_; }
  void set(int number) {
    close();
    number_ = number;
  }
  void close() {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
  }
  // Hands it over: it is no longer closed here.
  int release() { return std::exchange(number_, -1); }

 private:
  int number_;
};

}  // namespace tg
