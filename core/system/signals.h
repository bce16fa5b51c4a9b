// SPDX-License-Identifier: Apache-2.0
// What a program does when it is asked to stop: by Ctrl-C, by kill, because its terminal closes, or by SIGUSR1, which
// mpirun passes on without killing soon after.
#pragma once

#include <array>
#include <csignal>

namespace tg {

// What asks to stop.
inline constexpr std::array kStopSignals{SIGINT, SIGTERM, SIGHUP, SIGUSR1};

// These call `handler` from now on, except those that were ignored when the program started, as nohup asks. `handler`
// may only do what is async-signal-safe. What is written to a pipe that nobody reads any longer (SIGPIPE) ends programs
// whose handler is endAtOnce likewise; others have work to finish and go on without its readers.
void handleStopSignals(void (*handler)(int signal));

// A handler: removes the temporary files of writes that are under way, then ends the program by the signal itself.
void endAtOnce(int signal) noexcept;

}  // namespace tg
