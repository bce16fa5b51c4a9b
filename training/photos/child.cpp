// SPDX-License-Identifier: Apache-2.0
// fork, exec and two pipes.
#include "training/photos/child.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <deque>
#include <sstream>
#include <string_view>

#include "core/system/assert.h"
#include "core/system/descriptor.h"
#include "core/system/error.h"
#include "core/system/signals.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLastLines = 4;
constexpr std::size_t kLongestLine = 4096;  // [bytes]; what is longer comes in pieces
constexpr int kPollEvery = 100;             // [ms] for words
constexpr int kPollEnd = 10;                // [ms] for the end of a process

struct Pipe {
  Descriptor read, write;

  Pipe() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw Error(ErrorKind::device, "cannot make a pipe: " + systemReason());
    read.set(ends[0]);
    write.set(ends[1]);
  }
};

// Pointers for exec; `words` must outlive them.
std::vector<char*> pointersTo(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

// What is set for every child; and what mpirun and Slurm say of this process, which its children are not.
constexpr const char* kNotForChildren[] = {"LC_ALL=", "QT_QPA_PLATFORM=", "OMPI_COMM_WORLD_", "PMI_", "PMIX_"};

// Numbers with points, words in English, no window.
std::vector<std::string> childEnvironment() {
  std::vector<std::string> environment;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string_view text = *entry;
    const bool left_out =
        std::ranges::any_of(kNotForChildren, [&](const char* start) { return text.starts_with(start); });
    if (!left_out) environment.emplace_back(text);
  }
  environment.emplace_back("LC_ALL=C.UTF-8");
  environment.emplace_back("QT_QPA_PLATFORM=offscreen");
  return environment;
}

// Between fork and exec: nothing but system calls.
[[noreturn]] void becomeChild(char* const* words, char* const* environment, const char* folder, pid_t parent,
                              int output, int log, int failure) {
  ::setpgid(0, 0);  // the terminal's Ctrl-C is this program's alone
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  const int nothing = ::open("/dev/null", O_RDONLY);
  for (const int signal : kStopSignals) ::signal(signal, SIG_DFL);
  ::signal(SIGPIPE, SIG_DFL);
  ::signal(SIGXFSZ, SIG_DFL);
  if (::getppid() == parent && nothing >= 0 && ::dup2(nothing, STDIN_FILENO) >= 0 &&
      ::dup2(output, STDOUT_FILENO) >= 0 && ::dup2(log, STDERR_FILENO) >= 0 &&
      (*folder == '\0' || ::chdir(folder) == 0)) {
    ::execve(words[0], words, environment);
  }
  const int reason = errno;
  (void)!::write(failure, &reason, sizeof reason);
  ::_exit(127);
}

// Of what a library writes about a program that dies: after the cause, and longer.
bool isOfStackTrace(std::string_view line) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  return std::ranges::any_of(std::array{"@ ", "PC: @ ", "*** Check failure stack trace", "*** Aborted at ", "*** SIG"},
                             [&](const char* start) { return line.starts_with(start); });
}

// What the child says, cut into lines.
class Words {
 public:
  explicit Words(const ChildCommand& command) : command_(command) {
    log_.set(::open(command.log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666));
    if (log_.get() < 0) throw Error(ErrorKind::cannotWrite, command.log.string(), "cannot open: " + systemReason());
  }

  void add(std::span<const std::uint8_t> bytes) {
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t written = ::write(log_.get(), bytes.data() + at, bytes.size() - at);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) throw Error(ErrorKind::cannotWrite, command_.log.string(), "cannot write: " + systemReason());
      at += static_cast<std::size_t>(written);
    }
    for (const std::uint8_t byte : bytes) {
      if (byte == '\n' || byte == '\r' || line_.size() >= kLongestLine) endLine();
      if (byte != '\n' && byte != '\r') line_ += static_cast<char>(byte);
    }
  }
  std::string last() {
    endLine();
    std::string text;
    for (const std::string& line : last_) text += (text.empty() ? "" : " | ") + line;
    return printable(text);
  }

 private:
  void endLine() {
    if (line_.find_first_not_of(" \t") == line_.npos) return line_.clear();
    if (command_.line) command_.line(line_);
    if (!isOfStackTrace(line_)) last_.push_back(line_);
    if (last_.size() > kLastLines) last_.pop_front();
    line_.clear();
  }

  const ChildCommand& command_;
  Descriptor log_;
  std::string line_;
  std::deque<std::string> last_;
};

