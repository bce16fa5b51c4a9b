// SPDX-License-Identifier: Apache-2.0
// The outermost catch, and the words for a wrong command line.
#include "core/system/program.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <iostream>
#include <map>
#include <new>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/system/command_table.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "core/system/nearest_name.h"
#include "core/system/numbers.h"
#include "core/system/shortened.h"
#include "core/system/temporary_files.h"

namespace tg {
namespace {

std::string meant(std::string_view text, const std::vector<std::string>& names) {
  const std::string name = nearestName(text, names);
  return name.empty() ? "" : " (did you mean " + name + "?)";
}

// "--name" of every option, "name" if not `dashed`.
std::vector<std::string> longNames(const CLI::App& app, bool dashed) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back(dashed ? "--" + name : name);
  }
  return names;
}

// ": expected one folder" where a command takes one word that is no flag, and has it.
std::string expectedOne(const CLI::App& command) {
  const auto taken = command.get_options([](const CLI::Option* option) { return option->get_positional(); });
  if (taken.size() != 1 || taken.front()->count() == 0) return "";
  const std::string type = taken.front()->get_type_name();
  return ": expected one " + (type == "TEXT" ? taken.front()->get_name() : lowerCase(type));
}

// What nothing takes: a flag that is not there, or one word too many.
std::string unexpected(const CLI::App& app) {
  const std::vector<std::string> left = app.remaining(true);
  const std::vector<CLI::App*> commands = app.get_subcommands();
  const CLI::App& command = commands.empty() ? app : *commands.front();
  const auto flag = std::ranges::find_if(left, [](const std::string& word) { return word.starts_with("-"); });
  if (flag == left.end()) {
    return "unexpected argument: " + (left.empty() ? "" : shortened(left.front()) + expectedOne(command));
  }
  const std::string name = flag->substr(0, flag->find('='));
  return "no such option: " + shortened(name) + meant(name, longNames(command, true));
}

// CLI11's words for a value that is missing or is none, as other checks say it.
std::string likeOurs(const std::string& message) {
  const std::string_view none = "Could not convert: ";
  if (const std::size_t at = message.find(" = "); message.starts_with(none) && at != message.npos) {
    return message.substr(none.size(), at - none.size()) + ": expected a number, found \"" +
           shortened(message.substr(at + 3)) + "\"";
  }
  const std::size_t required = message.find(" required "), colon = message.rfind(": ", required);
  const bool missing = required != message.npos && colon != message.npos && message.ends_with(" missing") &&
                       parseWhole<int>(message.substr(colon + 2, required - colon - 2));
  return missing ? message.substr(0, colon) + ": expected a value, found none" : message;
}

// What is wrong with a setting that is on no command line is wrong with the file of settings.
std::string ofSettingsFile(const CLI::App& app, std::span<char*> arguments, const std::string& message) {
  const CLI::Option* config = app.get_config_ptr();
  if (config == nullptr || config->count() == 0 || !message.starts_with("--")) return message;
  const std::string flag = message.substr(0, message.find_first_of(": "));
  const bool is_given =
      std::ranges::any_of(arguments, [&](std::string_view given) { return given.substr(0, given.find('=')) == flag; });
  return is_given ? message : config->as<std::string>() + ": " + message.substr(2);
}

std::string usageMessage(const CLI::App& app, const CLI::Error& error, std::span<char*> arguments) {
  std::string message = ofSettingsFile(app, arguments, likeOurs(error.what()));
  const std::string unknown = "INI was not able to parse ";
  if (message.starts_with(unknown)) {
    const std::string setting = message.substr(unknown.size());
    message = "--config: no such setting: " + shortened(setting) + meant(setting, longNames(app, false));
  }
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError)) message = unexpected(app);
  if (const std::size_t at = message.find(": At Most 1 required"); at != message.npos) {
    message = message.substr(0, at) + " is given more than once";
  }
  return message;
}

// Whether --man or --completion failed behind a command that does not know it, or that misses something else first.
bool failedForCompany(const CLI::ParseError& error, std::span<char*> arguments) {
  const auto code = static_cast<CLI::ExitCodes>(error.get_exit_code());
  if (code != CLI::ExitCodes::ExtrasError && code != CLI::ExitCodes::RequiredError) return false;
  const auto end = std::ranges::find(arguments, std::string_view("--"));
  return std::any_of(arguments.begin(), end, [](const std::string_view word) {
    return std::ranges::any_of(std::array{"--man", "--completion"}, [&](std::string_view flag) {
      return word.starts_with(flag) && (word.size() == flag.size() || word[flag.size()] == '=');
    });
  });
}

