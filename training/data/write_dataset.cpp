// SPDX-License-Identifier: Apache-2.0
// Photographs as PNG files, cameras as JSON, points as PLY.
#include "training/data/write_dataset.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "core/file/file.h"
#include "core/file/folder_lock.h"
#include "core/file/json.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

void createFolder(const fs::path& path) {
  std::error_code code;
  fs::create_directories(path, code);
  if (code) throw Error(ErrorKind::cannotWrite, path.string(), "cannot create the folder: " + code.message());
}

// Without the extension. Names come from files: what would lead elsewhere counts by its last part.
fs::path stemOf(const Camera& view) {
  fs::path path = fs::path(view.name).lexically_normal();
  if (path.is_absolute() || path.empty() || *path.begin() == "..") path = path.filename();
  return path.parent_path() / path.stem();
}

// Below images/ and masks/.
std::vector<std::string> fileNames(const Dataset& dataset) {
  std::set<fs::path> split[2];
  for (const Camera& view : dataset.views) split[view.test ? 1 : 0].insert(stemOf(view));
  const bool same = std::ranges::any_of(split[1], [&](const fs::path& stem) { return split[0].contains(stem); });
  std::vector<std::string> names;
  std::set<std::string> taken;
  for (const Camera& view : dataset.views) {
    const fs::path folder = same ? (view.test ? "test" : "train") : "";
    const std::string stem = (folder / stemOf(view)).string();
    std::string name = stem + ".png";
    for (int i = 2; !taken.insert(name).second; ++i) name = stem + "_" + std::to_string(i) + ".png";
    names.push_back(name);
  }
  return names;
}

// Whether there was a mask.
bool writePhotograph(const fs::path& folder, const std::string& name, const Photograph& photograph) {
  const ViewPixels& pixels = photograph.pixels;
  Image image = pixels.image();
  if (!photograph.alpha.empty()) {
    Image transparent(pixels.width, pixels.height, 4);
    for (std::size_t i = 0; i < photograph.alpha.size(); ++i) {
      std::copy_n(image.data.data() + 3 * i, 3, transparent.data.data() + 4 * i);
      transparent.data[4 * i + 3] = static_cast<float>(photograph.alpha[i]) / 255.0f;
    }
    image = std::move(transparent);
  }
  createFolder((folder / "images" / name).parent_path());
  writeImage(folder / "images" / name, image);
  if (pixels.mask.empty()) {
    // One of an earlier photograph would be found by its name.
    std::error_code ignored;
    for (const char* end : {"", ".png", ".mask.png"}) fs::remove(folder / "masks" / (name + end), ignored);
    fs::remove(folder / "masks" / (fs::path(name).replace_extension().string() + "_mask.png"), ignored);
    return false;
  }
  Image mask(pixels.width, pixels.height, 1);
  std::ranges::transform(pixels.mask, mask.data.begin(), [](std::uint8_t value) { return value ? 1.0f : 0.0f; });
  createFolder((folder / "masks" / name).parent_path());
  writeImage(folder / "masks" / name, mask);
  return true;
}

// What is read may not lie where it is written, whatever its name.
void refuseSources(const fs::path& folder, const Dataset& dataset) {
  const auto placeOf = [](const fs::path& path) {
    std::error_code ignored;
    return fs::weakly_canonical(fs::absolute(path), ignored);
  };
  for (const fs::path& place : {placeOf(folder / "images"), placeOf(folder / "masks")}) {
    for (const fs::path& source : dataset.sources) {
      const fs::path below = placeOf(source).lexically_relative(place);
      if (below.empty() || *below.begin() == "..") continue;
      throw Error(ErrorKind::usage, folder.string(),
                  "holds what the data set reads: " + source.string() + " (expected another folder)");
    }
  }
}

}  // namespace

nlohmann::json transformsFrame(const Camera& camera, const std::string& file_path) {
  const glm::dmat3 world_from_camera = glm::transpose(camera.rotation);
  const glm::dvec3 position = camera.position();
  nlohmann::json matrix = nlohmann::json::array();
  for (int row = 0; row < 3; ++row) {
    matrix.push_back(
        {world_from_camera[0][row], -world_from_camera[1][row], -world_from_camera[2][row], position[row]});
  }
  matrix.push_back({0.0, 0.0, 0.0, 1.0});
  return {{"file_path", file_path}, {"transform_matrix", matrix}};
}

void writePoints(const fs::path& path, const PointCloud& points) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points.position.size()) +
      "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
      "property uchar blue\nend_header\n";
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    text.append(reinterpret_cast<const char*>(&points.position[i]), sizeof(glm::vec3));
    for (int c = 0; c < 3; ++c) {
      text.push_back(static_cast<char>(std::lround(std::clamp(points.color[i][c], 0.0f, 1.0f) * 255.0f)));
    }
  }
  writeTextAtomically(path, text);
}

