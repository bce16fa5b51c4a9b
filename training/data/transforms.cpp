// SPDX-License-Identifier: Apache-2.0
// transforms_train.json / transforms_test.json (NeRF-synthetic) and transforms.json (instant-ngp, nerfstudio).
#include <algorithm>
#include <array>
#include <climits>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/model/rotation.h"
#include "core/system/error.h"
#include "training/data/dataset.h"
#include "training/data/normalize.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kMaxJsonBytes = std::uint64_t{256} << 20;
constexpr double kRowTolerance = 1e-3;  // of what is 0, 0, 0, 1 in every matrix: as rounded as the rest of it
constexpr std::array<const char*, 10> kDistortion = {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "s1", "s2"};
constexpr std::array<const char*, 11> kExtensions = {"",     ".png", ".jpg",  ".jpeg", ".webp", ".exr",
                                                     ".PNG", ".JPG", ".JPEG", ".WEBP", ".EXR"};

nlohmann::json readObject(const std::string& path) {
  nlohmann::json json = parseJson(readRegularFile(path, kMaxJsonBytes), path);
  if (!json.is_object()) throw Error(ErrorKind::badData, path, "expected a JSON object at the top");
  return json;
}

// The system would take what stands before a zero for it.
bool isPath(const nlohmann::json& value) {
  if (!value.is_string()) return false;
  const std::string& text = value.get_ref<const std::string&>();
  return text.size() < PATH_MAX && text.find('\0') == text.npos;
}

std::string shown(double value) { return nlohmann::json(value).dump(); }

// Who says `key`: nerfstudio lets every frame override the shared intrinsics. What is null is not said.
const JsonNode& saying(const char* key, const JsonNode& top, const JsonNode& frame) {
  const auto found = frame.value.find(key);
  return found == frame.value.end() || found->is_null() ? top : frame;
}

std::optional<double> number(const JsonNode& top, const JsonNode& frame, const char* key) {
  const JsonNode& owner = saying(key, top, frame);
  const auto found = owner.value.find(key);
  if (found == owner.value.end() || found->is_null()) return std::nullopt;
  if (!found->is_number() || !std::isfinite(found->get<double>())) {
    owner.fail(std::string("'") + key + "' is not a finite number");
  }
  return found->get<double>();
}

std::string cameraModel(const JsonNode& top, const JsonNode& frame) {
  const JsonNode& owner = saying("camera_model", top, frame);
  const auto model = owner.value.find("camera_model");
  if (model != owner.value.end() && !model->is_null()) return model->is_string() ? model->get<std::string>() : "?";
  constexpr const char* kFisheye = "is_fisheye";  // instant-ngp's
  const JsonNode& other = saying(kFisheye, top, frame);
  const auto fisheye = other.value.find(kFisheye);
  if (fisheye == other.value.end() || fisheye->is_null()) return "OPENCV";
  return other.boolean(kFisheye) ? "OPENCV_FISHEYE" : "OPENCV";
}

// instant-ngp's keys for cameras that no key of nerfstudio's describes.
void refuseOtherCameras(const JsonNode& top, const JsonNode& frame) {
  for (const char* key : {"ftheta_p0", "latlong", "equirectangular"}) {
    const JsonNode& owner = saying(key, top, frame);
    const auto found = owner.value.find(key);
    if (found == owner.value.end() || found->is_null() || *found == false) continue;
    owner.fail(std::string("camera '") + key + "' is not supported: undistort the images first");
  }
  // Rows of one photograph have poses between two. Where a frame has one alone, the key changes nothing.
  const JsonNode& owner = saying("rolling_shutter", top, frame);
  const auto shutter = owner.value.find("rolling_shutter");
  const auto isZero = [](const nlohmann::json& part) { return part == 0; };
  if (frame.value.contains("transform_matrix_end") && shutter != owner.value.end() && shutter->is_array() &&
      !std::ranges::all_of(*shutter, isZero)) {
    frame.fail("'rolling_shutter' is not supported (expected zeros, or no 'transform_matrix_end')");
  }
}