// Of both libraries' buffers, which a program may have filled in turns. What was lost before has no reason any more.
void flushOutput() {
  errno = 0;
  std::cout.flush();
  if (std::fflush(stdout) != 0 || std::ferror(stdout) || !std::cout) {
    throw Error(ErrorKind::cannotWrite, "standard output",
                errno == 0 ? "cannot write all of it" : "cannot write: " + systemReason());
  }
}

void print(const std::string& text) {
  if (std::fputs(text.c_str(), stdout) < 0 || std::fflush(stdout) != 0) {
    throw Error(ErrorKind::cannotWrite, "standard output", "cannot write: " + systemReason());
  }
}

// `tgtrain make-sampel`: a word that is neither a command nor a file.
void refuseUnknownCommand(const CLI::App& app, int argc, char** argv) {
  std::error_code ignored;
  if (argc < 2 || argv[1][0] == '-' || std::filesystem::exists(argv[1], ignored)) return;
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  if (std::ranges::find(names, argv[1]) != names.end()) return;
  const std::string hint = meant(argv[1], names);
  if (!hint.empty()) throw Error(ErrorKind::usage, std::string(argv[1]) + ": no such command or file" + hint);
}

// No file has the name "", which what takes names would read as none given.
void refuseEmptyNames(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    const std::string type = option->get_type_name();
    const bool names_file = type == "FILE" || type.starts_with("FOLDER");
    if (!names_file && type != "[ADDRESS:]PORT") continue;
    if (std::ranges::find(option->results(), "") == option->results().end()) continue;
    throw Error(ErrorKind::usage, option->get_name() + ": an empty " + (names_file ? "file name" : "address"));
  }
  for (const CLI::App* command : app.get_subcommands()) refuseEmptyNames(*command);
}

void addGeneralOptions(CLI::App& app, const std::string& program) {
  constexpr const char* kGroup = "General";
  app.set_help_flag("-h,--help", "Print this help and exit")->group(kGroup);
  app.set_version_flag("--version", program + " " TG_VERSION, "Print the version and exit")->group(kGroup);
  app.formatter_fn([](const CLI::App* shown, const std::string& name, CLI::AppFormatMode) {
    CommandTable table = tableOf(*shown);
    table.name = name;
    return formatHelp(table, terminalWidth());
  });
  for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    addGeneralOptions(*command, program);
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

// A stream that is closed has the number that the next file gets: what is printed would go into that file. Written to,
// it fails as before.
void holdStandardStreams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(stream, F_GETFD) < 0) (void)::open("/dev/null", O_RDONLY);  // takes the lowest number that is free
  }
}

const char* program_name = "";

// Memory ran out where nothing may throw, in a library's destructor: the same end as otherwise, without more memory.
[[noreturn]] void endedByLibrary() noexcept {
  if (const std::exception_ptr thrown = std::current_exception()) {
    try {
      std::rethrow_exception(thrown);
    } catch (const std::bad_alloc&) {
      removeTemporaryFilesAtEnd();
      std::fprintf(stderr, "%s: out of memory\n", program_name);
      std::_Exit(static_cast<int>(ErrorKind::device));
    } catch (...) {
    }
  }
  std::abort();
}

std::optional<std::uint64_t> bytesIn(const std::string& text) {
  static const std::map<std::string, double> units = {{"", 1},
                                                      {"b", 1},
                                                      {"kb", 1e3},
                                                      {"mb", 1e6},
                                                      {"gb", 1e9},
                                                      {"tb", 1e12},
                                                      {"kib", 1024},
                                                      {"mib", 1024 * 1024},
                                                      {"gib", 1024.0 * 1024 * 1024},
                                                      {"tib", 1024.0 * 1024 * 1024 * 1024}};
  const std::size_t number_end = text.find_last_of("0123456789.") + 1;
  std::string unit = text.substr(std::min(text.find_first_not_of(' ', number_end), text.size()));
  std::ranges::transform(unit, unit.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; });
  const std::optional<double> number = parseWhole<double>(text.substr(0, number_end));
  const auto factor = units.find(unit);
  if (!number || factor == units.end()) return std::nullopt;
  const double bytes = *number * factor->second;
  return bytes >= 1 && bytes <= 1e15 ? std::optional(static_cast<std::uint64_t>(bytes)) : std::nullopt;
}

constexpr std::size_t kMessageStart = 2000, kMessageEnd = 500;  // [bytes] of one that quotes a file at length

}  // namespace

