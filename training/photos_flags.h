// SPDX-License-Identifier: Apache-2.0
// The flags of `tgtrain photos`, and its words on the terminal.
#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "training/photos/photos.h"

namespace tg {

struct PhotosFlags {
  std::string work;  // "": beside the output
  std::string solver = "auto";
  std::string matching = "auto";
  std::string mapper = "incremental";
  std::string lens = "SIMPLE_RADIAL";
  int frames = PhotosOptions{}.frames;
  int longest_side = PhotosOptions{}.longest_side;
  double least_registered = PhotosOptions{}.least_registered;
  bool no_open = false;
};
void addPhotosFlags(CLI::App& app, PhotosFlags& flags);

// Of a model that is written to `output`.
PhotosOptions photosOptions(const PhotosFlags& flags, const std::string& input, const std::string& output, int threads);

// preparePhotos with lines on stdout where it `talks`, progress unless `quiet` and warnings on stderr. Ctrl-C, kill and
// a closed terminal end the program by their signal, from which the same command goes on.
void preparePhotosAloud(const PhotosOptions& options, Ledger& ledger, bool talks, bool quiet);

}  // namespace tg