// nerfstudio's keys: k1 to k4 of a fisheye; otherwise OpenCV's k1, k2, k3, p1, p2, whatever the model is called.
Lens readLens(const JsonNode& top, const JsonNode& frame) {
  Lens lens;
  lens.model = cameraModel(top, frame);
  lens.fisheye = lens.model == "OPENCV_FISHEYE";
  constexpr std::array<const char*, 6> kModels = {"PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL",
                                                  "RADIAL",  "OPENCV",         "OPENCV_FISHEYE"};
  if (std::ranges::find(kModels, lens.model) == kModels.end()) {
    saying("camera_model", top, frame)
        .fail("camera model '" + lens.model +
              "' is not supported (expected PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV or "
              "OPENCV_FISHEYE): undistort the images first");
  }
  for (const char* key : kDistortion) {
    const double value = number(top, frame, key).value_or(0.0);
    if (value == 0) continue;
    const std::string_view name = key;
    const bool tangential = name[0] == 'p';
    const auto index = static_cast<std::size_t>(name[1] - '1');
    if (name[0] == 's' || index > 3 || (lens.fisheye ? tangential : index > 2)) {
      saying(key, top, frame)
          .fail("lens distortion '" + std::string(name) + "' is not supported with camera model " + lens.model +
                " (expected 0, found " + shown(value) + "): undistort the images first");
    }
    (tangential ? lens.tangential[index] : lens.radial[index]) = value;
  }
  return lens;
}

// World-to-camera in OpenCV axes from camera-to-world in OpenGL axes (x right, y up, looks down -z).
void setPose(const JsonNode& frame, Camera& camera) {
  const auto found = frame.value.find("transform_matrix");
  if (found == frame.value.end() || !found->is_array() || (found->size() != 4 && found->size() != 3)) {
    frame.fail("expected a 4 x 4 'transform_matrix'");
  }
  glm::dmat3 world_from_camera;
  glm::dvec3 position;
  for (int row = 0; row < 3; ++row) {
    const nlohmann::json& values = (*found)[row];
    if (!values.is_array() || values.size() != 4) frame.fail("expected a 4 x 4 'transform_matrix'");
    for (int column = 0; column < 4; ++column) {
      if (!values[column].is_number()) frame.fail("'transform_matrix' holds something that is not a number");
      const double value = values[column].get<double>();
      if (!std::isfinite(value)) frame.fail("'transform_matrix' is not finite");
      if (column == 3) {
        position[row] = value;
      } else {
        world_from_camera[column][row] = column == 0 ? value : -value;
      }
    }
  }
  const nlohmann::json& row = found->size() == 4 ? found->back() : nlohmann::json({0, 0, 0, 1});
  if (!row.is_array() || row.size() != 4) frame.fail("expected a 4 x 4 'transform_matrix'");
  for (std::size_t column = 0; column < 4; ++column) {
    if (!row[column].is_number()) frame.fail("'transform_matrix' holds something that is not a number");
    const double value = row[column].get<double>();
    if (!(std::abs(value - (column == 3 ? 1 : 0)) <= kRowTolerance)) {
      frame.fail("'transform_matrix' is not a rotation and a translation (expected a last row of 0, 0, 0, 1, found " +
                 shown(value) + " in column " + std::to_string(column + 1) + ")");
    }
  }
  if (!(skewOf(world_from_camera) < 1e-2) || glm::determinant(world_from_camera) <= 0) {
    frame.fail("'transform_matrix' is not a rotation and a translation (scaled, sheared or mirrored)");
  }
  world_from_camera = orthonormalized(world_from_camera);  // files carry float32 noise
  camera.rotation = glm::transpose(world_from_camera);
  camera.translation = -camera.rotation * position;
}

void setIntrinsics(const JsonNode& top, const JsonNode& frame, DatasetIndex::Entry& entry) {
  const std::optional<double> width = number(top, frame, "w");
  const std::optional<double> height = number(top, frame, "h");
  const std::optional<double> fl_x = number(top, frame, "fl_x");
  entry.field_of_view_x = number(top, frame, "camera_angle_x");
  entry.field_of_view_y = number(top, frame, "camera_angle_y");
  for (const char* key : {"camera_angle_x", "camera_angle_y"}) {
    if (const auto angle = number(top, frame, key); angle && !(*angle > 0 && *angle < 3.14)) {
      saying(key, top, frame).fail("camera angle out of range (expected 0 to pi, found " + shown(*angle) + ")");
    }
  }
  if (!fl_x && !entry.field_of_view_x) frame.fail("no intrinsics (expected fl_x, w and h, or camera_angle_x)");
  entry.focal_x = fl_x;
  entry.focal_y = number(top, frame, "fl_y");
  entry.center_x = number(top, frame, "cx");
  entry.center_y = number(top, frame, "cy");
  for (const char* key : {"fl_x", "fl_y"}) {
    if (const auto focal = number(top, frame, key); focal && !(*focal > 0)) {
      saying(key, top, frame).fail("focal length is not positive (expected above 0, found " + shown(*focal) + ")");
    }
  }
  if (!width || !height) {
    if (!entry.field_of_view_x) frame.fail("no size of the image (expected w and h beside fl_x)");
    return;
  }
  if (!(*width >= 1 && *width <= kMaxImageSide && *height >= 1 && *height <= kMaxImageSide)) {
    saying("w", top, frame)
        .fail("image size out of range (expected 1 to " + std::to_string(kMaxImageSide) + " pixels a side, found " +
              shown(*width) + " x " + shown(*height) + ")");
  }
  entry.camera = intrinsicsOf(entry, entry.camera, {*width, *height});
}

