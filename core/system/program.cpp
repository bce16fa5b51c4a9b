// SPDX-License-Identifier: Apache-2.0
// The outermost catch, and the words for a wrong command line.
#include "core/system/program.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <iostream>
#include <map>
#include <new>
#include <string>
#include <system_error>

#include "core/system/error.h"
#include "core/system/shortened.h"

namespace tg {
namespace {

std::string usageMessage(const CLI::App* app, const CLI::Error& error) {
  std::string message = error.what();
  const std::string unknown = "INI was not able to parse ";
  if (message.starts_with(unknown)) message = "--config: no such setting: " + message.substr(unknown.size());
  if (const std::size_t at = message.find(": At Most 1 required"); at != message.npos) {
    message = message.substr(0, at) + " is given more than once";
  }
  return app->get_name() + ": " + message + " (see --help)\n";
}

// Of both libraries' buffers, which a program may have filled in turns.
void flushOutput() {
  errno = 0;
  std::cout.flush();
  if (std::fflush(stdout) != 0 || std::ferror(stdout) || !std::cout) {
    throw Error(ErrorKind::cannotWrite, "standard output", std::string("cannot write: ") + std::strerror(errno));
  }
}

// What the kernels are compiled for at least (cmake/simd.cmake).
void checkProcessor() {
#ifdef __x86_64__
  if (!__builtin_cpu_supports("sse4.2") || !__builtin_cpu_supports("aes") || !__builtin_cpu_supports("pclmul")) {
    throw Error(ErrorKind::device, "this processor is too old (expected SSE4.2, AES and PCLMUL, as made since 2011)");
  }
#endif
}

constexpr std::size_t kMessageStart = 2000, kMessageEnd = 500;  // [bytes] of one that quotes a file at length

}  // namespace

std::optional<int> parseCommandLine(CLI::App& app, int argc, char** argv) {
  app.set_version_flag("--version", app.get_name() + " " TG_VERSION, "Print the version and exit");
  app.failure_message(usageMessage);
  try {
    app.parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::FileError& error) {
    app.exit(error);
    return static_cast<int>(ErrorKind::cannotRead);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(ErrorKind::usage);
  }
}

CLI::Option* addBytes(CLI::App& app, const std::string& name, std::uint64_t& bytes, const std::string& help) {
  const std::map<std::string, double> units = {{"B", 1}, {"KB", 1e3}, {"MB", 1e6}, {"GB", 1e9}};
  return app
      .add_option_function<double>(
          name, [&bytes](double number) { bytes = static_cast<std::uint64_t>(number); }, help)
      ->transform(CLI::AsNumberWithUnit(units, CLI::AsNumberWithUnit::CASE_INSENSITIVE, "SIZE"))
      ->check(CLI::Range(1.0, 1e15))
      ->type_name("SIZE");
}

int runProgram(const char* name, const std::function<int()>& body) {
  try {
    checkProcessor();
    const int code = body();
    if (code == 0) flushOutput();
    return code;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s: %s\n", name, shortened(error.what(), kMessageStart, kMessageEnd).c_str());
    return exitCode(error);
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "%s: out of memory\n", name);
    return static_cast<int>(ErrorKind::device);
  } catch (const std::system_error& error) {
    // A thread that cannot start. What is wrong with a file says so itself.
    const bool again = error.code() == std::errc::resource_unavailable_try_again;
    std::fprintf(stderr, "%s: %s%s\n", name, again ? "no thread can be started: " : "", error.what());
    return static_cast<int>(again ? ErrorKind::device : ErrorKind::badData);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", name, error.what());
    return static_cast<int>(ErrorKind::badData);
  }
}

}  // namespace tg
