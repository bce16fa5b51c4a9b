// SPDX-License-Identifier: Apache-2.0
// What COLMAP made of the photographs, and why not of all.
#pragma once
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "training/data/colmap.h"

namespace tg {

struct FoundModel {
  std::filesystem::path folder;
  ColmapSummary summary;
};
// Those in the folders of `models`, by the number of their photographs, the largest first. One that cannot be read
// throws Error(badData / cannotRead).
std::vector<FoundModel> findModels(const std::filesystem::path& models);

// For each name, what the database knows of why it is in no model: too few features, no pair, a pair too weak, and
// where no photograph is in one, pairs without depth: with guessed focal lengths pairs in a model have none, either.
// Nothing for a database that cannot be read. `called`: what messages call the photograph of a name. `has_model`:
// others are in one. SQLite's own files beside the database are gone afterwards.
std::vector<std::string> whyLeftOut(const std::filesystem::path& database, const std::vector<std::string>& names,
                                    const std::map<std::string, std::string>& called, bool has_model);

// Removes what matching wrote, so that it is done anew. Throws Error(badData) where the file is no database
// of COLMAP, Error(cannotWrite) where it is not to be written, as while another program holds it.
void forgetMatches(const std::filesystem::path& database);

}  // namespace tg
