// SPDX-License-Identifier: Apache-2.0
// Picks the layout, decodes the photographs in parallel and splits them into train and test.
#include "training/dataset.h"

#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>

#include "core/error.h"
#include "core/parallel.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

constexpr int kMaxDownscale = 64;
constexpr double kFarthest = 1e9;  // positions [world units] and principal points [px]: squares stay far inside float
constexpr double kShortestFocal = 1e-3;  // [px]
constexpr double kLongestFocal = 1e9;    // [px]

bool isFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

DatasetLayout detectLayout(const fs::path& folder) {
  // COLMAP first: folders that hold both describe one scene, and COLMAP's has points.
  if (findColmapModel(folder)) return DatasetLayout::colmap;
  if (isFile(folder / "transforms_train.json")) return DatasetLayout::nerfSynthetic;
  if (isFile(folder / "transforms.json")) return DatasetLayout::transforms;
  throw Error(ErrorKind::badData, folder.string(),
              "not a data set (expected transforms_train.json, transforms.json, or a COLMAP model in sparse/0 or "
              "sparse with cameras.bin / cameras.txt; found none of them)");
}

std::string text(double value) {
  std::ostringstream stream;
  stream.imbue(std::locale::classic());
  stream << value;
  return stream.str();
}

Camera downscaled(Camera camera, int factor) {
  // The box filter cuts rows and columns that do not fill a box: the scale is exactly 1 / factor.
  camera.width /= factor;
  camera.height /= factor;
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value /= factor;
  return camera;
}

// What float cannot hold would train for hours to a model that cannot be written.
void checkCamera(const fs::path& image, const Camera& camera) {
  for (const double focal : {camera.fx, camera.fy}) {
    if (!(focal >= kShortestFocal && focal <= kLongestFocal)) {
      throw Error(ErrorKind::badData, image.string(),
                  "focal length out of range (expected 0.001 to 1e9 pixels, found " + text(focal) + ")");
    }
  }
  const glm::dvec3 position = camera.position();
  for (const double value : {camera.cx, camera.cy, position.x, position.y, position.z}) {
    if (!(std::abs(value) <= kFarthest)) {
      throw Error(ErrorKind::badData, image.string(),
                  "camera position or principal point out of range (expected -1e9 to 1e9, found " + text(value) + ")");
    }
  }
}

void checkPoints(const fs::path& folder, const PointCloud& points) {
  for (std::size_t i = 0; i < points.position.size(); i++) {
    for (int axis = 0; axis < 3; axis++) {
      if (!(std::abs(points.position[i][axis]) <= kFarthest)) {
        throw Error(ErrorKind::badData, folder.string(),
                    "point " + std::to_string(i) + " is out of range (expected -1e9 to 1e9, found " +
                        text(points.position[i][axis]) + ")");
      }
    }
  }
}

// The camera of a photograph of width x height pixels, before it is downscaled.
Camera cameraOf(const DatasetIndex::Entry& entry, int width, int height) {
  Camera camera = entry.camera;
  if (camera.width == 0) {
    camera.width = width;
    camera.height = height;
    camera.cx = width / 2.0;
    camera.cy = height / 2.0;
    camera.fx = width / 2.0 / std::tan(*entry.field_of_view_x / 2.0);
    camera.fy = entry.field_of_view_y ? height / 2.0 / std::tan(*entry.field_of_view_y / 2.0) : camera.fx;
  } else if (camera.width != width || camera.height != height) {
    camera = resized(camera, width, height);
  }
  checkCamera(entry.image, camera);
  return camera;
}

// Decodes every photograph once: a broken file shows before hours of training, not after.
void loadPhotographs(const DatasetIndex& index, const DatasetOptions& options, Dataset& dataset) {
  std::vector<PhotographSource> sources;
  for (const DatasetIndex::Entry& entry : index.entries) {
    PhotographSource& source = sources.emplace_back();
    source.image = entry.image;
    source.mask = entry.mask;
    source.downscale = options.downscale;
    if (!dataset.random_background) source.background = dataset.background;
  }
  const std::int64_t count = static_cast<std::int64_t>(sources.size());
  dataset.views.resize(sources.size());
  dataset.photographs = std::make_shared<PhotographStore>(
      sources.size(), options.image_memory, [sources](std::size_t view) { return decodePhotograph(sources[view]); });
  parallelFor(count, 1, [&](std::int64_t item) {
    const auto i = static_cast<std::size_t>(item);
    Photograph photograph = decodePhotograph(sources[i]);
    dataset.views[i].camera = cameraOf(index.entries[i], photograph.file_width, photograph.file_height);
    if (options.downscale > 1) dataset.views[i].camera = downscaled(dataset.views[i].camera, options.downscale);
    dataset.photographs->offer(i, std::move(photograph));
  });
  dataset.photographs->finishOffers();
}

}  // namespace

std::string_view name(DatasetLayout layout) {
  switch (layout) {
    case DatasetLayout::automatic:
      return "auto";
    case DatasetLayout::nerfSynthetic:
      return "nerf-synthetic";
    case DatasetLayout::transforms:
      return "transforms";
    case DatasetLayout::colmap:
      return "colmap";
  }
  return "";
}

