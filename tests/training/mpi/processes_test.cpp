// SPDX-License-Identifier: Apache-2.0
// Processes that are to train together: alike or refused, and an error of one is said once, by the first.
#include "training/mpi/processes.h"

#include <cstdlib>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "support/catch.h"
#include "training/mpi/launch.h"
#include "training/mpi/thread_channel.h"

using tg::test::atRanks;
using tg::test::ThreadChannel;
using tg::test::ThreadRanks;

namespace {

// What each of three ranks says of body(rank, channel): "" where it goes on, an Error's text or "ended CODE".
std::vector<std::string> said(const std::function<void(int, std::unique_ptr<tg::Channel>)>& body) {
  ThreadRanks shared(3);
  std::vector<std::string> texts(3);
  std::mutex mutex;
  atRanks(shared, [&](tg::Channel& channel) {
    std::string text;
    try {
      body(channel.rank(), std::make_unique<ThreadChannel>(shared, channel.rank()));
    } catch (const tg::Error& error) {
      text = std::to_string(tg::exitCode(error)) + " " + error.what();
    } catch (const tg::EndedByFirst& ended) {
      text = "ended " + std::to_string(ended.code);
    }
    const std::lock_guard lock(mutex);
    texts[static_cast<std::size_t>(channel.rank())] = text;
  });
  return texts;
}

// Variables of the environment while it lives.
class Environment {
 public:
  explicit Environment(const std::vector<std::pair<std::string, std::string>>& values) {
    for (const auto& [name, value] : values) {
      names_.push_back(name);
      ::setenv(name.c_str(), value.c_str(), 1);
    }
  }
  ~Environment() {
    for (const std::string& name : names_) ::unsetenv(name.c_str());
  }
  Environment& operator=(Environment&&) = delete;

 private:
  std::vector<std::string> names_;
};

}  // namespace

TEST_CASE("processes with the same command line go on together") {
  const std::vector<std::string> texts = said([](int, std::unique_ptr<tg::Channel> channel) {
    tg::Processes processes(std::move(channel), "scene -o model.tgz");
    processes.agree(nullptr, "data set", "12 photographs");
    if (processes.fromFirst(processes.isFirst() ? 5 : 9) != 5) throw tg::Error(tg::ErrorKind::usage, "not the first's");
  });
  CHECK(texts == std::vector<std::string>(3));
}

TEST_CASE("a process with another command line or data set is refused, and the first says which") {
  std::vector<std::string> texts = said([](int rank, std::unique_ptr<tg::Channel> channel) {
    tg::Processes(std::move(channel), rank == 2 ? "other -o model.tgz" : "scene -o model.tgz");
  });
  CHECK(texts[0] == "1 process 2: has another command line (expected scene -o model.tgz, found other -o model.tgz)");
  CHECK(texts[1] == "ended 1");
  CHECK(texts[2] == "ended 1");
  texts = said([](int rank, std::unique_ptr<tg::Channel> channel) {
    tg::Processes(std::move(channel), "scene").agree(nullptr, "data set", std::to_string(12 - rank / 2));
  });
  CHECK(texts[0] == "1 process 2: has another data set (expected 12, found 11)");
}

TEST_CASE("an error of any process ends all with its code, and the first says it with the number of the process") {
  for (const int failing : {0, 1}) {
    const std::vector<std::string> texts = said([&](int rank, std::unique_ptr<tg::Channel> channel) {
      tg::Processes processes(std::move(channel), "scene");
      std::exception_ptr failed;
      if (rank == failing) {
        failed = std::make_exception_ptr(tg::Error(tg::ErrorKind::cannotRead, "scene", "no such folder"));
      }
      processes.agree(failed, "data set", "");
    });
    CHECK(texts[0] == (failing == 0 ? "2 scene: no such folder" : "2 process 1: scene: no such folder"));
    CHECK(texts[1] == "ended 2");
    CHECK(texts[2] == "ended 2");
  }
}

TEST_CASE("a process knows from Open MPI's, MPICH's and Slurm's variables that it is one of several") {
  CHECK(!tg::launchOf().together());
  {
    const Environment open_mpi({{"OMPI_COMM_WORLD_RANK", "1"}, {"OMPI_COMM_WORLD_SIZE", "2"}});
    CHECK(tg::launchOf().together());
    CHECK(tg::launchOf().rank == 1);
  }
  {
    const Environment alone({{"OMPI_COMM_WORLD_RANK", "0"}, {"OMPI_COMM_WORLD_SIZE", "1"}});
    CHECK(!tg::launchOf().together());
  }
  {
    const Environment mpich({{"PMI_RANK", "0"}, {"PMI_SIZE", "3"}});
    CHECK(tg::launchOf().size == 3);
  }
  {
    const Environment slurm({{"PMIX_RANK", "3"}, {"SLURM_STEP_NUM_TASKS", "4"}});
    CHECK(tg::launchOf().rank == 3);
  }
  const Environment nonsense({{"OMPI_COMM_WORLD_RANK", "4"}, {"OMPI_COMM_WORLD_SIZE", "two"}});
  CHECK(!tg::launchOf().together());
}
