// SPDX-License-Identifier: Apache-2.0
// Whole files: bounds in, all or nothing out.
#include <sys/inotify.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <new>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/file/atomic_files.h"
#include "core/file/file.h"
#include "core/file/quick_file.h"
#include "core/file/scratch_folder.h"
#include "core/system/descriptor.h"
#include "core/system/error.h"
#include "core/system/signals.h"
#include "core/system/temporary_files.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

using Bytes = std::vector<std::uint8_t>;

namespace {

std::size_t fileCount(const std::filesystem::path& folder) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) count += entry.exists();
  return count;
}

tg::ErrorKind kindOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const tg::Error& e) {
    return e.kind;
  }
  throw std::logic_error("expected an error");
}

}  // namespace

TEST_CASE("bytes survive a file, and a second write replaces the first") {
  const tg::TemporaryFolder folder;
  Bytes bytes(100000);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i * 7);
  tg::writeFileAtomically(folder / "a", Bytes{1, 2, 3});
  tg::writeFileAtomically(folder / "a", bytes);
  REQUIRE(tg::readFile(folder / "a", 100000) == bytes);
  tg::writeFileAtomically(folder / "a", Bytes{});
  REQUIRE(tg::readFile(folder / "a", 0).empty());
  REQUIRE(fileCount(folder.path) == 1);
}

TEST_CASE("what is written may be read by whom the process' mask allows") {
  const tg::TemporaryFolder folder;
  const mode_t before = ::umask(027);
  tg::writeFileAtomically(folder / "a", Bytes{1});
  ::umask(before);
  REQUIRE(std::filesystem::status(folder / "a").permissions() == std::filesystem::perms{0640});
}

TEST_CASE("what replaces a file may be read by whom that one could") {
  const tg::TemporaryFolder folder;
  tg::writeTextAtomically(folder / "a", "1");
  std::filesystem::permissions(folder / "a", std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  tg::writeTextAtomically(folder / "a", "2");
  CHECK(std::filesystem::status(folder / "a").permissions() ==
        (std::filesystem::perms::owner_read | std::filesystem::perms::owner_write));
}

TEST_CASE("a pipe, which does not say how long it is, is read to its end") {
  const tg::TemporaryFolder folder;
  const std::string pipe = folder / "pipe";
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  const Bytes bytes(100000, 7);
  std::thread writer([&] {
    std::ofstream out(pipe, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  });
  Bytes read;
  CHECK_NOTHROW(read = tg::readFile(pipe, bytes.size()));
  writer.join();
  REQUIRE(read == bytes);
}

TEST_CASE("missing files, folders and files beyond the bound cannot be read") {
  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "a", Bytes(11));
  REQUIRE(kindOf([&] { tg::readFile(folder / "b", 10); }) == tg::ErrorKind::cannotRead);
  REQUIRE(kindOf([&] { tg::readFile(folder.path, 10); }) == tg::ErrorKind::cannotRead);
  REQUIRE_THROWS_WITH(tg::readFile(folder / "a", 10), Contains("too long (expected at most 10 bytes, found 11)"));
  REQUIRE_THROWS_WITH(tg::readFile("/dev/zero", 100000), Contains("too long"));
}

TEST_CASE("a copy is whole or not there") {
  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "a", Bytes{1, 2, 3});
  tg::writeFileAtomically(folder / "b", Bytes{4});
  tg::copyFileAtomically(folder / "a", folder / "b");
  REQUIRE(tg::readFile(folder / "b", 10) == Bytes{1, 2, 3});
  REQUIRE_THROWS_WITH(tg::copyFileAtomically(folder / "missing", folder / "b"),
                      Contains("missing: cannot open: No su"));
  REQUIRE(kindOf([&] { tg::copyFileAtomically(folder / "a", folder / "no/b"); }) == tg::ErrorKind::cannotWrite);
  REQUIRE(tg::readFile(folder / "b", 10) == Bytes{1, 2, 3});
  REQUIRE(fileCount(folder.path) == 2);

  Bytes large((std::size_t{5} << 18) + 3);
  for (std::size_t i = 0; i < large.size(); ++i) large[i] = static_cast<std::uint8_t>(i * i / 251);
  tg::writeFileAtomically(folder / "a", large);
  using std::filesystem::perms;
  const auto permissionsOf = [&](const char* name) { return std::filesystem::status(folder / name).permissions(); };
  std::filesystem::permissions(folder / "a", perms::owner_read | perms::others_read);
  std::filesystem::permissions(folder / "b", perms::owner_read | perms::group_read);
  std::filesystem::create_symlink("a", folder / "link");
  tg::copyFileAtomically(folder / "link", folder / "b");
  tg::copyFileAtomically(folder / "link", folder / "c");
  REQUIRE(tg::readFile(folder / "b", large.size()) == large);
  REQUIRE(tg::readFile(folder / "c", large.size()) == large);
  REQUIRE(permissionsOf("b") == (perms::owner_read | perms::group_read));
  REQUIRE(permissionsOf("c") == (perms::owner_read | perms::others_read));
}

