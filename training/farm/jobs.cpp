// SPDX-License-Identifier: Apache-2.0
// Lines to jobs, with the line's number in every complaint.
#include "training/farm/jobs.h"

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <set>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"
#include "core/system/shortened.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxJobsBytes = std::uint64_t{64} << 20;
constexpr std::size_t kMaxFlags = 1000;
constexpr std::size_t kLongestName = 100;

bool isFolderName(const std::string& name) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
  };
  return !name.empty() && name.size() <= kLongestName && name[0] != '.' && name[0] != '-' &&
         std::ranges::all_of(name, plain);
}

// What only the farm may say: where the run lies, what is written, and what would wait for somebody.
bool isOwnFlag(const std::string& flag) {
  static const std::set<std::string> own = {"--output", "--run",   "--resume",  "--overwrite",   "--json",
                                            "--watch",  "--serve", "--threads", "--serve-token", "--untextured-output"};
  return own.contains(flag.substr(0, flag.find('='))) || (flag.starts_with("-o") && !flag.starts_with("--"));
}

FarmJob jobOf(const nlohmann::json& json, const std::string& path, std::size_t line) {
  const JsonNode node{json, path, "line " + std::to_string(line)};
  if (!json.is_object()) node.fail("expected an object, found " + node.shown());
  for (const auto& [key, value] : json.items()) {
    if (key != "name" && key != "dataset" && key != "output" && key != "flags") {
      node.fail("unknown member \"" + shortened(key, 40, 10) + "\" (expected name, dataset, output and flags)");
    }
  }
  const auto text = [&](const char* key) {
    const std::string value = node.string(key);
    if (value.empty() || value.find('\0') != value.npos) node.fail(std::string(key) + " is no text");
    return value;
  };
  FarmJob job;
  job.name = text("name");
  if (!isFolderName(job.name)) {
    node.fail("name \"" + shortened(job.name, 40, 10) + "\" is no name of a folder (expected up to " +
              std::to_string(kLongestName) + " letters, digits, _, - and ., no - or . first)");
  }
  job.dataset = text("dataset");
  if (job.dataset[0] == '-') node.fail("dataset \"" + shortened(job.dataset, 40, 10) + "\" is a flag");
  if (node.has("output")) job.output = text("output");
  if (!isFolderName(job.output) || job.output == "job.json" || job.output == "metrics.jsonl") {
    node.fail("output \"" + shortened(job.output, 40, 10) +
              "\" is no name of a model's file (expected model.tgz, say)");
  }
  if (!node.has("flags")) return job;
  for (const nlohmann::json& flag : node.list("flags", kMaxFlags)) {
    if (!flag.is_string()) node.fail("flags: expected texts");
    job.flags.push_back(flag.get<std::string>());
    const std::string& word = job.flags.back();
    if (word.find('\0') != word.npos) node.fail("flags: expected texts without zeros");
    if (isOwnFlag(word)) node.fail("flag " + shortened(word, 40, 10) + " is the farm's own (expected without it)");
  }
  return job;
}

}  // namespace

std::vector<FarmJob> parseJobs(std::string_view text, const std::string& path) {
  std::vector<FarmJob> jobs;
  std::set<std::string> names;
  for (std::size_t line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view words = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (words.find_first_not_of(" \t\r") == words.npos) continue;
    const std::string place = path + ": line " + std::to_string(line);
    if (jobs.size() == kMaxFarmJobs) {
      throw Error(ErrorKind::badData, place,
                  "one job too many (expected at most " + std::to_string(kMaxFarmJobs) + ")");
    }
    jobs.push_back(jobOf(parseJson(words, place), path, line));
    if (!names.insert(jobs.back().name).second) {
      throw Error(ErrorKind::badData, place, "name \"" + jobs.back().name + "\" is another job's already");
    }
  }
  if (jobs.empty()) throw Error(ErrorKind::badData, path, "holds no job (expected one a line)");
  return jobs;
}

std::vector<FarmJob> readJobs(const std::filesystem::path& path) {
  const std::vector<std::uint8_t> bytes = readFile(path, kMaxJobsBytes);
  return parseJobs({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path.string());
}

nlohmann::ordered_json jsonOf(const FarmJob& job) {
  return {{"name", job.name}, {"dataset", job.dataset}, {"output", job.output}, {"flags", job.flags}};
}

}  // namespace tg
