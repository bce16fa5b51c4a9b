// SPDX-License-Identifier: Apache-2.0
// Variables of the environment, and the module beside the program.
#include "training/mpi/launch.h"

#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>

#include "core/system/error.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

std::optional<int> numberIn(const char* variable) {
  const char* text = std::getenv(variable);
  return text ? parseWhole<int>(text) : std::nullopt;
}

std::string moduleError() {
  const char* text = ::dlerror();
  return text ? text : "cannot load it";
}

}  // namespace

Launch launchOf() {
  struct Variables {
    const char *rank, *size;
  };
  for (const Variables& names : {Variables{"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},
                                 Variables{"PMI_RANK", "PMI_SIZE"}, Variables{"PMIX_RANK", "SLURM_STEP_NUM_TASKS"}}) {
    const std::optional<int> rank = numberIn(names.rank), size = numberIn(names.size);
    if (rank && size && *rank >= 0 && *rank < *size) return {*rank, *size};
  }
  return {};
}

std::unique_ptr<Channel> openMpiChannel() {
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  const fs::path module = program.parent_path().parent_path() / "lib" / "textured-gaussians" / "tg_mpi.so";
  const std::string what = "several processes: expected " + module.string() + ", which a build with MPI has (TG_MPI)";
  if (!fs::exists(module, ignored)) throw Error(ErrorKind::usage, what);
  // What the library loads in its turn looks for its names among those of all.
  void* const library = ::dlopen(module.c_str(), RTLD_NOW | RTLD_GLOBAL);
  if (library == nullptr) throw Error(ErrorKind::usage, what + ": " + moduleError());
  const auto version = reinterpret_cast<ChannelVersion*>(::dlsym(library, kChannelVersionName));
  const auto open = reinterpret_cast<OpenChannel*>(::dlsym(library, kOpenChannelName));
  if (version == nullptr || open == nullptr) throw Error(ErrorKind::usage, what + ": " + moduleError());
  if (std::string(version()) != TG_VERSION) {
    throw Error(ErrorKind::usage,
                module.string() + ": is of another version" + expectedFound(TG_VERSION, std::string(version())));
  }
  return std::unique_ptr<Channel>(open());
}

}  // namespace tg
