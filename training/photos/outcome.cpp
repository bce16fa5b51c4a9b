// SPDX-License-Identifier: Apache-2.0
// COLMAP's folders and its SQLite database.
#include "training/photos/outcome.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <utility>

#include "core/file/file.h"
#include "core/system/error.h"

namespace tg {
namespace {

namespace fs = std::filesystem;
using Database = std::unique_ptr<sqlite3, int (*)(sqlite3*)>;

constexpr std::int64_t kPairFactor = 2147483647;  // pair_id = factor * smaller image_id + larger
constexpr std::int64_t kFewFeatures = 100;
constexpr int kPlanar = 4, kPlanarOrPanoramic = 6;  // two_view_geometries.config; 5: panoramic

Database open(const fs::path& file, int flags) {
  sqlite3* opened = nullptr;
  const bool works = sqlite3_open_v2(file.c_str(), &opened, flags, nullptr) == SQLITE_OK;
  Database database(opened, sqlite3_close);
  if (!works) database.reset();
  return database;
}

// Calls `row` for each; false: the query failed.
bool query(sqlite3* database, const char* text, const std::function<void(sqlite3_stmt*)>& row) {
  sqlite3_stmt* prepared = nullptr;
  if (sqlite3_prepare_v2(database, text, -1, &prepared, nullptr) != SQLITE_OK) return false;
  const std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> statement(prepared, sqlite3_finalize);
  int step = SQLITE_ROW;
  while ((step = sqlite3_step(prepared)) == SQLITE_ROW) row(prepared);
  return step == SQLITE_DONE;
}

struct Seen {
  std::string name;
  std::int64_t features = 0;
  std::int64_t pairs = 0;
  std::int64_t deep = 0;  // of them, those seen from two places
  std::int64_t best = 0;  // matches of its best pair
  std::int64_t best_with = 0;
};

}  // namespace

std::vector<FoundModel> findModels(const fs::path& models) {
  std::vector<FoundModel> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(models, error)) {
    if (isFile(entry.path() / "images.bin")) found.push_back({entry.path(), summarizeColmap(entry.path())});
  }
  std::ranges::sort(found, [](const FoundModel& a, const FoundModel& b) {
    return std::pair(b.summary.images.size(), a.folder) < std::pair(a.summary.images.size(), b.folder);
  });
  return found;
}

std::vector<std::string> whyLeftOut(const fs::path& file, const std::vector<std::string>& names,
                                    const std::map<std::string, std::string>& called, bool has_model) {
  std::vector<std::string> reasons(names.size());
  const Database database = open(file, SQLITE_OPEN_READWRITE);  // who only reads leaves a -wal
  std::map<std::int64_t, Seen> images;
  const bool works =
      database &&
      query(database.get(),
            "SELECT images.image_id, images.name, COALESCE(keypoints.rows, 0) FROM images LEFT JOIN keypoints ON "
            "keypoints.image_id = images.image_id",
            [&](sqlite3_stmt* row) {
              const auto* const text = reinterpret_cast<const char*>(sqlite3_column_text(row, 1));
              Seen seen;
              seen.name = text ? text : "";
              seen.features = sqlite3_column_int64(row, 2);
              images[sqlite3_column_int64(row, 0)] = std::move(seen);
            }) &&
      query(database.get(), "SELECT pair_id, rows, config FROM two_view_geometries WHERE rows > 0",
            [&](sqlite3_stmt* row) {
              const std::int64_t pair = sqlite3_column_int64(row, 0), matches = sqlite3_column_int64(row, 1);
              const int config = sqlite3_column_int(row, 2);
              const std::int64_t second = pair % kPairFactor, first = (pair - second) / kPairFactor;
              for (const auto& [one, other] : {std::pair(first, second), std::pair(second, first)}) {
                const auto seen = images.find(one);
                if (seen == images.end() || !images.contains(other)) continue;
                ++seen->second.pairs;
                seen->second.deep += config < kPlanar || config > kPlanarOrPanoramic;
                if (matches > seen->second.best) seen->second.best = matches, seen->second.best_with = other;
              }
            });
  if (!works) return reasons;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto found = std::ranges::find_if(images, [&](const auto& image) { return image.second.name == names[i]; });
    if (found == images.end()) {
      reasons[i] = "COLMAP could not read it";
      continue;
    }
    const Seen& seen = found->second;
    if (seen.features < kFewFeatures) {
      reasons[i] = "too little to hold on to: " + std::to_string(seen.features) + " features, blurred or bare";
    } else if (seen.pairs == 0) {
      reasons[i] = "nothing in common with another photograph that it was matched with";
    } else if (!has_model && seen.deep == 0) {
      reasons[i] = "no match of " + std::to_string(seen.pairs) +
                   " shows depth, as from one place or of something flat: step aside between photographs";
    } else {
      const std::string& other = images.at(seen.best_with).name;
      const auto other_called = called.find(other);
      reasons[i] = std::to_string(seen.best) + " points in common with " +
                   (other_called == called.end() ? other : other_called->second) + ", its best match of " +
                   std::to_string(seen.pairs) + ", " + (has_model ? "do not tie it to the model" : "begin no model");
    }
  }
  return reasons;
}

void forgetMatches(const fs::path& file) {
  const Database database = open(file, SQLITE_OPEN_READWRITE);
  const int result = database ? sqlite3_exec(database.get(), "DELETE FROM matches; DELETE FROM two_view_geometries;",
                                             nullptr, nullptr, nullptr)
                              : SQLITE_CANTOPEN;
  if (result == SQLITE_BUSY) throw Error(ErrorKind::cannotWrite, file.string(), "another program holds it");
  // SQLITE_ERROR: it has no such table.
  if (result == SQLITE_NOTADB || result == SQLITE_CORRUPT || result == SQLITE_ERROR) {
    throw Error(ErrorKind::badData, file.string(), "no database of COLMAP (remove it to start anew)");
  }
  if (result != SQLITE_OK) throw Error(ErrorKind::cannotWrite, file.string(), sqlite3_errstr(result));
}

}  // namespace tg
