// SPDX-License-Identifier: Apache-2.0
// transforms_train.json / transforms_test.json (NeRF-synthetic) and transforms.json (instant-ngp, nerfstudio).
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"
#include "training/data/dataset.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

using JsonNode = nlohmann::json;

constexpr std::uint64_t kMaxJsonBytes = std::uint64_t{256} << 20;
constexpr double kMaxImageSide = 1 << 20;
constexpr std::array<const char*, 10> kDistortion = {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "s1", "s2"};
constexpr std::array<const char*, 8> kExtensions = {"", ".png", ".jpg", ".jpeg", ".exr", ".PNG", ".JPG", ".JPEG"};

// A JSON file together with its name, for messages.
struct Source {
  JsonNode json;
  std::string path;
  [[noreturn]] void fail(const std::string& what) const { throw Error(ErrorKind::badData, path, what); }
};

Source parse(const fs::path& path) {
  const std::vector<std::uint8_t> bytes = readFile(path, kMaxJsonBytes);
  Source source{parseJson(std::string(bytes.begin(), bytes.end()), path.string()), path.string()};
  if (!source.json.is_object()) source.fail("expected a JSON object at the top");
  return source;
}

// frame[key], else top[key]: nerfstudio lets every frame override the shared intrinsics.
std::optional<double> number(const Source& source, const JsonNode& frame, const char* key) {
  for (const JsonNode* object : {&frame, &source.json}) {
    const auto found = object->find(key);
    if (found == object->end() || found->is_null()) continue;
    if (!found->is_number() || !std::isfinite(found->get<double>())) {
      source.fail(std::string("'") + key + "' is not a finite number");
    }
    return found->get<double>();
  }
  return std::nullopt;
}

std::string cameraModel(const Source& source, const JsonNode& frame) {
  for (const JsonNode* object : {&frame, &source.json}) {
    const auto model = object->find("camera_model");
    if (model != object->end()) return model->is_string() ? model->get<std::string>() : "?";
  }
  for (const JsonNode* object : {&frame, &source.json}) {
    const auto fisheye = object->find("is_fisheye");  // instant-ngp's
    if (fisheye != object->end() && fisheye->is_boolean()) return fisheye->get<bool>() ? "OPENCV_FISHEYE" : "OPENCV";
  }
  return "OPENCV";
}

// nerfstudio's keys: k1 to k4 of a fisheye; otherwise OpenCV's k1, k2, k3, p1, p2, whatever the model is called.
Lens readLens(const Source& source, const JsonNode& frame) {
  Lens lens;
  lens.model = cameraModel(source, frame);
  lens.fisheye = lens.model == "OPENCV_FISHEYE";
  constexpr std::array<const char*, 6> kModels = {"PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL",
                                                  "RADIAL",  "OPENCV",         "OPENCV_FISHEYE"};
  if (std::ranges::find(kModels, lens.model) == kModels.end()) {
    source.fail("camera model '" + lens.model +
                "' is not supported (expected PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV or "
                "OPENCV_FISHEYE): undistort the images first");
  }
  for (const char* key : kDistortion) {
    const double value = number(source, frame, key).value_or(0.0);
    if (value == 0) continue;
    const std::string_view name = key;
    const bool tangential = name[0] == 'p';
    const auto index = static_cast<std::size_t>(name[1] - '1');
    if (name[0] == 's' || index > 3 || (lens.fisheye ? tangential : index > 2)) {
      source.fail("lens distortion '" + std::string(name) + "' is not supported with camera model " + lens.model +
                  " (expected 0, found " + JsonNode(value).dump() + "): undistort the images first");
    }
    (tangential ? lens.tangential[index] : lens.radial[index]) = value;
  }
  return lens;
}