TEST_CASE("what is written by the name of a symbolic link is what the link leads to") {
  const tg::TemporaryFolder folder;
  namespace fs = std::filesystem;
  fs::create_directory(folder / "far");
  fs::create_directory(folder / "near");
  tg::writeFileAtomically(folder / "far/a", Bytes{1});
  fs::permissions(folder / "far/a", fs::perms::owner_read | fs::perms::owner_write);
  fs::create_symlink("../far/middle", folder / "near/link.b");
  fs::create_symlink(folder / "far/a", folder / "far/middle");
  fs::create_symlink("../far/none", folder / "near/dangling");
  tg::writeFileAtomically(folder / "near/link.b", [&](const fs::path& temporary) {
    REQUIRE(temporary.parent_path() == folder / "far");  // from where it can be renamed
    REQUIRE(temporary.extension() == ".b");
    REQUIRE(fs::status(temporary).permissions() == (fs::perms::owner_read | fs::perms::owner_write));
    tg::FileWriter(temporary, temporary).write(0, Bytes{2});
  });
  CHECK(tg::readFile(folder / "far/a", 10) == Bytes{2});
  CHECK(fs::status(folder / "far/a").permissions() == (fs::perms::owner_read | fs::perms::owner_write));
  CHECK(fs::is_symlink(folder / "near/link.b"));
  tg::writeFileQuickly(folder / "near/link.b",
                       [](const fs::path& temporary) { tg::FileWriter(temporary, temporary).write(0, Bytes{3}); });
  CHECK(tg::readFile(folder / "far/a", 10) == Bytes{3});
  tg::copyFileAtomically(folder / "far/a", folder / "near/dangling");
  CHECK(tg::readFile(folder / "far/none", 10) == Bytes{3});
  CHECK(fs::is_symlink(folder / "near/dangling"));
  {
    const tg::KeepExisting keep;
    REQUIRE_THROWS_WITH(tg::writeFileAtomically(folder / "near/link.b", Bytes{4}), Contains("exists already"));
  }
  {
    tg::AtomicFiles files;
    files.add(folder / "near/link.b", Bytes{5});
    files.add(folder / "near/other", Bytes{5});
    fs::create_directory(folder / "near/other");  // a file cannot be renamed to it
    REQUIRE(kindOf([&] { files.commit(); }) == tg::ErrorKind::cannotWrite);
  }
  CHECK(tg::readFile(folder / "far/a", 10) == Bytes{3});
  fs::create_symlink("no/b", folder / "lost");
  REQUIRE_THROWS_WITH(tg::requireWritable(folder / "lost"), Contains("lost: cannot write here: No such file"));
  fs::create_symlink("loop", folder / "loop");
  REQUIRE_THROWS_WITH(tg::writeFileAtomically(folder / "loop", Bytes{1}),
                      Contains("loop: cannot write here: Too many levels of symbolic links"));
  CHECK(fileCount(folder / "far") == 3);
  CHECK(fileCount(folder / "near") == 3);
}

TEST_CASE("no link of another user in a folder that all may write to is followed") {
  TG_SKIP_IF(::geteuid() != 0 ? "only root makes a link another user's" : "");
  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "a", Bytes{1});
  std::filesystem::create_directory(folder / "shared");
  std::filesystem::create_symlink("../a", folder / "shared/link");
  REQUIRE(::lchown((folder / "shared/link").c_str(), 1234, 1234) == 0);
  const auto writes = [&] { tg::writeFileAtomically(folder / "shared/link", Bytes{2}); };
  writes();
  CHECK(tg::readFile(folder / "a", 10) == Bytes{2});
  REQUIRE(::chmod((folder / "shared").c_str(), 01777) == 0);
  CHECK_THAT(tg::test::messageOf(writes, tg::ErrorKind::cannotWrite), Contains("shared/link: cannot write here: "));
  CHECK_THROWS_AS(tg::requireWritable(folder / "shared/link"), tg::Error);
  CHECK(tg::readFile(folder / "a", 10) == Bytes{2});
  CHECK(fileCount(folder / "shared") == 1);
}

