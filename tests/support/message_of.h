// SPDX-License-Identifier: Apache-2.0
// What a step says when it fails.
#pragma once
#include <string>

#include "core/system/error.h"

namespace tg::test {

// The message of the Error that `step` throws; "accepted" when it throws none.
template <typename Step>
std::string messageOf(const Step& step, ErrorKind kind = ErrorKind::badData) {
  try {
    step();
  } catch (const Error& error) {
    return error.kind == kind ? error.what() : std::string("another exit code: ") + error.what();
  }
  return "accepted";
}

}  // namespace tg::test
