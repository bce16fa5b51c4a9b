// SPDX-License-Identifier: Apache-2.0
// The photographs that a model was trained from, found by the names of its cameras.
#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/model/camera.h"

namespace tg {

// A folder that holds photographs, or a data set with them further down: images/ of COLMAP and nerfstudio, train/ and
// test/ of the synthetic scenes.
class Photographs {
 public:
  // Looks for .png, .jpg, .jpeg and .exr, at most kMaxPhotographFolders folders deep, but not in masks/, masks_4/ and
  // the like below the folder. A block's folder stands for its whole data set's. Throws Error(cannotRead) when there is
  // no such folder or no photograph in it, and what readBlock throws.
  explicit Photographs(std::filesystem::path folder);

  const std::filesystem::path& folder() const { return folder_; }
  // Whether a camera of the data set has one (dataset_lens.h): they are then no pictures of a pinhole's.
  bool haveLens() const { return have_lens_; }
  std::size_t size() const { return count_; }
  // The file of a camera's name, with or without folder and extension; empty: none. Of several that are called alike
  // (images/ and images_4/, train/ and test/, renderings): the one whose folder says the camera's split, then below the
  // folders of the camera's name, with its extension, in its folder, in a folder called images..., then the one least
  // deep and first by name.
  std::filesystem::path find(const Camera& camera) const;

 private:
  const std::filesystem::path folder_;
  bool have_lens_ = false;
  std::size_t count_ = 0;
  std::map<std::string, std::vector<std::filesystem::path>> by_stem_;  // relative to the folder, best first
};

constexpr int kMaxPhotographFolders = 4;

// As training takes it: an EXR's numbers below 0 and those that are none are 0, those above 1 are 1. Throws what
// readImage throws.
Image readForComparison(const std::filesystem::path& file);

}  // namespace tg
