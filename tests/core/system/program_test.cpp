// SPDX-License-Identifier: Apache-2.0
// What a program's body throws becomes its exit code.
#include "core/system/program.h"

#include <exception>
#include <filesystem>
#include <new>
#include <system_error>

#include "core/system/error.h"
#include "support/catch.h"

namespace {

template <typename Thrown>
int codeOf(const Thrown& thrown) {
  const std::terminate_handler before = std::get_terminate();  // which a program replaces
  const int code = tg::runProgram("program_test", [&]() -> int { throw thrown; });
  std::set_terminate(before);
  return code;
}

}  // namespace

TEST_CASE("whatever runs out of memory ends a program as a lack of memory, not as wrong data") {
  CHECK(codeOf(std::bad_alloc()) == 5);
  CHECK(codeOf(std::filesystem::filesystem_error("canonical", std::make_error_code(std::errc::not_enough_memory))) ==
        5);
  CHECK(codeOf(std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again))) == 5);
  CHECK(codeOf(std::filesystem::filesystem_error("canonical", std::make_error_code(std::errc::io_error))) == 3);
  CHECK(codeOf(tg::Error(tg::ErrorKind::cannotRead, "a", "is not there")) == 2);
}