TEST_CASE("a copy has its permissions before its content") {
  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "a", Bytes(100));
  std::filesystem::permissions(folder / "a", std::filesystem::perms::owner_read);
  const tg::Descriptor events(::inotify_init1(IN_NONBLOCK | IN_CLOEXEC));
  REQUIRE(::inotify_add_watch(events.get(), folder.path.c_str(), IN_MODIFY | IN_ATTRIB) >= 0);
  tg::copyFileAtomically(folder / "a", folder / "b");
  alignas(inotify_event) std::array<char, 4096> buffer;
  const ssize_t size = ::read(events.get(), buffer.data(), buffer.size());
  std::vector<std::uint32_t> masks;
  for (ssize_t at = 0; at < size;) {
    inotify_event event;
    std::memcpy(&event, buffer.data() + at, sizeof event);
    masks.push_back(event.mask);
    at += static_cast<ssize_t>(sizeof event) + event.len;
  }
  REQUIRE(std::ranges::find(masks, IN_ATTRIB) != masks.end());
  CHECK(masks.back() == IN_MODIFY);
}

TEST_CASE("a copy that finds no room says so") {
  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "a", Bytes(300'000));
  const auto before = std::signal(SIGXFSZ, SIG_IGN);
  rlimit limit{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &limit) == 0);
  const rlimit small{100'000, limit.rlim_max};
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  const auto copies = [&] { tg::copyFileAtomically(folder / "a", folder / "b"); };
  const std::string said = tg::test::messageOf(copies, tg::ErrorKind::cannotWrite);
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &limit) == 0);
  std::signal(SIGXFSZ, before);
  REQUIRE(said == (folder / "b").string() + ": cannot write: File too large");
  REQUIRE(fileCount(folder.path) == 1);
}

TEST_CASE("what a signal handler removes is what is half written, and nothing else") {
  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "a", Bytes{7});
  const auto interrupted = [&] {
    tg::writeFileAtomically(folder / "a", [&](const std::filesystem::path& outer) {
      tg::writeFileAtomically(folder / "b", [&](const std::filesystem::path& inner) {
        tg::removeTemporaryFiles();
        REQUIRE_FALSE(std::filesystem::exists(outer));
        REQUIRE_FALSE(std::filesystem::exists(inner));
      });
    });
  };
  // More often than names are remembered at a time.
  for (int i = 0; i < 20; ++i) REQUIRE(kindOf(interrupted) == tg::ErrorKind::cannotWrite);
  REQUIRE(fileCount(folder.path) == 1);
  tg::removeTemporaryFiles();
  REQUIRE(tg::readFile(folder / "a", 10) == Bytes{7});
}

TEST_CASE("a signal handler removes a folder that is half written, with all that is in it") {
  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "a", Bytes{7});
  const std::filesystem::path half = folder / "half";
  {
    std::filesystem::create_directories(half / "inner" / "most");
    std::filesystem::create_directory_symlink(folder.path, half / "link");
    for (int i = 0; i < 500; ++i) {  // more than one read of a folder tells
      tg::writeFileAtomically(half / "inner" / ("a file with a long name " + std::to_string(i)), Bytes{1});
    }
    const tg::RemovedBySignal removed(half);
    tg::removeTemporaryFiles();
    REQUIRE(fileCount(folder.path) == 1);
  }
  std::filesystem::create_directory(half);
  tg::removeTemporaryFiles();
  REQUIRE(fileCount(folder.path) == 2);
  REQUIRE(tg::readFile(folder / "a", 10) == Bytes{7});
}

TEST_CASE("a folder that was made for files goes with what failed or was interrupted unless something is in it") {
  const tg::TemporaryFolder folder;
  const std::filesystem::path made = folder / "made";
  {
    const tg::FolderToFill filled(made);
  }
  REQUIRE_FALSE(std::filesystem::exists(made));
  for (const bool by_signal : {false, true}) {
    {
      const tg::FolderToFill filled(made);
      tg::AtomicFiles files;
      files.add(made / "a", Bytes{7});
      REQUIRE(std::filesystem::exists(made));
      if (!by_signal) continue;
      tg::removeTemporaryFiles();
      REQUIRE_FALSE(std::filesystem::exists(made));
    }
    REQUIRE_FALSE(std::filesystem::exists(made));
  }
  {
    const tg::FolderToFill filled(made);
    tg::writeFileAtomically(made / "of somebody else", Bytes{1});
    tg::removeTemporaryFiles();
  }
  REQUIRE(fileCount(made) == 1);
  std::filesystem::remove_all(made);
  std::filesystem::create_directory(made);  // empty, but not ours
  {
    const tg::FolderToFill filled(made);
    tg::removeTemporaryFiles();
  }
  REQUIRE(std::filesystem::exists(made));
  std::filesystem::remove(made);
  {
    tg::FolderToFill filled(made);
    filled.keep();
    tg::removeTemporaryFiles();
  }
  REQUIRE(std::filesystem::exists(made));
}