// The group of a child that runs; ended and waited for at the end of this.
class Process {
 public:
  Process(pid_t id, std::chrono::seconds patience) : id_(id), patience_(patience) {}
  ~Process() {
    if (id_ > 0) end();
  }
  Process& operator=(Process&&) = delete;

  // Its status, once it has ended.
  std::optional<int> status() {
    int status = 0;
    if (::waitpid(id_, &status, WNOHANG) != id_) return std::nullopt;
    id_ = -1;
    return status;
  }

 private:
  void end() {
    const pid_t group = id_;
    ::kill(-group, SIGTERM);
    const auto give_up = std::chrono::steady_clock::now() + patience_;
    bool ended = false;
    while (!(ended = status().has_value()) && std::chrono::steady_clock::now() < give_up) {
      ::poll(nullptr, 0, kPollEnd);
    }
    ::kill(-group, SIGKILL);  // its own children, too, that do not listen
    while (!ended && !status()) ::poll(nullptr, 0, kPollEnd);
  }

  pid_t id_;
  const std::chrono::seconds patience_;
};

}  // namespace

std::optional<fs::path> findProgram(const std::string& name) {
  const auto runs = [](const fs::path& path) {
    std::error_code ignored;
    return fs::is_regular_file(path, ignored) && ::access(path.c_str(), X_OK) == 0;
  };
  if (name.find('/') != name.npos) return runs(name) ? std::optional<fs::path>(name) : std::nullopt;
  const char* const path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "/usr/local/bin:/usr/bin:/bin");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path program = fs::path(folder.empty() ? "." : folder) / name;
    if (runs(program)) return fs::absolute(program);
  }
  return std::nullopt;
}

ChildEnd runChild(const ChildCommand& command, const std::atomic<int>& stop) {
  TG_ASSERT(!command.words.empty(), "a command has a program");
  if (stop != 0) throw Stopped();
  Words words(command);
  Pipe log, failure;
  std::optional<Process> process;
  Pipe output;  // closed before the process ends: one that writes into it would not hear that it is to end
  std::vector<std::string> arguments = command.words, environment = childEnvironment();
  const std::vector<char*> argument_pointers = pointersTo(arguments), environment_pointers = pointersTo(environment);
  const pid_t parent = ::getpid();
  const pid_t id = ::fork();
  if (id == 0) {
    becomeChild(argument_pointers.data(), environment_pointers.data(), command.folder.c_str(), parent,
                command.output ? output.write.get() : log.write.get(), log.write.get(), failure.write.get());
  }
  if (id < 0) throw Error(ErrorKind::device, arguments[0], "cannot start: " + systemReason());
  process.emplace(id, command.patience);
  for (Pipe* pipe : {&log, &output, &failure}) pipe->write.close();
  int reason = 0;
  ssize_t failed = 0;
  while ((failed = ::read(failure.read.get(), &reason, sizeof reason)) < 0 && errno == EINTR) {
  }
  if (failed == sizeof reason) {
    throw Error(ErrorKind::device, arguments[0], "cannot start: " + std::generic_category().message(reason));
  }

  std::array<pollfd, 2> open = {{{log.read.get(), POLLIN, 0}, {output.read.get(), POLLIN, 0}}};
  std::vector<std::uint8_t> buffer(std::size_t{1} << 16);
  while (open[0].fd >= 0 || open[1].fd >= 0) {
    if (stop != 0) throw Stopped();
    if (command.meanwhile) command.meanwhile();
    if (::poll(open.data(), open.size(), kPollEvery) <= 0) continue;
    for (pollfd& end : open) {
      if (end.fd < 0 || end.revents == 0) continue;
      const ssize_t count = ::read(end.fd, buffer.data(), buffer.size());
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) {
        end.fd = -1;
        continue;
      }
      const std::span<const std::uint8_t> bytes(buffer.data(), static_cast<std::size_t>(count));
      if (&end == &open[1]) {
        command.output(bytes);
      } else {
        words.add(bytes);
      }
    }
  }
  std::optional<int> status;
  while (!(status = process->status())) {
    if (stop != 0) throw Stopped();
    if (command.meanwhile) command.meanwhile();
    ::poll(nullptr, 0, kPollEnd);
  }
  if (stop != 0) throw Stopped();
  return {WIFEXITED(*status) ? WEXITSTATUS(*status) : 128 + WTERMSIG(*status), words.last()};
}

}  // namespace tg