// As a path of this system, from the folder where it lies in there. Tools on Windows write backslashes; here they may
// also be part of a name that exists.
std::string portable(const fs::path& folder, std::string file_path) {
  std::error_code ignored;
  if (!fs::exists(folder / file_path, ignored)) std::replace(file_path.begin(), file_path.end(), '\\', '/');
  if (!fs::path(file_path).is_absolute()) return file_path;
  const fs::path below =
      fs::path(file_path).lexically_normal().lexically_relative(fs::absolute(folder).lexically_normal());
  return below.empty() || *below.begin() == ".." ? file_path : below.string();
}

fs::path imagePath(const fs::path& folder, const std::string& file_path) {
  for (const char* extension : kExtensions) {
    fs::path candidate = folder / (file_path + extension);
    if (isFile(candidate)) return candidate;
  }
  return folder / file_path;
}

// Below images/, where the path is there.
std::string belowImages(const std::string& file_path, const fs::path& image) {
  const fs::path path = fs::path(file_path).lexically_normal();
  if (path.begin() == path.end() || *path.begin() != "images") return {};
  return (path.lexically_relative("images").parent_path() / image.filename()).string();
}

// The image that a path names, in one spelling.
std::string placeOf(const fs::path& image) { return fs::absolute(image).lexically_normal().string(); }

// One of nerfstudio's optional lists of file paths; empty where it is not there.
std::set<std::string> fileList(const JsonNode& top, const fs::path& folder, const char* key) {
  std::set<std::string> files;
  const auto list = top.value.find(key);
  if (list == top.value.end() || list->is_null()) return files;
  if (!list->is_array()) top.fail(std::string("'") + key + "' is not an array");
  for (const nlohmann::json& file : *list) {
    if (!isPath(file)) top.fail(std::string("'") + key + "' holds something that is not a path");
    files.insert(placeOf(imagePath(folder, portable(folder, file.get<std::string>()))));
  }
  return files;
}

void readFrames(const JsonNode& top, const fs::path& folder, bool test, DatasetIndex& index) {
  const auto frames = top.value.find("frames");
  if (frames == top.value.end() || !frames->is_array()) top.fail("expected an array 'frames'");
  const std::set<std::string> train_files = fileList(top, folder, "train_filenames");
  std::set<std::string> test_files = fileList(top, folder, "test_filenames");
  if (test_files.empty()) test_files = fileList(top, folder, "val_filenames");
  const auto holdsArray = [&](const char* key) { return top.value.contains(key) && top.value.at(key).is_array(); };
  const bool none_held_out = !train_files.empty() && (holdsArray("test_filenames") || holdsArray("val_filenames"));
  index.has_split |= none_held_out || !test_files.empty();
  for (std::size_t i = 0; i < frames->size(); ++i) {
    const JsonNode frame{(*frames)[i], top.path, "frame " + std::to_string(i)};
    if (!frame.value.is_object()) frame.fail("expected an object");
    const auto file_path = frame.value.find("file_path");
    if (file_path == frame.value.end() || !file_path->is_string() || file_path->get<std::string>().empty()) {
      frame.fail("expected a string 'file_path'");
    }
    if (!isPath(*file_path)) frame.fail("'file_path' is not a path");
    DatasetIndex::Entry entry;
    const std::string file = portable(folder, file_path->get<std::string>());
    entry.image = imagePath(folder, file);
    const bool lists = !train_files.empty() || !test_files.empty();
    const std::string place = lists ? placeOf(entry.image) : "";
    const bool held_out = test_files.contains(place);
    if (!train_files.empty() && !held_out && !train_files.contains(place)) {
      ++index.outside_split;
      continue;
    }
    refuseOtherCameras(top, frame);
    entry.lens = readLens(top, frame);
    entry.below_images = belowImages(file, entry.image);
    entry.camera.name = entry.below_images.empty() ? entry.image.filename().string() : entry.below_images;
    entry.camera.test = test || held_out;
    if (const auto mask = frame.value.find("mask_path"); mask != frame.value.end() && !mask->is_null()) {
      if (!isPath(*mask) || mask->get<std::string>().empty()) frame.fail("'mask_path' is not a path");
      entry.mask = folder / portable(folder, mask->get<std::string>());
    }
    setIntrinsics(top, frame, entry);
    setPose(frame, entry.camera);
    index.entries.push_back(std::move(entry));
  }
  const auto isTest = [](const DatasetIndex::Entry& entry) { return entry.camera.test; };
  if (!test && !test_files.empty() && std::ranges::none_of(index.entries, isTest)) {
    top.fail("the list of what is held out names none of the " + std::to_string(frames->size()) +
             " frames (test_filenames or val_filenames)");
  }
  if (index.entries.empty() && index.outside_split > 0) {
    top.fail("train_filenames names none of the " + std::to_string(index.outside_split) + " frames");
  }
}

