// SPDX-License-Identifier: Apache-2.0
// COLMAP sparse models, binary and text: cameras, images, points3D.
#include "training/data/colmap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/gtc/type_ptr.hpp>
#include <locale>
#include <map>
#include <span>
#include <sstream>
#include <string_view>

#include "core/bundle/colmap_camera.h"
#include "core/file/file.h"
#include "core/system/error.h"
#include "core/system/shortened.h"
#include "training/data/dataset.h"
#include "training/data/normalize.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kMaxModelBytes = std::uint64_t{4} << 30;
constexpr std::size_t kPieceBytes = std::size_t{1} << 20;
constexpr std::size_t kMaxLineBytes = std::size_t{1} << 28;  // 2D points of one image: millions
constexpr std::size_t kMaxNameBytes = 4096;
constexpr std::uint64_t kLeastImageBytes = 73;  // in images.bin: without a name, without points

// A camera with its lens.
struct ColmapCamera {
  Camera camera;
  Lens lens;
};

struct ColmapImage {
  std::string name;
  std::uint32_t camera_id = 0;
  glm::dvec4 rotation{1, 0, 0, 0};  // camera from world; w, x, y, z
  glm::dvec3 translation{0};
};

[[noreturn]] void fail(const fs::path& path, const std::string& what) {
  throw Error(ErrorKind::badData, path.string(), what);
}

void setParameters(const ColmapCameraModel& model, std::span<const double> values, ColmapCamera& result) {
  Camera& camera = result.camera;
  Lens& lens = result.lens;
  lens.model = model.name;
  lens.fisheye = model.fisheye;
  // Where the next value of a kind goes.
  std::map<char, double*> next = {{'f', &camera.focal.x},
                                  {'x', &camera.focal.x},
                                  {'y', &camera.focal.y},
                                  {'c', glm::value_ptr(camera.center)},
                                  {'k', lens.radial.data()},
                                  {'d', lens.radial_divisor.data()},
                                  {'p', lens.tangential.data()},
                                  {'t', lens.thin_prism.data()},
                                  {'o', &lens.fov}};
  for (std::size_t i = 0; i < values.size(); ++i) *next.at(model.parameters[i])++ = values[i];
  if (model.parameters[0] == 'f') camera.focal.y = camera.focal.x;
}

std::string supportedModels() {
  std::string names;
  for (const ColmapCameraModel& model : kColmapCameraModels) {
    if (model.parameters) names += (names.empty() ? "" : ", ") + std::string(model.name);
  }
  return names;
}

ColmapCamera makeCamera(const fs::path& path, const std::string& label, const ColmapCameraModel& model,
                        std::uint64_t width, std::uint64_t height, std::span<const double> parameters) {
  if (!model.parameters) {
    const bool all_around = model.name == "EQUIRECTANGULAR";  // COLMAP does not undistort it
    fail(path, label + ": camera model " + std::string(model.name) + " is not supported (expected one of " +
                   supportedModels() + "): " +
                   (all_around ? "cut it into pictures of pinhole cameras" : "run `colmap image_undistorter` first"));
  }
  if (parameters.size() != model.count) {
    fail(path, label + ": wrong number of parameters (expected " + std::to_string(model.count) + ", found " +
                   std::to_string(parameters.size()) + ")");
  }
  if (width < 1 || height < 1 || width > kMaxImageSide || height > kMaxImageSide) {
    fail(path, label + ": image size out of range (expected 1 to " + std::to_string(kMaxImageSide) +
                   " pixels a side, found " + std::to_string(width) + " x " + std::to_string(height) + ")");
  }
  for (const double value : parameters) {
    if (!std::isfinite(value)) fail(path, label + ": a parameter is not finite");
  }
  ColmapCamera result;
  result.camera.size = {width, height};
  setParameters(model, parameters, result);
  if (!(result.camera.focal.x > 0 && result.camera.focal.y > 0)) fail(path, label + ": focal length is not positive");
  return result;
}

