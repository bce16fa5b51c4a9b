// SPDX-License-Identifier: Apache-2.0
// photos.json in and out.
#include "training/photos/ledger.h"

#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxLedgerBytes = std::uint64_t{64} << 20;
constexpr const char* kFormat = "tgtrain-photos";
constexpr int kVersion = 1;

// Names of files may hold bytes that are no UTF-8, which JSON would not bring back.
std::string ascii(const std::string& text) {
  std::string plain;
  for (const char c : text) {
    const bool shown = (c >= 0x20 && c < 0x7f && c != '%') || c == '\n';
    plain += shown ? std::string(1, c) : formatted("%%%02x", static_cast<unsigned>(static_cast<unsigned char>(c)));
  }
  return plain;
}

bool holdsListAlone(const fs::path& folder) {
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    if (entry->path().filename() != Ledger::kFile) return false;
  }
  return !error;
}

}  // namespace

Ledger::Ledger(fs::path folder) : folder_(std::move(folder)) {
  std::error_code error;
  for (fs::path at = folder_; !at.empty() && !fs::exists(at, error); at = at.parent_path()) made_ = at;
  fs::create_directories(folder_, error);
  if (error) {
    removeMade();
    throw Error(ErrorKind::cannotWrite, folder_.string(), "cannot make this folder: " + error.message());
  }
  lock_.emplace(folder_);  // where it throws the folder may be another's
  try {
    read();
  } catch (...) {
    removeMade();
    throw;
  }
}

void Ledger::read() {
  const fs::path file = folder_ / kFile;
  if (!isFile(file)) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
      if (entry.path().filename().string().starts_with(".tg-")) continue;
      throw Error(ErrorKind::cannotWrite, folder_.string(),
                  "holds other files (expected a folder of tgtrain photos, or none; --work names another)");
    }
    write();
    return;
  }
  try {
    const nlohmann::json json = parseJson(readRegularFile(file, kMaxLedgerBytes), file.string());
    if (json.at("format") != kFormat || json.at("version") != kVersion) return;
    std::map<PhotoStage, Entry> entries;
    for (const PhotoStage stage : valuesOf<PhotoStage>()) {
      const auto found = json.at("stages").find(std::string(name(stage)));
      if (found == json.at("stages").end()) break;
      entries[stage] = {found->at("made_of").get<std::string>(), found->at("done").get<bool>(),
                        found->at("result").dump()};
      if (!entries[stage].done) break;
    }
    entries_ = std::move(entries);
  } catch (const Error& broken) {
    if (broken.kind == ErrorKind::cannotRead) throw;
  } catch (const nlohmann::json::exception&) {  // of another version: everything is done anew
  }
}

Ledger::~Ledger() {
  const bool done = std::ranges::any_of(entries_, [](const auto& entry) { return entry.second.done; });
  if (!made_.empty() && !done) {
    std::error_code ignored;
    for (const char* made : {"logs", "images.part", "masks.part"}) fs::remove_all(folder_ / made, ignored);
    // The list last: without it whatever is left would count as other people's files.
    if (holdsListAlone(folder_)) fs::remove(folder_ / kFile, ignored);
    removeMade();
  }
}

void Ledger::removeMade() const {
  if (made_.empty()) return;
  for (fs::path at = folder_;; at = at.parent_path()) {
    ::rmdir(at.c_str());  // not one that holds something, and not by the name "."
    if (at == made_) return;
  }
}

bool Ledger::isBegun(PhotoStage stage, const std::string& made_of) const {
  const auto found = entries_.find(stage);
  return found != entries_.end() && found->second.made_of == ascii(made_of);
}

bool Ledger::isDone(PhotoStage stage, const std::string& made_of) const {
  return isBegun(stage, made_of) && entries_.at(stage).done;
}

void Ledger::begin(PhotoStage stage, const std::string& made_of) {
  entries_.erase(entries_.lower_bound(stage), entries_.end());
  entries_[stage].made_of = ascii(made_of);
  write();
}

void Ledger::finish(PhotoStage stage, const std::string& result) {
  TG_ASSERT(entries_.contains(stage), "a stage begins before it is done");
  entries_[stage].done = true;
  entries_[stage].result = result;
  write();
}

const std::string& Ledger::result(PhotoStage stage) const {
  TG_ASSERT(entries_.contains(stage) && entries_.at(stage).done, "the stage is done");
  return entries_.at(stage).result;
}

void Ledger::write() const {
  nlohmann::ordered_json json = {
      {"format", kFormat}, {"version", kVersion}, {"stages", nlohmann::ordered_json::object()}};
  for (const auto& [stage, entry] : entries_) {
    json["stages"][std::string(name(stage))] = {
        {"made_of", entry.made_of}, {"done", entry.done}, {"result", nlohmann::ordered_json::parse(entry.result)}};
  }
  writeTextAtomically(folder_ / kFile, dumpJson(json, 1) + "\n");
}

}  // namespace tg