// nerfstudio's `applied_transform` tells how poses and points were moved from COLMAP's frame: both are written after
// it, in one frame, so nothing is left to apply.
void readPoints(const JsonNode& top, const fs::path& folder, DatasetIndex& index) {
  const auto named = top.value.find("ply_file_path");
  if (named != top.value.end() && !named->is_null()) {
    if (!named->is_string()) top.fail("'ply_file_path' is not a string");
    if (!isPath(*named)) top.fail("'ply_file_path' is not a path");
    index.points_file = portable(folder, named->get<std::string>());
  } else if (isFile(folder / "points3d.ply")) {
    index.points_file = "points3d.ply";
  }
  index.points_missing = !index.points_file.empty() && !isFile(folder / index.points_file);
  if (!index.points_file.empty() && !index.points_missing) {
    index.points = readPointCloudPly(folder / index.points_file, index.origin);
  }
}

std::optional<glm::vec3> background(const JsonNode& top) {
  const auto found = top.value.find(kBackgroundKey);
  if (found == top.value.end()) return std::nullopt;
  const auto is_share = [](const nlohmann::json& part) {
    return part.is_number() && part.get<double>() >= 0.0 && part.get<double>() <= 1.0;
  };
  if (!found->is_array() || found->size() != 3 || !std::ranges::all_of(*found, is_share)) {
    top.fail(std::string("'") + kBackgroundKey + "' is not three numbers from 0 to 1");
  }
  return glm::vec3((*found)[0].get<float>(), (*found)[1].get<float>(), (*found)[2].get<float>());
}

}  // namespace

Camera intrinsicsOf(const DatasetIndex::Entry& entry, Camera camera, glm::ivec2 size) {
  const auto focal = [](std::optional<double> length, std::optional<double> angle, int side) {
    return length || !angle ? length : std::optional(side / 2.0 / std::tan(*angle / 2.0));
  };
  camera.size = size;
  camera.focal.x = focal(entry.focal_x, entry.field_of_view_x, size.x).value();
  camera.focal.y = focal(entry.focal_y, entry.field_of_view_y, size.y).value_or(camera.focal.x);
  camera.center = {entry.center_x.value_or(size.x / 2.0), entry.center_y.value_or(size.y / 2.0)};
  return camera;
}

bool namesFocalLengths(const fs::path& transforms) {
  const nlohmann::json json = readObject(transforms.string());
  if (json.contains("fl_x")) return true;
  const auto frames = json.find("frames");
  return frames != json.end() && frames->is_array() && !frames->empty() && frames->front().contains("fl_x");
}

DatasetIndex readTransforms(const fs::path& folder, DatasetLayout layout, bool normalize) {
  const auto exists = [&](const char* file) { return isFile(folder / file); };
  DatasetIndex index;
  const bool one_file = exists("transforms.json");
  const bool split_files = layout == DatasetLayout::nerfSynthetic || !one_file;
  if (layout == DatasetLayout::nerfSynthetic && !exists("transforms_train.json") && one_file) {
    throw Error(ErrorKind::badData, folder.string(),
                "not in the NeRF-synthetic layout (expected transforms_train.json, found transforms.json: use --layout "
                "transforms)");
  }
  const std::string train = (folder / (split_files ? "transforms_train.json" : "transforms.json")).string();
  const nlohmann::json json = readObject(train);
  const JsonNode top{json, train, ""};
  readFrames(top, folder, false, index);
  if (split_files && exists("transforms_test.json")) {
    const std::string test = (folder / "transforms_test.json").string();
    readFrames({readObject(test), test, ""}, folder, true, index);
    index.has_split = true;
  }
  index.background = background(top);
  if (normalize) index.origin = middleOf(index.entries);
  readPoints(top, folder, index);
  return index;
}

}  // namespace tg