// A file from its beginning on, of which a piece is in memory.
class Pieces {
 public:
  explicit Pieces(const fs::path& path) : file_(path, kMaxModelBytes) {}
  std::uint64_t remaining() const { return file_.size() - position_; }
  // What comes next: `least` bytes or more, fewer at the end only.
  std::span<const std::uint8_t> ahead(std::size_t least) {
    if (position_ + std::min<std::uint64_t>(least, remaining()) > begin_ + piece_.size()) {
      begin_ = position_;
      piece_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(std::max(least, kPieceBytes), remaining())));
      file_.read(begin_, piece_);
    }
    return std::span(piece_).subspan(static_cast<std::size_t>(position_ - begin_));
  }
  void skip(std::uint64_t count) { position_ += count; }  // at most remaining()

 private:
  const FileReader file_;
  std::vector<std::uint8_t> piece_;
  std::uint64_t begin_ = 0, position_ = 0;  // of the piece, of what comes next
};

// Little-endian fields of a file; every read is checked against what is left.
class Reader {
 public:
  explicit Reader(const fs::path& path) : path_(path), pieces_(path) {}

  template <typename T>
  T read(const char* what) {
    require(sizeof(T), what);
    T value;
    std::memcpy(&value, pieces_.ahead(sizeof(T)).data(), sizeof(T));
    pieces_.skip(sizeof(T));
    return value;
  }
  // A count of records of at least `record_bytes` each: cannot exceed what the file can hold.
  std::uint64_t readCount(std::uint64_t record_bytes, const char* what) {
    const std::uint64_t count = read<std::uint64_t>(what);
    if (count > pieces_.remaining() / record_bytes) {
      fail(path_, std::string(what) + ": the file is too short for " + std::to_string(count) +
                      " records (expected at least " + std::to_string(record_bytes) + " bytes each, found " +
                      std::to_string(pieces_.remaining()) + " in all)");
    }
    return count;
  }
  std::string readName() {
    const std::span<const std::uint8_t> bytes = pieces_.ahead(kMaxNameBytes);
    const void* end = bytes.empty() ? nullptr : std::memchr(bytes.data(), 0, std::min(bytes.size(), kMaxNameBytes));
    if (!end) fail(path_, "an image name does not end");
    std::string name(reinterpret_cast<const char*>(bytes.data()));
    pieces_.skip(name.size() + 1);
    return name;
  }
  void skip(std::uint64_t count, const char* what) {
    require(count, what);
    pieces_.skip(count);
  }

 private:
  void require(std::uint64_t count, const char* what) const {
    if (count > pieces_.remaining()) fail(path_, std::string("the file ends inside ") + what);
  }
  fs::path path_;
  Pieces pieces_;
};

// Lines of a text file without comments; empty lines are kept, since images.txt gives them a meaning.
class Lines {
 public:
  explicit Lines(const fs::path& path) : path_(path), pieces_(path) {
    constexpr std::array<std::uint8_t, 3> kMark = {0xef, 0xbb, 0xbf};  // Notepad's, of UTF-8
    const std::span<const std::uint8_t> start = pieces_.ahead(kMark.size());
    if (start.size() >= kMark.size() && std::ranges::equal(start.first(kMark.size()), kMark))
      pieces_.skip(kMark.size());
  }
  bool next() {
    while (readLine()) {
      if (!line_.empty() && line_.back() == '\r') line_.pop_back();
      if (line_.empty() || line_.front() != '#') {
        fields_ = std::istringstream(line_);
        fields_.imbue(std::locale::classic());
        return true;
      }
    }
    return false;
  }
  bool blank() const { return line_.find_first_not_of(" \t") == std::string::npos; }
  // Whether it is nothing but groups of three numbers, by its characters: these lines are most of a large file.
  bool holdsTriples() const {
    std::size_t fields = 0;
    for (std::size_t i = 0; i < line_.size(); ++i) {
      const auto isSpace = [&](std::size_t at) { return line_[at] == ' ' || line_[at] == '\t'; };
      fields += !isSpace(i) && (i == 0 || isSpace(i - 1));
    }
    return fields % 3 == 0 && line_.find_first_not_of(" \t0123456789+-.eEnaif") == std::string::npos;
  }
  template <typename T>
  T read(const char* what) {
    T value{};
    if (!(fields_ >> value)) fail(path_, label() + ": expected " + what);
    return value;
  }
  std::vector<double> readRest() {
    std::vector<double> values;
    for (double value; fields_ >> value;) values.push_back(value);
    if (!fields_.eof()) fail(path_, label() + ": expected numbers");
    return values;
  }
  std::string readRestOfLine() {
    std::string text;
    std::getline(fields_ >> std::ws, text);
    return text;
  }
  std::string label() const { return "line " + std::to_string(number_); }

