// SPDX-License-Identifier: Apache-2.0
// The command line of tgview.
#pragma once
#include <optional>

#include "viewer/view/options.h"

namespace tg {

struct CommandLine {
  ViewOptions view;
  bool list_cameras = false;  // --list-cameras
  bool window = false;        // --window
};

// Returns the exit code where there is nothing left to do: after --help, a list, a flag that is not known. Throws
// Error(usage) for a wrong value and for flags that do not go together.
std::optional<int> readFlags(int argc, char** argv, CommandLine& line);

}  // namespace tg
