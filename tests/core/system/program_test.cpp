// SPDX-License-Identifier: Apache-2.0
// What a program's body throws becomes its exit code.
#include "core/system/program.h"

#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <new>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "core/system/error.h"
#include "core/system/shortened.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

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

TEST_CASE("what is wrong with a command line or a settings file is quoted by its beginning and its end") {
  const tg::TemporaryFolder folder;
  const std::string file = folder / "long.toml", name(200'000, 'x');
  const auto messageFor = [&](std::vector<std::string> words) {
    CLI::App app("Does things.", "tool");
    int count = 3;
    app.add_option("--count", count, "How many");
    app.set_config("--config");
    app.allow_config_extras(CLI::config_extras_mode::error);
    words.insert(words.begin(), "tool");
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    std::ostringstream said;
    std::streambuf* const before = std::cerr.rdbuf(said.rdbuf());
    const std::optional<int> code = tg::parseCommandLine(app, static_cast<int>(arguments.size()), arguments.data());
    std::cerr.rdbuf(before);
    CHECK(code == 1);
    return said.str();
  };
  const std::string quoted = tg::shortened(name);
  CHECK_THAT(messageFor({"--" + name}), Contains("no such option: --" + quoted.substr(2) + " (see --help)"));
  CHECK_THAT(messageFor({name}), Contains("unexpected argument: " + quoted + " (see --help)"));
  CHECK_THAT(messageFor({"--count", name}), Contains("expected a number, found \"" + quoted + "\""));
  std::ofstream(file) << name << " = 1\n";
  CHECK_THAT(messageFor({"--config", file}), Contains("no such setting: " + quoted + " (see --help)"));
}