// World-to-camera in OpenCV axes from camera-to-world in OpenGL axes (x right, y up, looks down -z).
void setPose(const Source& source, const JsonNode& frame, const std::string& label, Camera& camera) {
  const auto found = frame.find("transform_matrix");
  if (found == frame.end() || !found->is_array() || (found->size() != 4 && found->size() != 3)) {
    source.fail(label + ": expected a 4 x 4 'transform_matrix'");
  }
  glm::dmat3 world_from_camera;
  glm::dvec3 position;
  for (int row = 0; row < 3; row++) {
    const JsonNode& values = (*found)[row];
    if (!values.is_array() || values.size() != 4) source.fail(label + ": expected a 4 x 4 'transform_matrix'");
    for (int column = 0; column < 4; column++) {
      if (!values[column].is_number()) source.fail(label + ": 'transform_matrix' holds something that is not a number");
      const double value = values[column].get<double>();
      if (!std::isfinite(value)) source.fail(label + ": 'transform_matrix' is not finite");
      if (column == 3) {
        position[row] = value;
      } else {
        world_from_camera[column][row] = column == 0 ? value : -value;
      }
    }
  }
  const glm::dmat3 gram = glm::transpose(world_from_camera) * world_from_camera;
  double deviation = 0;
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) deviation = std::max(deviation, std::abs(gram[i][j] - (i == j ? 1.0 : 0.0)));
  }
  if (!(deviation < 1e-2) || glm::determinant(world_from_camera) <= 0) {
    source.fail(label + ": 'transform_matrix' is not a rotation and a translation (scaled, sheared or mirrored)");
  }
  // Files carry float32 noise: Gram-Schmidt makes the rotation exact again.
  glm::dvec3 x = glm::normalize(world_from_camera[0]);
  glm::dvec3 y = glm::normalize(world_from_camera[1] - x * glm::dot(x, world_from_camera[1]));
  world_from_camera = glm::dmat3(x, y, glm::cross(x, y));
  camera.rotation = glm::transpose(world_from_camera);
  camera.translation = -camera.rotation * position;
}

void setIntrinsics(const Source& source, const JsonNode& frame, const std::string& label, DatasetIndex::Entry& entry) {
  const std::optional<double> width = number(source, frame, "w");
  const std::optional<double> height = number(source, frame, "h");
  const std::optional<double> fl_x = number(source, frame, "fl_x");
  entry.field_of_view_x = number(source, frame, "camera_angle_x");
  entry.field_of_view_y = number(source, frame, "camera_angle_y");
  for (const std::optional<double>& angle : {entry.field_of_view_x, entry.field_of_view_y}) {
    if (angle && !(*angle > 0 && *angle < 3.14)) source.fail("camera angle out of range (expected 0 to pi)");
  }
  if (fl_x && width && height) {
    if (!(*width >= 1 && *width <= kMaxImageSide && *height >= 1 && *height <= kMaxImageSide)) {
      source.fail("image size out of range (found " + JsonNode(*width).dump() + " x " + JsonNode(*height).dump() + ")");
    }
    Camera& camera = entry.camera;
    camera.size = {*width, *height};
    camera.focal = {*fl_x, number(source, frame, "fl_y").value_or(*fl_x)};
    camera.center = {number(source, frame, "cx").value_or(*width / 2),
                     number(source, frame, "cy").value_or(*height / 2)};
    if (!(camera.focal.x > 0 && camera.focal.y > 0)) source.fail("focal length is not positive");
  } else if (!entry.field_of_view_x) {
    source.fail(label + ": no intrinsics (expected fl_x, w and h, or camera_angle_x)");
  }
}

// As a path of this system. Tools on Windows write backslashes; here they may also be part of a name that exists.
std::string portable(const fs::path& folder, std::string file_path) {
  std::error_code ignored;
  if (!fs::exists(folder / file_path, ignored)) std::replace(file_path.begin(), file_path.end(), '\\', '/');
  return file_path;
}

fs::path imagePath(const fs::path& folder, const std::string& file_path) {
  for (const char* extension : kExtensions) {
    fs::path candidate = folder / (file_path + extension);
    std::error_code ignored;
    if (fs::is_regular_file(candidate, ignored)) return candidate;
  }
  return folder / file_path;
}

// Below images/, where the path is there.
std::string belowImages(const std::string& file_path, const fs::path& image) {
  const fs::path path = fs::path(file_path).lexically_normal();
  if (path.begin() == path.end() || *path.begin() != "images") return {};
  return (path.lexically_relative("images").parent_path() / image.filename()).string();
}