 private:
  bool readLine() {
    line_.clear();
    ++number_;
    for (bool some = false;; some = true) {
      const std::span<const std::uint8_t> bytes = pieces_.ahead(1);
      if (bytes.empty()) return some;
      const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      const std::size_t end = text.find('\n');
      const std::string_view part = text.substr(0, end);
      if (part.find('\0') != part.npos) fail(path_, label() + ": holds a byte of value 0");
      if (part.size() > kMaxLineBytes - line_.size()) {
        fail(path_, label() + ": too long (expected at most " + std::to_string(kMaxLineBytes) + " bytes)");
      }
      line_ += part;
      pieces_.skip(part.size() + (end == text.npos ? 0 : 1));
      if (end != text.npos) return true;
    }
  }

  fs::path path_;
  Pieces pieces_;
  std::istringstream fields_;
  std::string line_;
  std::size_t number_ = 0;
};

using Cameras = std::map<std::uint32_t, ColmapCamera>;

// Calls take(id, label, model, width, height, parameters) for each camera of a cameras.bin.
template <typename Take>
void forEachCamera(const fs::path& path, Take take) {
  Reader reader(path);
  const std::uint64_t count = reader.readCount(24, "cameras");
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto id = reader.read<std::uint32_t>("a camera");
    const auto model = reader.read<std::int32_t>("a camera");
    const auto width = reader.read<std::uint64_t>("a camera");
    const auto height = reader.read<std::uint64_t>("a camera");
    const std::string label = "camera " + std::to_string(id);
    if (model < 0 || model >= static_cast<int>(kColmapCameraModels.size())) {
      fail(path, label + ": unknown camera model " + std::to_string(model));
    }
    std::vector<double> parameters(kColmapCameraModels[model].count);
    for (double& value : parameters) value = reader.read<double>("a camera's parameters");
    take(id, label, kColmapCameraModels[model], width, height, parameters);
  }
}

Cameras readCamerasBinary(const fs::path& path) {
  Cameras cameras;
  forEachCamera(path, [&](std::uint32_t id, const auto&... camera) { cameras[id] = makeCamera(path, camera...); });
  return cameras;
}

Cameras readCamerasText(const fs::path& path) {
  Lines lines(path);
  Cameras cameras;
  while (lines.next()) {
    if (lines.blank()) continue;
    const auto id = lines.read<std::uint32_t>("a camera id");
    const auto model = lines.read<std::string>("a camera model");
    const auto width = lines.read<std::uint64_t>("a width");
    const auto height = lines.read<std::uint64_t>("a height");
    const std::string label = "camera " + std::to_string(id);
    const auto known = std::ranges::find(kColmapCameraModels, model, &ColmapCameraModel::name);
    if (known == kColmapCameraModels.end()) fail(path, label + ": unknown camera model " + shortened(model));
    cameras[id] = makeCamera(path, label, *known, width, height, lines.readRest());
  }
  return cameras;
}

std::vector<ColmapImage> readImagesBinary(const fs::path& path) {
  Reader reader(path);
  const std::uint64_t count = reader.readCount(kLeastImageBytes, "images");
  std::vector<ColmapImage> images(count);
  for (ColmapImage& image : images) {
    reader.skip(sizeof(std::uint32_t), "an image");
    for (int i = 0; i < 4; ++i) image.rotation[i] = reader.read<double>("an image's rotation");
    for (int i = 0; i < 3; ++i) image.translation[i] = reader.read<double>("an image's translation");
    image.camera_id = reader.read<std::uint32_t>("an image");
    image.name = reader.readName();
    reader.skip(reader.readCount(24, "2D points") * 24, "an image's 2D points");
  }
  return images;
}