std::optional<DatasetLayout> parseDatasetLayout(std::string_view text) {
  for (DatasetLayout layout :
       {DatasetLayout::automatic, DatasetLayout::nerfSynthetic, DatasetLayout::transforms, DatasetLayout::colmap}) {
    if (text == name(layout)) return layout;
  }
  return std::nullopt;
}

std::optional<glm::vec3> parseBackground(std::string_view text) {
  if (text == "white") return glm::vec3(1.0f);
  if (text == "black") return glm::vec3(0.0f);
  glm::vec3 color;
  std::istringstream stream{std::string(text)};
  stream.imbue(std::locale::classic());
  for (int c = 0; c < 3; c++) {
    char comma = ',';
    if (c > 0) stream >> comma;
    if (!(stream >> color[c]) || comma != ',' || !(color[c] >= 0 && color[c] <= 1)) return std::nullopt;
  }
  return stream.peek() == std::istringstream::traits_type::eof() ? std::optional(color) : std::nullopt;
}

std::vector<std::size_t> Dataset::indices(bool test) const {
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < views.size(); i++) {
    if (views[i].camera.test == test) result.push_back(i);
  }
  return result;
}

std::shared_ptr<const ViewPixels> Dataset::pixels(std::size_t view) const { return composited(view, background); }

std::shared_ptr<const ViewPixels> Dataset::composited(std::size_t view, const glm::vec3& color) const {
  return compositeOver(photographs->get(view), color);
}

void Dataset::prefetch(std::size_t view) const { photographs->prefetch(view); }

Dataset loadDataset(const fs::path& folder, const DatasetOptions& options) {
  std::error_code code;
  if (!fs::exists(folder, code)) throw Error(ErrorKind::cannotRead, folder.string(), "no such folder");
  if (!fs::is_directory(folder, code)) {
    throw Error(ErrorKind::cannotRead, folder.string(), "not a folder (expected a data set)");
  }
  if (options.downscale < 1 || options.downscale > kMaxDownscale) {
    throw Error(ErrorKind::usage, "downscale factor out of range (expected 1 to " + std::to_string(kMaxDownscale) +
                                      ", found " + std::to_string(options.downscale) + ")");
  }
  if (options.test_every < 0 || options.test_every == 1) {
    throw Error(ErrorKind::usage,
                "the test split needs 0 (none) or at least 2 (found " + std::to_string(options.test_every) + ")");
  }

  Dataset dataset;
  dataset.name = fs::weakly_canonical(folder).filename().string();
  dataset.layout = options.layout == DatasetLayout::automatic ? detectLayout(folder) : options.layout;
  DatasetIndex index =
      dataset.layout == DatasetLayout::colmap ? readColmap(folder, options.images) : readTransforms(folder);
  dataset.background =
      options.background.value_or(glm::vec3(dataset.layout == DatasetLayout::nerfSynthetic ? 1.0f : 0.0f));
  dataset.random_background = options.random_background;
  dataset.points = options.points ? readPointCloudPly(*options.points) : std::move(index.points);
  checkPoints(options.points.value_or(folder), dataset.points);

  const std::size_t listed = index.entries.size();
  std::erase_if(index.entries, [](const DatasetIndex::Entry& entry) { return !isFile(entry.image); });
  dataset.missing_images = static_cast<int>(listed - index.entries.size());
  if (index.entries.empty()) {
    throw Error(ErrorKind::badData, folder.string(),
                listed == 0 ? "the data set lists no images"
                            : "none of the " + std::to_string(listed) + " listed images exists");
  }

  std::stable_sort(index.entries.begin(), index.entries.end(),
                   [](const auto& a, const auto& b) { return a.camera.name < b.camera.name; });
  if (!index.has_split && options.test_every > 0) {
    for (std::size_t i = 0; i < index.entries.size(); i += static_cast<std::size_t>(options.test_every)) {
      index.entries[i].camera.test = index.entries.size() > 1;  // a single image is for training
    }
  }
  std::stable_partition(index.entries.begin(), index.entries.end(),
                        [](const DatasetIndex::Entry& entry) { return !entry.camera.test; });
  if (index.entries.front().camera.test) {
    throw Error(ErrorKind::badData, folder.string(), "no image of the training split exists");
  }

  loadPhotographs(index, options, dataset);
  return dataset;
}

double cameraExtent(const Dataset& dataset) {
  const std::vector<std::size_t> train = dataset.indices(false);
  glm::dvec3 mean(0.0);
  for (std::size_t i : train) mean += dataset.views[i].camera.position() / static_cast<double>(train.size());
  double radius = 0;
  for (std::size_t i : train) radius = std::max(radius, glm::length(dataset.views[i].camera.position() - mean));
  // One camera, or several at one place, span nothing: fall back to the unit of the world.
  return radius > 0 ? 1.1 * radius : 1.0;
}

}  // namespace tg