TEST_CASE("a program that a signal ends leaves nothing half written, whatever its threads are about to write") {
  const tg::TemporaryFolder folder;
  for (int round = 0; round < 40; ++round) {
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      std::vector<std::thread> writers;
      for (int i = 0; i < 4; ++i) {
        writers.emplace_back([&, i] {
          try {
            for (;;) tg::writeFileAtomically(folder / std::to_string(i), Bytes(1000));
          } catch (const tg::Error&) {
            std::_Exit(4);  // as a program does that says what failed
          }
        });
      }
      std::this_thread::sleep_for(std::chrono::microseconds(2000 + 100 * round));
      tg::endAtOnce(SIGTERM);
      std::_Exit(1);
    }
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    REQUIRE(WIFSIGNALED(status));
    REQUIRE(WTERMSIG(status) == SIGTERM);
    for (const auto& entry : std::filesystem::directory_iterator(folder.path)) {
      INFO("round " << round << ": " << entry.path());
      REQUIRE(entry.path().filename().string().front() != '.');
    }
  }
}

TEST_CASE("a program that a signal ends leaves no temporary folder, however soon after it was made") {
  const tg::TemporaryFolder folder;
  for (int round = 0; round < 100; ++round) {
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      ::setenv("TMPDIR", folder.path.c_str(), 1);
      tg::handleStopSignals(tg::endAtOnce);
      for (;;) const tg::ScratchFolder scratch;
    }
    const auto begun = [&] { return fileCount(folder.path) > 0; };
    for (int wait = 0; wait < 10'000 && !begun(); ++wait) std::this_thread::sleep_for(std::chrono::microseconds(100));
    ::kill(child, SIGTERM);
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    REQUIRE(WIFSIGNALED(status));
    REQUIRE(WTERMSIG(status) == SIGTERM);
    INFO("round " << round);
    REQUIRE(fileCount(folder.path) == 0);
  }
}

TEST_CASE("an exception while writing leaves the older file and nothing beside it") {
  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "a.txt", Bytes{7});
  REQUIRE_THROWS_AS(tg::writeFileAtomically(folder / "a.txt",
                                            [&](const std::filesystem::path& temporary) {
                                              REQUIRE(temporary.extension() == ".txt");
                                              REQUIRE(temporary.parent_path() == folder.path);
                                              tg::writeFileAtomically(temporary, Bytes{8});
                                              throw std::runtime_error("stop");
                                            }),
                    std::runtime_error);
  REQUIRE(tg::readFile(folder / "a.txt", 10) == Bytes{7});
  REQUIRE(fileCount(folder.path) == 1);
}

TEST_CASE("of files that belong together all are new or all are old") {
  const tg::TemporaryFolder folder;
  tg::writeTextAtomically(folder / "first", "old");
  {
    tg::AtomicFiles files;
    files.add(folder / "first", Bytes{1});
    files.add(folder / "second", Bytes{2});
    files.add(folder / "third", Bytes{3});
    std::filesystem::create_directory(folder / "third");  // a file cannot be renamed to it
    REQUIRE(kindOf([&] { files.commit(); }) == tg::ErrorKind::cannotWrite);
  }
  REQUIRE(tg::readFile(folder / "first", 100) == Bytes{'o', 'l', 'd'});
  REQUIRE(fileCount(folder / "") == 2);  // first and third
}

TEST_CASE("two files that belong together are no less one") {
  const tg::TemporaryFolder folder;
  tg::writeTextAtomically(folder / "first", "old");
  {
    tg::AtomicFiles files;
    files.add(folder / "first", Bytes{1});
    files.add(folder / "second", Bytes{2});
    std::filesystem::create_directory(folder / "second");
    REQUIRE(kindOf([&] { files.commit(); }) == tg::ErrorKind::cannotWrite);
  }
  REQUIRE(tg::readFile(folder / "first", 100) == Bytes{'o', 'l', 'd'});
}

