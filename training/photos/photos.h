// SPDX-License-Identifier: Apache-2.0
// From photographs or a film to a data set that training reads: the stages, each done once.
#pragma once
#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "training/photos/ledger.h"
#include "training/photos/pairs.h"
#include "training/photos/solver.h"

namespace tg {

struct PhotosOptions {
  std::filesystem::path input;  // a folder, or a film
  std::filesystem::path work;   // becomes the data set
  int frames = 120;             // of a film
  int longest_side = 1600;      // [px] of a photograph that is kept; 0: any
  SolverKind solver = SolverKind::automatic;
  Matching matching = Matching::automatic;
  Mapper mapper = Mapper::incremental;
  LensModel lens = LensModel::simpleRadial;
  double least_registered = 30;  // [%] of the photographs
  int threads = 0;               // 0: all
};

struct PhotosListener {
  std::function<void(const std::string& line)> say;   // what was done
  std::function<void(const std::string& line)> warn;  // what a user should know
  std::function<void(const std::string& what, std::size_t done, std::size_t count)> progress;
};

// Throws Error(cannotRead / badData / usage) for an input that can be seen to be none.
void checkInput(const PhotosOptions& options);

// The first stage that preparePhotos() would do; none: all before training are done. Throws what checkInput() throws.
std::optional<PhotoStage> undoneStage(const PhotosOptions& options, Ledger& ledger);

// Does what is not done yet, stage by stage, in `ledger`'s folder: images/ and sparse/0 then are a data set. Throws
// Stopped once `stop` is set, Error(usage / cannotRead / badData / cannotWrite / device).
void preparePhotos(const PhotosOptions& options, Ledger& ledger, const PhotosListener& listener,
                   const std::atomic<int>& stop);

}  // namespace tg
