// SPDX-License-Identifier: Apache-2.0
// The work folder of `tgtrain photos`, and the list of what is done in it.
#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "core/file/folder_lock.h"
#include "core/system/names.h"

namespace tg {

// In the order in which they are done; each works on what those before it left.
enum class PhotoStage { photographs, features, matches, cameras, training };
constexpr auto namesOf(PhotoStage) { return enumNames("photographs", "features", "matches", "cameras", "training"); }

// photos.json: what each stage was made of, and whether it is done. Written after a stage's files and removed from
// before them, so that nothing half-written counts as done. One process at a time.
class Ledger {
 public:
  static constexpr const char* kFile = "photos.json";

  // Makes and locks the folder, which goes again where no stage is done in it and where this throws, with those around
  // it that were made for it and hold nothing else; one that another holds, or that cannot be opened, stays. A list
  // that cannot be understood counts as none. Throws Error(cannotWrite), also for a folder with other people's files.
  explicit Ledger(std::filesystem::path folder);
  ~Ledger();
  Ledger& operator=(Ledger&&) = delete;

  const std::filesystem::path& folder() const { return folder_; }
  // Whether the stage is done, or at least begun, from what `made_of` says.
  bool isDone(PhotoStage stage, const std::string& made_of) const;
  bool isBegun(PhotoStage stage, const std::string& made_of) const;
  // Forgets this stage and those after it. Throws Error(cannotWrite).
  void begin(PhotoStage stage, const std::string& made_of);
  void finish(PhotoStage stage, const std::string& result = "null");  // JSON
  // Of a stage that is done.
  const std::string& result(PhotoStage stage) const;

 private:
  struct Entry {
    std::string made_of;
    bool done = false;
    std::string result = "null";
  };
  void read();
  void write() const;
  void removeMade() const;

  const std::filesystem::path folder_;
  std::map<PhotoStage, Entry> entries_;
  std::filesystem::path made_;  // the outermost folder that was not there before; empty: all were
  std::optional<FolderLock> lock_;
};

}  // namespace tg
