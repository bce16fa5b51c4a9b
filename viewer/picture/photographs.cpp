// SPDX-License-Identifier: Apache-2.0
// Photographs by name.
#include "viewer/picture/photographs.h"

#include <algorithm>
#include <optional>
#include <system_error>
#include <tuple>
#include <utility>

#include "core/bundle/blocks.h"
#include "core/image/picture_name.h"
#include "core/system/error.h"
#include "viewer/picture/dataset_lens.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

std::ptrdiff_t depth(const std::filesystem::path& path) { return std::distance(path.begin(), path.end()); }

bool hasPart(const std::filesystem::path& path, const char* part) {
  return std::find(path.begin(), path.end(), part) != path.end();
}

// masks/, masks_4/ and the like, as the readers of data sets name them.
bool isAmongMasks(const std::filesystem::path& path) {
  const std::filesystem::path place = path.parent_path();
  return std::any_of(place.begin(), place.end(), [](const std::filesystem::path& part) {
    const std::string name = part.string();
    return name == "masks" ||
           (name.starts_with("masks_") && name.find_first_not_of("0123456789", 6) == std::string::npos);
  });
}

// images/, images_4/ and the like.
bool isNamedForPhotographs(const std::filesystem::path& path) {
  return std::any_of(path.begin(), path.end(), [&](const std::filesystem::path& part) {
    return part != path.filename() && part.string().starts_with("images");
  });
}

// A block holds no photographs: they are where it says.
fs::path wholeOf(fs::path folder) {
  const std::optional<BlockFile> block = readBlock(folder);
  return block ? wholeDataset(folder, *block) : folder;
}

}  // namespace

Photographs::Photographs(std::filesystem::path folder) : folder_(wholeOf(std::move(folder))) {
  std::error_code error;
  fs::recursive_directory_iterator at(
      folder_, fs::directory_options::skip_permission_denied | fs::directory_options::follow_directory_symlink, error);
  if (error == std::errc::no_such_file_or_directory) {
    throw Error(ErrorKind::cannotRead, folder_.string(), "no such folder");
  }
  if (error) throw Error(ErrorKind::cannotRead, folder_.string(), "cannot list the folder: " + error.message());
  for (; at != fs::recursive_directory_iterator(); at.increment(error)) {
    if (error) break;
    if (at.depth() >= kMaxPhotographFolders) at.disable_recursion_pending();
    std::error_code ignored;
    if (!at->is_regular_file(ignored) || !isPictureName(at->path())) continue;
    const fs::path below = at->path().lexically_relative(folder_);
    if (isAmongMasks(below)) continue;
    by_stem_[below.stem().string()].push_back(below);
    ++count_;
  }
  if (count_ == 0) {
    throw Error(ErrorKind::cannotRead, folder_.string(),
                "holds no photographs (expected .png, .jpg, .jpeg or .exr files)");
  }
  for (auto& [stem, paths] : by_stem_) {
    std::sort(paths.begin(), paths.end(),
              [](const fs::path& a, const fs::path& b) { return std::pair(depth(a), a) < std::pair(depth(b), b); });
  }
  have_lens_ = hasLens(folder_);
}

std::filesystem::path Photographs::find(const Camera& camera) const {
  const std::filesystem::path name = std::filesystem::path(camera.name).lexically_normal();
  std::filesystem::path bare = name;
  auto found = by_stem_.find(name.filename().string());  // a name without extension may hold a dot
  if (found == by_stem_.end()) found = by_stem_.find(bare.replace_extension().filename().string());
  if (found == by_stem_.end()) return {};
  const auto liesLikeNamed = [&](std::filesystem::path path) {
    return ("/" + path.replace_extension().generic_string()).ends_with("/" + bare.generic_string());
  };
  // A rendering is a .png, most often, whatever the photograph was, and lies in a folder that is called otherwise.
  const auto likeness = [&](const std::filesystem::path& path) {
    return std::tuple(hasPart(path, camera.test ? "test" : "train"), liesLikeNamed(path),
                      path.filename() == name.filename(),
                      path == name || path.lexically_relative(*path.begin()) == name, isNamedForPhotographs(path));
  };
  // Of those that are equally alike the least deep.
  const auto best = std::ranges::max_element(found->second, {}, likeness);
  return folder_ / *best;
}

Image readForComparison(const fs::path& file) {
  Image photograph = readImage(file);
  for (float& value : photograph.data) value = value > 0 ? std::min(value, 1.0f) : 0.0f;  // one that is none is not
  return photograph;
}

}  // namespace tg
