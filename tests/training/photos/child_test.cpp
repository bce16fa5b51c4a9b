// SPDX-License-Identifier: Apache-2.0
// Children: what they say, how they end, and that they end with their parent.
#include "training/photos/child.h"

#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>
#include <thread>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace {

std::string textOf(const std::filesystem::path& path) {
  std::ifstream stream(path);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// Not one that nobody has waited for.
bool lives(pid_t id) {
  const std::string stat = textOf("/proc/" + std::to_string(id) + "/stat");
  return !stat.empty() && stat.find(") Z ") == stat.npos;
}

}  // namespace

TEST_CASE("a child gets its words as they are, and its own come line by line and into the log", "[photos]") {
  const tg::TemporaryFolder folder;
  const std::atomic<int> stop{0};
  std::vector<std::string> lines;
  const std::string odd = "a 'b' \"c\" $HOME\n*";
  const tg::ChildEnd end =
      tg::runChild({{"/bin/sh", "-c", "printf '%s' \"$1\"; printf 'x\\ry\\n' >&2; exit 7", "sh", odd},
                    folder / "log.txt",
                    [&](std::string_view line) { lines.emplace_back(line); },
                    {}},
                   stop);
  CHECK(end.code == 7);
  CHECK(lines == std::vector<std::string>{"a 'b' \"c\" $HOME", "*x", "y"});
  CHECK(end.last == "a 'b' \"c\" $HOME | *x | y");
  CHECK(textOf(folder / "log.txt") == odd + "x\ry\n");
}

TEST_CASE("a child's output goes where it is asked for, however much it is", "[photos]") {
  const tg::TemporaryFolder folder;
  const std::atomic<int> stop{0};
  std::size_t bytes = 0;
  const auto output = [&](std::span<const std::uint8_t> piece) { bytes += piece.size(); };
  const tg::ChildEnd end = tg::runChild(
      {{"/bin/sh", "-c", "head -c 3000000 /dev/zero; echo said >&2"}, folder / "log.txt", {}, output}, stop);
  CHECK(end.code == 0);
  CHECK(bytes == 3'000'000);
  CHECK(textOf(folder / "log.txt") == "said\n");
}

TEST_CASE("a child works in the folder that it is given, and who waits has something to do meanwhile", "[photos]") {
  const tg::TemporaryFolder folder;
  const std::atomic<int> stop{0};
  int calls = 0;
  tg::ChildCommand command{
      {"/bin/sh", "-c", "pwd; until [ -e enough ]; do sleep 0.02; done"}, folder / "log.txt", {}, {}};
  command.folder = folder.path;
  command.meanwhile = [&] {
    if (++calls == 3) std::ofstream(folder / "enough").flush();
  };
  CHECK(tg::runChild(command, stop).last == std::filesystem::canonical(folder.path).string());
  CHECK(calls >= 3);
  command.folder = folder / "absent";
  CHECK_THROWS_AS(tg::runChild(command, stop), tg::Error);
  command.folder.clear();
  command.words = {"/bin/sleep", "60"};
  command.meanwhile = [&] { throw tg::Stopped(); };
  CHECK_THROWS_AS(tg::runChild(command, stop), tg::Stopped);
}

TEST_CASE("a child that cannot be started, or dies by a signal, is told", "[photos]") {
  const tg::TemporaryFolder folder;
  const std::atomic<int> stop{0};
  CHECK(tg::test::messageOf([&] { tg::runChild({{"/absent/program"}, folder / "log.txt", {}, {}}, stop); },
                            tg::ErrorKind::device) == "/absent/program: cannot start: No such file or directory");
  CHECK(tg::runChild({{"/bin/sh", "-c", "kill -9 $$"}, folder / "log.txt", {}, {}}, stop).code == 128 + SIGKILL);
  CHECK_THROWS_AS(tg::runChild({{"/bin/true"}, folder / "absent/log.txt", {}, {}}, stop), tg::Error);
}

