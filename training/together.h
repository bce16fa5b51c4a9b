// SPDX-License-Identifier: Apache-2.0
// tgtrain where mpirun has started it several times: who joins, what is refused, how threads and memory are shared.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "training/data/dataset.h"
#include "training/mpi/processes.h"

namespace tg {

// Null: alone, or of a command that is. Throws as openMpiChannel() and Processes do.
std::unique_ptr<Processes> joinProcesses(int argc, char** argv, const std::vector<std::string>& commands);

// parse() at the first process alone where there are several, then at the others if there is something to do; all
// return what it returned there.
std::optional<int> parseTogether(Processes* processes, const std::function<std::optional<int>()>& parse);

// This process's share of the machine: threads, where none are asked for, and of `options` photographs and memory.
// `memory`: whether the limit is the machine's share rather than a flag's.
void takeShare(Processes& processes, int threads, bool memory, DatasetOptions& options);

// Begins at all processes together: load() here, and where it throws anywhere, or finds other photographs, all end as
// Processes::agree() ends them.
void beginTogether(Processes& processes, const std::function<void()>& load, const Dataset& dataset);

// All that a process does which is not the first. Returns the first one's exit code.
int followFirst(Processes& processes, const std::string& folder, const std::function<DatasetOptions()>& options);
// The first one's counterpart, once training is over.
void endTogether(Processes& processes, int code);

}  // namespace tg
