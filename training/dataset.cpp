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

std::uint8_t quantize(float value) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0f, 1.0f) * 255.0f));
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

View loadView(const DatasetIndex::Entry& entry, int downscale, const glm::vec3& background) {
  Image image = readImage(entry.image);
  View view;
  view.camera = entry.camera;
  if (view.camera.width == 0) {
    view.camera.width = image.width;
    view.camera.height = image.height;
    view.camera.cx = image.width / 2.0;
    view.camera.cy = image.height / 2.0;
    view.camera.fx = image.width / 2.0 / std::tan(*entry.field_of_view_x / 2.0);
    view.camera.fy =
        entry.field_of_view_y ? image.height / 2.0 / std::tan(*entry.field_of_view_y / 2.0) : view.camera.fx;
  } else if (view.camera.width != image.width || view.camera.height != image.height) {
    view.camera = resized(view.camera, image.width, image.height);
  }
  checkCamera(entry.image, view.camera);
  if (downscale > 1) {
    if (image.width < downscale || image.height < downscale) {
      throw Error(ErrorKind::usage, entry.image.string(),
                  "too small for the downscale factor (expected at least " + std::to_string(downscale) +
                      " pixels a side, found " + std::to_string(image.width) + " x " + std::to_string(image.height) +
                      ")");
    }
    image = downsample(image, downscale);
    view.camera = downscaled(view.camera, downscale);
  }
  const float over[3] = {background.x, background.y, background.z};
  image = compositeOver(image, over);
  const std::size_t pixels = static_cast<std::size_t>(image.width) * image.height;
  view.rgb.resize(pixels * 3);
  for (std::size_t pixel = 0; pixel < pixels; pixel++) {
    for (int c = 0; c < 3; c++) {
      view.rgb[pixel * 3 + c] = quantize(image.data[pixel * image.channels + (image.channels == 1 ? 0 : c)]);
    }
  }
  return view;
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

Image View::image() const {
  Image result(camera.width, camera.height, 3);
  for (std::size_t i = 0; i < rgb.size(); i++) result.data[i] = static_cast<float>(rgb[i]) / 255.0f;
  return result;
}

std::vector<std::size_t> Dataset::indices(bool test) const {
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < views.size(); i++) {
    if (views[i].camera.test == test) result.push_back(i);
  }
  return result;
}

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

  dataset.views.resize(index.entries.size());
  parallelFor(static_cast<std::int64_t>(index.entries.size()), 1, [&](std::int64_t i) {
    dataset.views[i] = loadView(index.entries[i], options.downscale, dataset.background);
  });
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