// nerfstudio's optional lists of file paths: what `test_filenames` or, without it, `val_filenames` lists is held out.
std::optional<std::set<std::string>> testFiles(const Source& source, const fs::path& folder) {
  for (const char* key : {"test_filenames", "val_filenames"}) {
    const auto list = source.json.find(key);
    if (list == source.json.end()) continue;
    if (!list->is_array()) source.fail(std::string("'") + key + "' is not an array");
    std::set<std::string> files;
    for (const JsonNode& file : *list) {
      if (!file.is_string()) source.fail(std::string("'") + key + "' holds something that is not a string");
      files.insert(fs::path(portable(folder, file.get<std::string>())).lexically_normal().string());
    }
    if (!files.empty()) return files;
  }
  return std::nullopt;
}

void readFrames(const Source& source, const fs::path& folder, bool test, DatasetIndex& index) {
  const auto frames = source.json.find("frames");
  if (frames == source.json.end() || !frames->is_array()) source.fail("expected an array 'frames'");
  const std::optional<std::set<std::string>> test_files = testFiles(source, folder);
  index.has_split |= test_files.has_value();
  for (std::size_t i = 0; i < frames->size(); i++) {
    const JsonNode& frame = (*frames)[i];
    const std::string label = "frame " + std::to_string(i);
    if (!frame.is_object()) source.fail(label + ": expected an object");
    const auto file_path = frame.find("file_path");
    if (file_path == frame.end() || !file_path->is_string() || file_path->get<std::string>().empty()) {
      source.fail(label + ": expected a string 'file_path'");
    }
    DatasetIndex::Entry entry;
    entry.lens = readLens(source, frame);
    const std::string file = portable(folder, file_path->get<std::string>());
    entry.image = imagePath(folder, file);
    entry.below_images = belowImages(file, entry.image);
    entry.camera.name = entry.image.filename().string();
    entry.camera.test = test || (test_files && test_files->contains(fs::path(file).lexically_normal().string()));
    if (const auto mask = frame.find("mask_path"); mask != frame.end() && !mask->is_null()) {
      if (!mask->is_string() || mask->get<std::string>().empty()) source.fail(label + ": 'mask_path' is not a path");
      entry.mask = folder / portable(folder, mask->get<std::string>());
    }
    setIntrinsics(source, frame, label, entry);
    setPose(source, frame, label, entry.camera);
    index.entries.push_back(std::move(entry));
  }
}

// nerfstudio's `applied_transform` tells how poses and points were moved from COLMAP's frame: both are written after
// it, in one frame, so nothing is left to apply.
void readPoints(const Source& source, const fs::path& folder, DatasetIndex& index) {
  const auto named = source.json.find("ply_file_path");
  std::error_code ignored;
  if (named != source.json.end()) {
    if (!named->is_string()) source.fail("'ply_file_path' is not a string");
    index.points_file = named->get<std::string>();
  } else if (fs::is_regular_file(folder / "points3d.ply", ignored)) {
    index.points_file = "points3d.ply";
  }
  if (!index.points_file.empty()) index.points = readPointCloudPly(folder / index.points_file);
}

}  // namespace

DatasetIndex readTransforms(const fs::path& folder, DatasetLayout layout) {
  const auto exists = [&](const char* file) {
    std::error_code ignored;
    return fs::is_regular_file(folder / file, ignored);
  };
  DatasetIndex index;
  const bool one_file = exists("transforms.json");
  const bool split_files = layout == DatasetLayout::nerfSynthetic || !one_file;
  if (layout == DatasetLayout::nerfSynthetic && !exists("transforms_train.json") && one_file) {
    throw Error(ErrorKind::badData, folder.string(),
                "not in the NeRF-synthetic layout (expected transforms_train.json, found transforms.json: use --layout "
                "transforms)");
  }
  const Source train = parse(folder / (split_files ? "transforms_train.json" : "transforms.json"));
  readFrames(train, folder, false, index);
  if (split_files && exists("transforms_test.json")) {
    readFrames(parse(folder / "transforms_test.json"), folder, true, index);
    index.has_split = true;
  }
  readPoints(train, folder, index);
  return index;
}

}  // namespace tg