std::vector<ColmapImage> readImagesText(const fs::path& path) {
  Lines lines(path);
  std::vector<ColmapImage> images;
  while (lines.next()) {
    if (lines.blank()) continue;
    ColmapImage& image = images.emplace_back();
    lines.read<std::uint32_t>("an image id");
    for (int i = 0; i < 4; ++i) image.rotation[i] = lines.read<double>("a quaternion");
    for (int i = 0; i < 3; ++i) image.translation[i] = lines.read<double>("a translation");
    image.camera_id = lines.read<std::uint32_t>("a camera id");
    image.name = lines.readRestOfLine();
    if (image.name.empty()) fail(path, lines.label() + ": expected an image name");
    // Some programs leave the line of 2D points out where there are none, and the next image would pass for it.
    if (lines.next() && !lines.holdsTriples()) {
      fail(path, lines.label() + ": expected the 2D points of '" + shortened(image.name) +
                     "', three numbers each, or an empty line where there are none");
    }
  }
  return images;
}

void addPoint(const fs::path& path, glm::dvec3 position, const std::array<double, 3>& rgb, const glm::dvec3& origin,
              PointCloud& points) {
  if (!std::isfinite(position.x + position.y + position.z)) {
    fail(path, "point " + std::to_string(points.position.size()) + " is not finite");
  }
  points.position.emplace_back(position - origin);
  points.color.push_back(glm::vec3(glm::dvec3(rgb[0], rgb[1], rgb[2]) / 255.0));
}

PointCloud readPointsBinary(const fs::path& path, const glm::dvec3& origin) {
  Reader reader(path);
  PointCloud points;
  const std::uint64_t count = reader.readCount(51, "points");
  points.position.reserve(count);
  points.color.reserve(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    reader.skip(sizeof(std::uint64_t), "a point");
    glm::dvec3 position;
    for (int c = 0; c < 3; ++c) position[c] = reader.read<double>("a point's position");
    std::array<double, 3> rgb;
    for (double& value : rgb) value = reader.read<std::uint8_t>("a point's colour");
    reader.skip(sizeof(double), "a point's error");
    reader.skip(reader.readCount(8, "a point's track") * 8, "a point's track");
    addPoint(path, position, rgb, origin, points);
  }
  return points;
}

PointCloud readPointsText(const fs::path& path, const glm::dvec3& origin) {
  Lines lines(path);
  PointCloud points;
  while (lines.next()) {
    if (lines.blank()) continue;
    lines.read<std::uint64_t>("a point id");
    glm::dvec3 position;
    for (int c = 0; c < 3; ++c) position[c] = lines.read<double>("a position");
    std::array<double, 3> rgb;
    for (double& value : rgb) value = std::clamp(lines.read<double>("a colour"), 0.0, 255.0);
    addPoint(path, position, rgb, origin, points);
  }
  return points;
}

glm::dmat3 rotationMatrix(const fs::path& path, const ColmapImage& image) {
  const double length = glm::length(image.rotation);
  if (!(length > 1e-6 && std::isfinite(length)) || !std::isfinite(glm::dot(image.translation, image.translation))) {
    fail(path, "image '" + shortened(image.name) + "': the pose is not usable (zero quaternion or not finite)");
  }
  const glm::dvec4 q = image.rotation / length;
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return glm::dmat3(glm::dvec3(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
                    glm::dvec3(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
                    glm::dvec3(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)));
}

// Of a folder with both kinds the binary one, unless that lacks a file.
bool isBinary(const fs::path& model) {
  return isFile(model / "cameras.bin") && (isFile(model / "images.bin") || !isFile(model / "cameras.txt"));
}

bool holdsModel(const fs::path& folder) { return isFile(folder / "cameras.bin") || isFile(folder / "cameras.txt"); }

// Photographs of a model by the first bytes of its images.bin, or all of images.txt; 0 where it cannot be read.
std::uint64_t imagesOf(const fs::path& model) {
  try {
    if (!isBinary(model)) return readImagesText(model / "images.txt").size();
    const FileReader file(model / "images.bin", kMaxModelBytes);
    std::array<std::uint8_t, 8> bytes;
    file.read(0, bytes);
    std::uint64_t count;
    std::memcpy(&count, bytes.data(), sizeof count);
    return std::min(count, file.size() / kLeastImageBytes);
  } catch (const Error&) {
    return 0;
  }
}

// COLMAP gives photographs that do not hang together a model each, in folders that are called by numbers from 0 on. The
// one with the most photographs, the first of several.
std::optional<fs::path> largestModel(const fs::path& sparse) {
  std::error_code reason;
  std::vector<fs::path> models;
  for (fs::directory_iterator entry(sparse, reason), end; !reason && entry != end; entry.increment(reason)) {
    const std::string name = entry->path().filename().string();
    if (name.find_first_not_of("0123456789") == name.npos && holdsModel(entry->path())) models.push_back(entry->path());
  }
  std::ranges::sort(models, {}, [](const fs::path& model) {
    const std::string name = model.filename().string();
    return std::pair(name.size(), name);
  });
  if (models.empty()) return std::nullopt;
  if (models.size() == 1) return models.front();
  std::vector<std::uint64_t> images;
  for (const fs::path& model : models) images.push_back(imagesOf(model));
  return models[static_cast<std::size_t>(std::ranges::max_element(images) - images.begin())];
}

std::optional<fs::path> modelIn(const fs::path& sparse) {
  for (const fs::path& model : {sparse / "0", sparse}) {
    if (holdsModel(model)) return model;
  }
  return largestModel(sparse);
}

}  // namespace

