// SPDX-License-Identifier: Apache-2.0
// The first stage: upright photographs of a bounded size with plain names, from a folder or a film.
#pragma once
#include <atomic>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "training/photos/photos.h"

namespace tg {

struct Prepared {
  std::string name;    // below images/
  std::string source;  // below the folder; of a film "frame 12"
  int width = 0;
  int height = 0;
  std::string camera;          // make and model; "" not known
  double focal = 0;            // [px]; 0: not known
  std::optional<Place> place;  // where it was taken
};

// What the stage depends on. Throws Error(cannotRead / badData / usage) for an input that is none.
std::string madeOf(const PhotosOptions& options);

// Fills an empty folder, and one with the masks that photographs have. Tells of what was left out.
std::vector<Prepared> prepareImages(const PhotosOptions& options, const std::filesystem::path& folder,
                                    const std::filesystem::path& masks, const std::filesystem::path& log,
                                    const PhotosListener& listener, const std::atomic<int>& stop);

std::string toJson(const std::vector<Prepared>& photographs);
std::vector<Prepared> preparedFromJson(const std::string& json);

// A folder's contents under its own name, once all of it is there: what had that name before goes.
void giveName(const std::filesystem::path& folder, const std::filesystem::path& name);
// An empty folder of this name. Throws Error(cannotWrite).
void makeEmpty(const std::filesystem::path& folder);

}  // namespace tg
