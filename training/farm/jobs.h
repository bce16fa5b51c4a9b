// SPDX-License-Identifier: Apache-2.0
// JOBS.jsonl of `tgtrain farm`: one training a line.
#pragma once
#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace tg {

constexpr std::size_t kMaxFarmJobs = 100'000;

struct FarmJob {
  std::string name;     // letters, digits, '_', '-', '.': a folder's name everywhere
  std::string dataset;  // paths are as seen from the folder of JOBS.jsonl
  std::string output = "model.tgz";
  std::vector<std::string> flags;  // of tgtrain

  bool operator==(const FarmJob&) const = default;
};

// Throws Error(cannotRead / badData) naming the line: no JSON, a member that is missing or unknown, a name that is no
// folder's or that another job has, a flag that is the farm's own (where a run lies and what it writes).
std::vector<FarmJob> readJobs(const std::filesystem::path& path);
std::vector<FarmJob> parseJobs(std::string_view text, const std::string& path);

nlohmann::ordered_json jsonOf(const FarmJob& job);

}  // namespace tg
