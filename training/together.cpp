// SPDX-License-Identifier: Apache-2.0
// Joining, sharing, following.
#include "training/together.h"

#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <string_view>
#include <thread>

#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/system/signals.h"
#include "training/mpi/engine.h"
#include "training/mpi/launch.h"

namespace tg {
namespace {

constexpr std::chrono::seconds kFirstSaysIt(2);

// What the photographs are called, in their order.
std::string listOf(const Dataset& dataset) {
  uLong crc = 0;
  for (const std::string& file : dataset.files) {
    crc = crc32_z(crc, reinterpret_cast<const Bytef*>(file.c_str()), file.size() + 1);
  }
  return std::to_string(dataset.files.size()) + " photographs, checksum of their names " + std::to_string(crc);
}

}  // namespace

std::unique_ptr<Processes> joinProcesses(int argc, char** argv, const std::vector<std::string>& commands) {
  const Launch launch = launchOf();
  if (!launch.together()) return nullptr;
  const std::string_view first = argc > 1 ? argv[1] : "";
  try {
    if (first == "photos") {
      throw Error(ErrorKind::usage,
                  "photos: expected one process (several train what it has prepared: mpirun -np N tgtrain FOLDER)");
    }
    if (std::ranges::find(commands, first) != commands.end()) return nullptr;
    std::string arguments;
    for (int i = 1; i < argc; ++i) arguments += (i > 1 ? " " : "") + std::string(argv[i]);
    return std::make_unique<Processes>(openMpiChannel(), arguments);
  } catch (const Error&) {
    // Mostly all find the same: the first says it, and with its end mpirun ends the others, which wait for that. Were
    // one of them over sooner, the first would be ended before what it says is through.
    if (launch.rank > 0) std::this_thread::sleep_for(kFirstSaysIt);
    throw;
  }
}

std::optional<int> parseTogether(Processes* processes, const std::function<std::optional<int>()>& parse) {
  if (!processes) return parse();
  constexpr int kGoOn = -1;
  const std::optional<int> found = processes->isFirst() ? parse() : std::nullopt;
  const int code = processes->fromFirst(found.value_or(kGoOn));
  if (code == kGoOn) return processes->isFirst() ? std::nullopt : parse();
  processes->endTogether();
  return code;
}

void takeShare(Processes& processes, int threads, bool memory, DatasetOptions& options) {
  const Channel& channel = processes.channel();
  const int here = std::max(channel.onThisMachine(), 1);
  if (threads == 0) {
    // Where the starter has not bound processes to cores, each sees all of them.
    const auto cores = static_cast<int>(std::thread::hardware_concurrency());
    const bool bound = cores < ::sysconf(_SC_NPROCESSORS_ONLN);
    setThreadCount(bound ? cores : std::max(1, cores / here));
  }
  if (memory)
    options.image_memory = std::max<std::uint64_t>(1, options.image_memory / static_cast<std::uint64_t>(here));
  options.part = channel.rank();
  options.parts = channel.size();
}

void beginTogether(Processes& processes, const std::function<void()>& load, const Dataset& dataset) {
  std::exception_ptr failed;
  try {
    load();
  } catch (...) {
    failed = std::current_exception();
  }
  processes.agree(failed, "data set", listOf(dataset));
}

int followFirst(Processes& processes, const std::string& folder, const std::function<DatasetOptions()>& options) {
  Dataset dataset;
  beginTogether(processes, [&] { dataset = loadDataset(folder, options()); }, dataset);
  handleStopSignals([](int) {});  // the first process says when it is over
  const int code = serveRank(processes.channel(), dataset);
  processes.endTogether();
  return code;
}

void endTogether(Processes& processes, int code) {
  endRanks(processes.channel(), code);
  processes.endTogether();
}

}  // namespace tg