TEST_CASE("of a child that crashed its cause is told rather than its stack", "[photos]") {
  const tg::TemporaryFolder folder;
  const std::atomic<int> stop{0};
  // As glibc and glog write.
  const std::string said =
      "*** buffer overflow detected ***: terminated\nF20261201 02:03:04.5 12 mapper.cc:7] Check failed: "
      "file.is_open()\n"
      "*** Check failure stack trace: ***\n    @     0x7f01  google::LogMessage::Fail()\n    @              0x0  "
      "(unknown)\n"
      "*** Aborted at 1764554584 (unix time) try \"date -d @1764554584\" ***\nPC: @     0x7f02 (unknown)\n"
      "*** SIGABRT (@0x1) received by PID 1; stack trace: ***\n    @     0x7f03 abort\n    @ 0x7f04 main\n";
  const tg::ChildEnd end = tg::runChild(
      {{"/bin/sh", "-c", "printf '%s' \"$1\" >&2; kill -ABRT $$", "sh", said}, folder / "log.txt", {}, {}}, stop);
  CHECK(end.code == 128 + SIGABRT);
  CHECK(end.last ==
        "*** buffer overflow detected ***: terminated | F20261201 02:03:04.5 12 mapper.cc:7] Check failed: "
        "file.is_open()");
  CHECK(textOf(folder / "log.txt") == said);
}

TEST_CASE("a child that is to stop ends, with its own children, also one that does not listen", "[photos]") {
  const tg::TemporaryFolder folder;
  std::atomic<int> stop{0};
  std::vector<pid_t> ids;
  const auto line = [&](std::string_view text) {
    ids.push_back(std::stoi(std::string(text)));
    if (ids.size() == 2) stop = SIGINT;
  };
  CHECK_THROWS_AS(
      tg::runChild({{"/bin/sh", "-c", "/bin/sh -c 'trap \"\" TERM; echo $$; exec sleep 60' & echo $$; wait"},
                    folder / "log.txt",
                    line,
                    {}},
                   stop),
      tg::Stopped);
  REQUIRE(ids.size() == 2);
  for (int wait = 0; wait < 3000 && (lives(ids[0]) || lives(ids[1])); ++wait) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  CHECK_FALSE(lives(ids[0]));
  CHECK_FALSE(lives(ids[1]));
  CHECK_THROWS_AS(tg::runChild({{"/bin/true"}, folder / "log.txt", {}, {}}, stop), tg::Stopped);
}

TEST_CASE("a child that writes what nobody takes any more ends at once where its user stops it", "[photos]") {
  const tg::TemporaryFolder folder;
  std::atomic<int> stop{0};
  // As ffmpeg: deaf while it writes.
  tg::ChildCommand command{{"/bin/sh", "-c", "trap '' TERM; cat /dev/zero"}, folder / "log.txt", {}, {}};
  command.output = [&](std::span<const std::uint8_t>) { stop = SIGINT; };
  command.patience = std::chrono::seconds(60);
  const auto begun = std::chrono::steady_clock::now();
  CHECK_THROWS_AS(tg::runChild(command, stop), tg::Stopped);
  CHECK(std::chrono::steady_clock::now() - begun < command.patience / 2);
}

TEST_CASE("programs are found on the PATH alone, and only those that may be run", "[photos]") {
  const tg::TemporaryFolder folder;
  std::ofstream(folder / "tool") << "#!/bin/sh\n";
  const std::string before = std::getenv("PATH");
  ::setenv("PATH", folder.path.c_str(), 1);
  const auto not_yet = tg::findProgram("tool");
  std::filesystem::permissions(folder / "tool", std::filesystem::perms::owner_all);
  const auto found = tg::findProgram("tool");
  const auto absent = tg::findProgram("sh");
  ::setenv("PATH", before.c_str(), 1);
  CHECK_FALSE(not_yet);
  CHECK(found == folder / "tool");
  CHECK_FALSE(absent);
  CHECK(tg::findProgram("/bin/sh"));
}