namespace {

fs::file_type typeOf(const fs::path& path) {
  std::error_code error;
  return fs::symlink_status(path, error).type();
}

}  // namespace

void writeAllOrNone(const fs::path& folder, std::vector<std::string> files, const std::function<void()>& write) {
  const bool is_new = typeOf(folder) == fs::file_type::not_found;
  createFolder(folder);
  const FolderLock alone(folder);
  std::erase_if(files, [&](const std::string& file) { return typeOf(folder / file) != fs::file_type::not_found; });
  try {
    write();
  } catch (...) {
    std::error_code ignored;
    for (const std::string& file : files) {
      fs::remove(folder / file, ignored);
      for (fs::path at = fs::path(file).parent_path(); !at.empty(); at = at.parent_path()) {
        if (typeOf(folder / at) == fs::file_type::directory)
          fs::remove(folder / at, ignored);  // where nothing is in it
      }
    }
    if (is_new) fs::remove(folder, ignored);
    throw;
  }
}

namespace {

// With photographs of these names.
void writeDatasetFiles(const fs::path& folder, const Dataset& dataset, const std::vector<std::string>& names) {
  nlohmann::json frames = nlohmann::json::array(), train = nlohmann::json::array(), test = nlohmann::json::array();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Camera& camera = dataset.views[i];
    const std::string file = "images/" + names[i];
    nlohmann::json frame = transformsFrame(camera, file);
    frame.update({{"w", camera.size.x},
                  {"h", camera.size.y},
                  {"fl_x", camera.focal.x},
                  {"fl_y", camera.focal.y},
                  {"cx", camera.center.x},
                  {"cy", camera.center.y}});
    frames.push_back(std::move(frame));
    (camera.test ? test : train).push_back(file);
  }
  createFolder(folder);
  // It comes last, and makes the folder a data set: one that is stopped in between is none, half old and half new.
  std::error_code ignored;
  fs::remove(folder / "transforms.json", ignored);
  std::vector<std::uint8_t> masked(names.size(), 0);
  parallelFor(static_cast<std::int64_t>(names.size()), 1,
              [&](std::size_t i) { masked[i] = writePhotograph(folder, names[i], *dataset.photographs->get(i)); });
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (masked[i]) frames[i]["mask_path"] = "masks/" + names[i];
  }
  nlohmann::json json = {
      {"camera_model", "PINHOLE"}, {"frames", frames}, {"train_filenames", train}, {"test_filenames", test}};
  if (dataset.background != glm::vec3(0.0f)) {
    json[kBackgroundKey] = {dataset.background.r, dataset.background.g, dataset.background.b};
  }
  if (!dataset.points.position.empty()) {
    json["ply_file_path"] = "points3d.ply";
    writePoints(folder / "points3d.ply", dataset.points);
  } else {
    fs::remove(folder / "points3d.ply", ignored);
  }
  writeTextAtomically(folder / "transforms.json", json.dump(1) + "\n");
}

}  // namespace

void writeDataset(const fs::path& folder, const Dataset& dataset, bool overwrite) {
  refuseSources(folder, dataset);
  for (const char* file : {"transforms_train.json", "sparse"}) {  // which would be read in place of what is written
    std::error_code ignored;
    if (!overwrite || !fs::exists(folder / file, ignored)) continue;
    throw Error(ErrorKind::cannotWrite, folder.string(),
                std::string("holds ") + file + ", which this would not replace (expected another folder)");
  }
  constexpr const char* kOwn[] = {"transforms.json", "images", "masks", "points3d.ply"};
  if (!overwrite) {
    for (const char* file : {"transforms_train.json", "sparse", kOwn[0], kOwn[1], kOwn[2], kOwn[3]}) {
      std::error_code ignored;  // what nobody may look into cannot be written either, which says so below
      if (!fs::exists(folder / file, ignored)) continue;
      throw Error(ErrorKind::cannotWrite, folder.string(),
                  std::string("holds ") + file + " already (add --overwrite to replace it)");
    }
  }
  const std::vector<std::string> names = fileNames(dataset);
  for (const std::string& name : names) requireUtf8(name, "transforms.json");
  if (overwrite) {
    writeDatasetFiles(folder, dataset, names);
  } else {
    std::vector<std::string> files = {"transforms.json", "points3d.ply"};
    for (const std::string& name : names) files.insert(files.end(), {"images/" + name, "masks/" + name});
    writeAllOrNone(folder, std::move(files), [&] { writeDatasetFiles(folder, dataset, names); });
  }
}

}  // namespace tg
