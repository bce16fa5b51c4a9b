// SPDX-License-Identifier: Apache-2.0
// The photographs that a model was trained from, found by the names of its cameras.
#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/model/camera.h"

namespace tg {

// A folder that holds photographs, or a data set with them further down: images/ of COLMAP and nerfstudio, train/ and
// test/ of the synthetic scenes.
class Photographs {
 public:
  // Looks for .png, .jpg and .jpeg, at most kMaxPhotographFolders folders deep, but not in masks/, masks_4/ and the
  // like below the folder. Throws Error(cannotRead) when there is no such folder or no photograph in it.
  explicit Photographs(std::filesystem::path folder);

  const std::filesystem::path& folder() const { return folder_; }
  std::size_t size() const { return count_; }
  // The file of a camera's name, with or without folder and extension; empty: none. Of several that are called alike
  // (images/ and images_4/, train/ and test/, renderings): the one whose folder says the camera's split, then below the
  // folders of the camera's name, with its extension, in its folder, in a folder called images..., then the one least
  // deep and first by name.
  std::filesystem::path find(const Camera& camera) const;

 private:
  const std::filesystem::path folder_;
  std::size_t count_ = 0;
  std::map<std::string, std::vector<std::filesystem::path>> by_stem_;  // relative to the folder, best first
};

constexpr int kMaxPhotographFolders = 4;

}  // namespace tg
