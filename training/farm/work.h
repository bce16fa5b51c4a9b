// SPDX-License-Identifier: Apache-2.0
// A worker of a farm: takes jobs of the shared folder one after the other, each as a child tgtrain.
#pragma once
#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

namespace tg {

struct FarmOptions {
  std::filesystem::path jobs;    // JOBS.jsonl
  std::filesystem::path folder;  // shared by all workers
  double heartbeat = 10;         // [s]
  double stale = 60;             // [s] without one: the worker is dead
  int retries = 2;               // of a job whose training ended with an error
  int takeovers = 100;           // of a job whose workers died
  int threads = 0;               // of each training; 0: all
  bool prepare = false;          // begin the farm and end
  bool join = false;             // it must be there
  bool no_wait = false;          // end when no job is open, also while others are at work
};

// What a worker says, a line each, without the end of the line.
struct FarmListener {
  std::function<void(const std::string&)> say, warn;
};

// Returns 0 when every job is done, else the exit code of the first one that nobody tries again; 128 + N after `stop`
// was set to signal N: the training is saved first, and its job is open for others; 2 where all that is open has its
// data set on other machines alone. Call it from the main thread.
// Throws Error(usage) for options that contradict each other, what FarmFolder throws, and Error(cannotWrite) where the
// folder is full or lost, with the job open for others if that can still be written.
int workOnFarm(const FarmOptions& options, const FarmListener& listener, const std::atomic<int>& stop);

}  // namespace tg