std::optional<fs::path> findColmapModel(const fs::path& folder, bool below_colmap) {
  std::optional<fs::path> model = modelIn(folder / "sparse");
  std::error_code ignored;
  if (!model && below_colmap && fs::is_directory(folder / "images", ignored)) model = modelIn(folder / "colmap/sparse");
  return model;
}

DatasetIndex readColmap(const fs::path& folder, bool normalize) {
  const std::optional<fs::path> model = findColmapModel(folder);
  if (!model) fail(folder, "no COLMAP model (expected cameras.bin or cameras.txt in sparse/0 or sparse)");
  DatasetIndex index;
  const fs::path larger = model->filename() == "0" ? largestModel(model->parent_path()).value_or(*model) : *model;
  if (larger != *model) {
    const auto named = [&](const fs::path& path) { return path.lexically_proximate(folder).string(); };
    index.notes.push_back(named(larger) + " has more photographs (" + std::to_string(imagesOf(larger)) + ") than " +
                          named(*model) + " (" + std::to_string(imagesOf(*model)) +
                          "), which is read as it is called 0");
  }
  const bool binary = isBinary(*model);
  const std::string extension = binary ? ".bin" : ".txt";
  const fs::path images_path = *model / ("images" + extension);
  const fs::path points_path = *model / ("points3D" + extension);
  const Cameras cameras = binary ? readCamerasBinary(*model / "cameras.bin") : readCamerasText(*model / "cameras.txt");
  const std::vector<ColmapImage> images = binary ? readImagesBinary(images_path) : readImagesText(images_path);

  for (const ColmapImage& image : images) {
    const auto camera = cameras.find(image.camera_id);
    if (camera == cameras.end()) {
      fail(images_path, "image '" + shortened(image.name) + "' names camera " + std::to_string(image.camera_id) +
                            ", which cameras" + extension + " lacks");
    }
    DatasetIndex::Entry entry;
    entry.camera = camera->second.camera;
    entry.lens = camera->second.lens;
    entry.camera.name = image.name;
    entry.camera.rotation = rotationMatrix(images_path, image);
    entry.camera.translation = image.translation;
    entry.image = folder / "images" / image.name;
    entry.below_images = image.name;
    index.entries.push_back(std::move(entry));
  }
  if (normalize) index.origin = middleOf(index.entries);
  if (isFile(points_path)) {
    index.points_file = points_path.filename().string();
    index.points = binary ? readPointsBinary(points_path, index.origin) : readPointsText(points_path, index.origin);
  }
  return index;
}

ColmapSummary summarizeColmap(const fs::path& model) {
  ColmapSummary summary;
  forEachCamera(model / "cameras.bin", [](const auto&...) {});  // that it is whole; reading the model judges it
  for (const ColmapImage& image : readImagesBinary(model / "images.bin")) summary.images.push_back(image.name);
  Reader reader(model / "points3D.bin");
  summary.points = reader.readCount(51, "points");
  double sum = 0;
  for (std::size_t i = 0; i < summary.points; ++i) {
    reader.skip(sizeof(std::uint64_t) + 3 * sizeof(double) + 3, "a point");
    sum += reader.read<double>("a point's error");
    reader.skip(reader.readCount(8, "a point's track") * 8, "a point's track");
  }
  if (summary.points > 0) summary.error = sum / static_cast<double>(summary.points);
  return summary;
}

}  // namespace tg
