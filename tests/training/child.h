// SPDX-License-Identifier: Apache-2.0
// tgtrain beside a test: started, watched, stopped and killed; and what it leaves.
#pragma once
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "core/file/file.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/program.h"

namespace tg::test {

namespace fs = std::filesystem;

using Bytes = std::vector<std::uint8_t>;

inline std::string contents(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

inline std::vector<std::string> wordsOf(const std::string& text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

// tgtrain at work in a folder, without a display; both its streams in log.txt there.
class Child {
 public:
  Child(const TemporaryFolder& folder, const std::string& arguments) : log_(folder / "log.txt") {
    std::vector<std::string> words = {"env",     "-C", folder.path.string(), "-u",
                                      "DISPLAY", "-u", "WAYLAND_DISPLAY",    TG_TGTRAIN};
    for (const std::string& word : wordsOf(arguments)) words.push_back(word);
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log_.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_APPEND,
                                     0666);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    REQUIRE(posix_spawnp(&process_, "env", &actions, nullptr, pointers.data(), environ) == 0);
    posix_spawn_file_actions_destroy(&actions);
  }
  ~Child() {
    if (process_ == 0) return;
    send(SIGKILL);
    end();
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void send(int signal) const { ::kill(process_, signal); }
  // To what it has started, alone.
  void sendToChildren(int signal) const {
    const std::filesystem::path tasks = "/proc/" + std::to_string(process_) + "/task";
    for (const auto& task : std::filesystem::directory_iterator(tasks)) {
      std::ifstream children(task.path() / "children");
      for (pid_t child; children >> child;) ::kill(child, signal);
    }
  }
  // Exit code, or 128 + signal.
  int end() {
    int status = 0;
    ::waitpid(process_, &status, 0);
    process_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  bool running() const {
    siginfo_t info{};
    return ::waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid == 0;
  }
  // Waits for it, but not for ever.
  void until(const std::function<bool()>& condition) const {
    for (int i = 0; i < 6000 && running() && !condition(); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    INFO(output());
    REQUIRE(condition());
  }
  std::string output() const { return contents(log_); }

 private:
  fs::path log_;
  pid_t process_ = 0;
};

inline Outcome tgtrain(const TemporaryFolder& folder, const std::string& arguments) {
  Child child(folder, arguments);
  const int code = child.end();
  return {code, child.output()};
}

inline Bytes bytesOf(const fs::path& path) { return readFile(path, 1 << 26); }

inline std::vector<nlohmann::json> linesOf(const fs::path& path) {
  std::vector<nlohmann::json> lines;
  std::istringstream stream(contents(path));
  for (std::string line; std::getline(stream, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

inline const std::string kSample =
    "make-sample scene --size 32 --views 4 --test-views 2 --points 200 --supersampling 1";
inline const std::string kBase =
    "scene --reproducible --texture-iterations 20 --compare-untextured --densify-every 5 --densify-from 4 "
    "--gaussians 600 ";
}  // namespace tg::test
