// SPDX-License-Identifier: Apache-2.0
// Whether this process is one of several that mpirun or srun started for one training.
#pragma once
#include <memory>

#include "training/mpi/channel.h"

namespace tg {

// By the environment alone, before anything of MPI is loaded: Open MPI's, MPICH's and Slurm's variables.
struct Launch {
  int rank = 0;
  int size = 1;
  bool together() const { return size > 1; }
};
Launch launchOf();

// The module's channel. Throws Error(usage) where there is none: the program was built without MPI, or the module or
// the library that it wants is not installed.
std::unique_ptr<Channel> openMpiChannel();

}  // namespace tg