std::optional<int> parseCommandLine(CLI::App& app, int argc, char** argv) {
  const std::string name = app.get_name(), program = name.substr(0, name.find(' '));
  addGeneralOptions(app, program);
  std::string shell;
  bool manual = false;
  app.failure_message([argc, argv](const CLI::App* failed, const CLI::Error& error) {
    const std::string message = usageMessage(*failed, error, {argv, static_cast<std::size_t>(argc)});
    return failed->get_name() + ": " + message + " (see --help)\n";
  });
  if (name == program) {
    app.add_option("--completion", shell,
                   "Print what makes a shell complete the options, and exit: source <(...) in bash and zsh (after "
                   "compinit), a file in ~/.config/fish/completions")
        ->check(oneOf({"bash", "zsh", "fish"}))
        ->configurable(false)
        ->group("General");
    app.add_flag("--man", manual, "Print the manual page and exit: --man | man -l -")
        ->configurable(false)
        ->group("General");
    // Where nothing else is asked for nothing else is required.
    const std::string_view first = argc > 1 ? argv[1] : "", completion = "--completion=";
    const bool apart = argc == 3 && first == "--completion";
    if (apart || (argc == 2 && first.starts_with(completion))) {
      print(formatCompletion(tableOf(app), apart ? argv[2] : first.substr(completion.size())));
      return 0;
    }
    if (argc == 2 && first == "--man") {
      print(formatManual(tableOf(app)));
      return 0;
    }
  }
  refuseUnknownCommand(app, argc, argv);
  const Error company(ErrorKind::usage, "--completion and --man stand alone (expected nothing else with them)");
  try {
    app.parse(argc, argv);
    if (!shell.empty() || manual) throw company;
    refuseEmptyNames(app);
    return std::nullopt;
  } catch (const CLI::FileError& error) {
    app.exit(error);
    return static_cast<int>(ErrorKind::cannotRead);
  } catch (const CLI::ParseError& error) {
    if (failedForCompany(error, {argv, static_cast<std::size_t>(argc)})) throw company;
    std::ostringstream asked;
    const bool help = app.exit(error, asked) == 0;
    print(asked.str());
    return help ? 0 : static_cast<int>(ErrorKind::usage);
  }
}

std::string wrongFlags(const CLI::App& app, const CLI::Error& error) { return usageMessage(app, error, {}); }

void addExamples(CLI::App& app, std::initializer_list<Example> examples, const std::string& more) {
  std::string text = "Examples:";
  for (const Example& example : examples) {
    text += "\n  " + std::string(example.command) + "\n      " + example.meaning;
  }
  app.footer(more.empty() ? text : text + "\n\n" + more);
}

CLI::Validator oneOf(std::vector<std::string> names) {
  std::string listed, all;
  for (std::size_t i = 0; i < names.size(); ++i) {
    listed += (i == 0 ? "" : i + 1 == names.size() ? " or " : ", ") + names[i];
    all += (i == 0 ? "" : ",") + names[i];
  }
  const auto check = [names = std::move(names), listed](const std::string& text) {
    if (std::ranges::find(names, text) != names.end()) return std::string();
    return "expected " + listed + ", found \"" + text + "\"" + meant(text, names);
  };
  return {check, "{" + all + "}"};
}

CLI::Option* addBytes(CLI::App& app, const std::string& name, std::uint64_t& bytes, const std::string& help) {
  const auto check = [](const std::string& text) {
    return bytesIn(text) ? "" : "expected bytes, such as 900KB (900,000) or 1.5MiB (1,572,864), found \"" + text + "\"";
  };
  const auto take = [&bytes](const std::string& text) { bytes = *bytesIn(text); };
  return app.add_option_function<std::string>(name, take, help)->check(CLI::Validator(check, ""))->type_name("SIZE");
}

int runProgram(const char* name, const std::function<int()>& body) {
  program_name = name;
  std::set_terminate(endedByLibrary);
  holdStandardStreams();
  std::signal(SIGXFSZ, SIG_IGN);  // a file larger than the limit is an error of the write, as on a full disk
  try {
    checkProcessor();
    const int code = body();
    if (code == 0 || code > 128) flushOutput();  // a success, or one that a signal cut short
    return code;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s: %s\n", name, shortened(error.what(), kMessageStart, kMessageEnd).c_str());
    return exitCode(error);
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "%s: out of memory\n", name);
    return static_cast<int>(ErrorKind::device);
  } catch (const std::system_error& error) {
    if (error.code() == std::errc::not_enough_memory) {  // of std::filesystem, too
      std::fprintf(stderr, "%s: out of memory\n", name);
      return static_cast<int>(ErrorKind::device);
    }
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
