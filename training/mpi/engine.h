// SPDX-License-Identifier: Apache-2.0
// A training over several processes as the trainer sees it: the first rank runs the trainer, and its engine tells the
// others what to do.
#pragma once
#include <memory>

#include "training/data/dataset.h"
#include "training/mpi/channel.h"
#include "training/step/engine.h"
#include "training/step/gradient.h"

namespace tg {

// The first rank's: its engine steps over all ranks; forward and backward are of this process alone. Channel and data
// set outlive it.
std::unique_ptr<DifferentiableRenderer> makeShardedRenderer(Channel& channel, const Dataset& dataset);

// The others' part, until endRanks() is called at the first; returns the code that it is given.
int serveRank(Channel& channel, const Dataset& dataset);
void endRanks(Channel& channel, int code);

}  // namespace tg
