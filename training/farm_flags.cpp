// SPDX-License-Identifier: Apache-2.0
// Flags to options, and what a worker says to lines.
#include "training/farm_flags.h"

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "core/file/file.h"
#include "core/system/error.h"
#include "core/system/program.h"
#include "core/system/signals.h"
#include "training/cli.h"
#include "training/farm/claims.h"
#include "training/farm/status.h"

namespace tg {
namespace {

std::atomic<int> farm_stopped_by{0};  // a signal

void stopFarm(int signal) {
  if (farm_stopped_by.exchange(signal) != 0) endAtOnce(signal);
}

int showStatus(const FarmFlags& flags) {
  const FarmFolder farm(flags.status);
  if (!flags.html.empty()) refuseExisting(flags.html, flags.overwrite);
  const std::vector<FarmRow> rows = rowsOf(farm, flags.farm.stale);
  if (!flags.html.empty()) {
    std::error_code ignored;
    const std::filesystem::path folder = std::filesystem::weakly_canonical(flags.status, ignored);
    writeTextAtomically(flags.html, statusPage(folder.filename().string(), rows));
  }
  if (!flags.quiet) std::printf("%s%s\n", statusTable(rows).c_str(), summaryOf(rows).c_str());
  return 0;
}

}  // namespace

void addFarmFlags(CLI::App& app, FarmFlags& flags) {
  FarmOptions& farm = flags.farm;
  app.add_option("jobs", farm.jobs, "JOBS.jsonl: {\"name\": ..., \"dataset\": ..., \"flags\": [...]} a line")
      ->type_name("FILE");
  app.add_option("--out", farm.folder, "Folder that all workers share; results/NAME are the models")
      ->type_name("FOLDER");
  app.add_flag("--prepare", farm.prepare, "Only begin the farm: once, before workers that --join it");
  app.add_flag("--join", farm.join, "Refuse a folder that holds no farm yet, as a share that is not mounted");
  app.add_flag("--no-wait", farm.no_wait, "End when no job is open, though others may die at theirs");
  app.add_option("--threads", farm.threads, "Threads of each training (0: all cores)")->check(within(0, 4096));
  app.add_option("--retries", farm.retries, "Further attempts at a job whose training failed")
      ->check(within(0, 1000))
      ->capture_default_str();
  app.add_option("--takeovers", farm.takeovers, "Deaths of workers at a job before it is given up")
      ->check(within(0, 100'000))
      ->capture_default_str();
  app.add_option("--heartbeat", farm.heartbeat, "Time between two signs of life [s]")
      ->check(within(0.01, 3600.0))
      ->capture_default_str();
  app.add_option("--stale", farm.stale, "A worker without one for so long is dead, for --status, too [s]")
      ->check(within(0.03, 86400.0))
      ->capture_default_str();
  app.add_option("--status", flags.status, "Print how the farm in this folder stands, and end")->type_name("FOLDER");
  app.add_option("--html", flags.html, "Also write it as a page")->type_name("FILE");
  app.add_flag("--overwrite", flags.overwrite, "Replace an existing page");
  app.add_flag("-q,--quiet", flags.quiet, "Errors only");
  addExamples(app,
              {{"tgtrain farm jobs.jsonl --out farm", "a worker; start as many as you like, anywhere"},
               {"mpirun -np 8 tgtrain farm jobs.jsonl --out farm --threads 4", "eight of them"},
               {"tgtrain farm jobs.jsonl --out /share/farm --prepare", "begin it once, then --join it"},
               {"tgtrain farm --status farm", "how it stands"},
               {"tgtrain farm --status farm --html farm.html", "as a page, too"}},
              "scripts/farm has commented files for Slurm, MPI and GNU parallel.");
}

int runFarm(const FarmFlags& flags) {
  if (!flags.status.empty()) {
    if (!flags.farm.jobs.empty() || !flags.farm.folder.empty()) {
      throw Error(ErrorKind::usage, "farm: --status stands alone (expected no JOBS.jsonl and no --out)");
    }
    return showStatus(flags);
  }
  if (!flags.html.empty() || flags.overwrite) throw Error(ErrorKind::usage, "farm: --html expects --status FOLDER");
  if (flags.farm.jobs.empty() || flags.farm.folder.empty()) {
    throw Error(ErrorKind::usage, "farm: expected JOBS.jsonl and --out FOLDER, or --status FOLDER");
  }
  FarmListener listener;
  listener.say = [&](const std::string& line) {
    if (!flags.quiet) std::printf("%s\n", printable(line).c_str());
    std::fflush(stdout);
  };
  listener.warn = [](const std::string& line) { std::fprintf(stderr, "tgtrain: %s\n", printable(line).c_str()); };
  handleStopSignals(stopFarm);
  return workOnFarm(flags.farm, listener, farm_stopped_by);
}

}  // namespace tg