TEST_CASE("folders, devices and paths into nowhere cannot be written") {
  const tg::TemporaryFolder folder;
  REQUIRE(kindOf([&] { tg::writeFileAtomically(folder / "no/a", Bytes{1}); }) == tg::ErrorKind::cannotWrite);
  REQUIRE(kindOf([&] { tg::writeFileAtomically(folder.path, Bytes{1}); }) == tg::ErrorKind::cannotWrite);
  REQUIRE(kindOf([&] { tg::writeFileAtomically("/dev/null", Bytes{1}); }) == tg::ErrorKind::cannotWrite);
  REQUIRE(kindOf([&] { tg::writeFileAtomically(folder / (std::string(300, 'x')), Bytes{1}); }) ==
          tg::ErrorKind::cannotWrite);
  REQUIRE(fileCount(folder.path) == 0);
}

TEST_CASE("a disk that is full ends a write") {
  const tg::FileWriter full("/dev/full", "out.ply");
  REQUIRE_THROWS_WITH(full.write(0, Bytes{1}), Contains("out.ply: cannot write: No space left"));
}

TEST_CASE("a hundred temporary names that others have are enough to give up") {
  const tg::TemporaryFolder folder;
  std::string used;
  tg::writeFileAtomically(folder / "a", [&](const std::filesystem::path& temporary) { used = temporary.string(); });
  const std::size_t number = used.rfind('-') + 1;
  const int last = std::stoi(used.substr(number));
  for (int i = 1; i <= 100; ++i) std::ofstream(used.substr(0, number) + std::to_string(last + i)) << "another's";
  REQUIRE_THROWS_WITH(tg::writeFileAtomically(folder / "b", Bytes{1}), Contains("no free temporary name"));
  REQUIRE(fileCount(folder.path) == 101);
  tg::writeFileAtomically(folder / "b", Bytes{1});
  REQUIRE(fileCount(folder.path) == 102);
}

TEST_CASE("a place that cannot be written is known beforehand, and asking leaves nothing") {
  const tg::TemporaryFolder folder;
  tg::requireWritable(folder / "a");
  REQUIRE(fileCount(folder.path) == 0);
  tg::writeFileAtomically(folder / "a", Bytes{7});
  tg::requireWritable(folder / "a");
  REQUIRE(tg::readFile(folder / "a", 10) == Bytes{7});
  for (const std::filesystem::path& path : {folder / "no/a", folder.path, std::filesystem::path("/dev/full"),
                                            folder / std::string(300, 'x'), folder / ""}) {
    REQUIRE(kindOf([&] { tg::requireWritable(path); }) == tg::ErrorKind::cannotWrite);
  }
  REQUIRE(fileCount(folder.path) == 1);
}

TEST_CASE("a name without folder is written to the working folder") {
  const tg::TemporaryFolder folder;
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path);
  tg::writeFileAtomically("plain", Bytes{5});
  std::filesystem::current_path(before);
  REQUIRE(tg::readFile(folder / "plain", 10) == Bytes{5});
}

TEST_CASE("without a place for temporary files there is one line that names it") {
  const char* const before = std::getenv("TMPDIR");
  const std::string temporary = before ? before : "/tmp";
  ::setenv("TMPDIR", "/nonexistent", 1);
  std::string said;
  try {
    const tg::ScratchFolder folder;
  } catch (const tg::Error& error) {
    CHECK(error.kind == tg::ErrorKind::cannotWrite);
    said = error.what();
  }
  ::setenv("TMPDIR", temporary.c_str(), 1);
  CHECK(said == "/nonexistent: no folder for temporary files: No such file or directory");
}

TEST_CASE("a signal handler removes a scratch folder with what is in it") {
  const tg::ScratchFolder folder;
  std::ofstream(folder.path() / "trial.sog") << "half";
  tg::removeTemporaryFiles();
  CHECK_FALSE(std::filesystem::exists(folder.path()));
}

TEST_CASE("a scratch file is gone with its owner, whatever is thrown meanwhile") {
  const tg::TemporaryFolder folder;
  try {
    const tg::ScratchFile file(folder / "scratch");
    std::ofstream(file.path()) << "half";
    throw std::bad_alloc();
  } catch (const std::bad_alloc&) {
  }
  CHECK_FALSE(std::filesystem::exists(folder / "scratch"));
  CHECK_NOTHROW(tg::ScratchFile(folder / "never there"));
}
