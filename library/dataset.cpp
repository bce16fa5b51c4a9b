// SPDX-License-Identifier: Apache-2.0
#include "textured_gaussians/dataset.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "core/system/numbers.h"
#include "core/system/parallel.h"
#include "library/access.h"
#include "training/data/normalize.h"

namespace textured_gaussians {
namespace {

// `message` without `front`, the working folder with a slash, before the paths that it names.
std::string asGiven(std::string message, const std::string& front) {
  for (std::size_t at = 0; (at = message.find(front, at)) != message.npos; ++at) {
    const std::size_t end = at + front.size();
    if ((at > 0 && message[at - 1] != ' ') || message.compare(end, 1, " ") == 0) continue;  // no path's beginning
    const bool bare = message.compare(end, 2, "?)") == 0;                                   // the working folder itself
    message.replace(at, front.size(), bare ? "./" : "");
  }
  return message;
}

// By its whole path, since photographs are read for as long as there is the data set. What is wrong with it is said of
// paths that the caller knows.
tg::Dataset loaded(const std::filesystem::path& folder, const tg::DatasetOptions& options) {
  std::error_code reason;
  const std::filesystem::path whole = std::filesystem::absolute(folder, reason);
  if (reason) throw tg::Error(tg::ErrorKind::cannotRead, folder.string(), "cannot be read: " + reason.message());
  try {
    return tg::loadDataset(whole, options);
  } catch (const tg::Error& error) {
    if (folder.is_absolute()) throw;
    const std::string front = whole.string().substr(0, whole.string().size() - folder.string().size());
    throw tg::Error(error.kind, asGiven(error.what(), tg::printable(front)));
  }
}

// ---- Of photographs in memory

[[noreturn]] void refuseData(const std::string& what) { throw tg::Error(tg::ErrorKind::badData, "data set", what); }

// Nothing, or as much as there is of what it goes with. Throws tg::Error(badData).
template <typename Value>
void requireLength(const std::vector<Value>& values, std::size_t expected, const char* name) {
  if (values.empty() || values.size() == expected) return;
  refuseData(std::string(name) + ": wrong length" + tg::expectedFound(expected, values.size()));
}

std::string sizeText(const ByteImage& image) {
  return std::to_string(image.width) + " x " + std::to_string(image.height) + " x " + std::to_string(image.channels) +
         " of " + std::to_string(image.data.size()) + " bytes";
}

bool isEmpty(const ByteImage& mask) { return mask.width == 0 && mask.height == 0 && mask.data.empty(); }

// Throws tg::Error(badData).
void requireImage(const ByteImage& image, const tg::Camera& camera, bool is_mask, const std::string& name) {
  const bool right = image.width == camera.size.x && image.height == camera.size.y &&
                     (is_mask ? image.channels == 1 : isChannels(image.channels)) &&
                     image.data.size() == lengthOf(image.width, image.height, image.channels);
  if (right) return;
  refuseData(name + ": no picture of its camera's size (expected " + std::to_string(camera.size.x) + " x " +
             std::to_string(camera.size.y) + " x " + (is_mask ? "1" : "1, 3 or 4") + ", found " + sizeText(image) +
             ")");
}

// What was given at a place, and its camera. Throws tg::Error(badData).
void requirePhotograph(const DatasetData& data, std::size_t place, const tg::Camera& camera) {
  const std::string at = " " + std::to_string(place);
  tg::checkCamera("data set: camera" + at, camera);
  requireImage(data.images[place], camera, false, "image" + at);
  if (data.masks.empty() || isEmpty(data.masks[place])) return;
  const ByteImage& mask = data.masks[place];
  requireImage(mask, camera, true, "mask" + at);
  if (std::ranges::count(mask.data, 0) == std::ssize(mask.data)) refuseData("mask" + at + ": hides every pixel");
}

// Throws tg::Error(badData).
tg::PointCloud pointsOf(const DatasetData& data) {
  const std::size_t count = data.points.size() / 3;
  if (data.points.size() % 3 != 0) {
    refuseData("points: no whole number of points (expected a multiple of 3 floats, found " +
               std::to_string(data.points.size()) + ")");
  }
  requireLength(data.colors, 3 * count, "colors");
  const auto triple = [](const std::vector<float>& values, std::size_t i) {
    return glm::vec3(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
  };
  tg::PointCloud cloud;
  cloud.color.assign(count, glm::vec3(0.5f));
  for (std::size_t i = 0; i < count; ++i) {
    cloud.position.push_back(triple(data.points, i));
    if (data.colors.empty()) continue;
    const glm::vec3 color = triple(data.colors, i);
    for (int c = 0; c < 3; ++c) {
      if (color[c] >= 0 && color[c] <= 1) continue;  // a NaN is not
      refuseData("colors: point " + std::to_string(i) + " is out of range" +
                 tg::expectedFound("0 to 1", tg::numberText(color[c])));
    }
    cloud.color[i] = color;
  }
  tg::checkPoints("data set: points", cloud);
  return cloud;
}

// Of pictures that are white for the most part, since their floats were no numbers from 0 to 1.
void noteAboveWhite(const std::vector<ByteImage>& images, std::vector<std::string>& notes) {
  const auto count = std::ranges::count_if(images, &ByteImage::above_white);
  if (count == 0) return;
  const auto first = std::ranges::find_if(images, &ByteImage::above_white) - images.begin();
  notes.push_back(std::to_string(count) + " of " + std::to_string(images.size()) +
                  " images have most of their values above 1, which is white (the first: image " +
                  std::to_string(first) + "): floats from 0 to 255 want a division by 255");
}

// The views in the order of those of a folder, each with the place that it was given at: by name, training views first.
// Throws tg::Error.
std::vector<std::pair<tg::Camera, std::size_t>> viewsOf(const DatasetData& data) {
  std::vector<std::pair<tg::Camera, std::size_t>> views;
  for (const Camera& camera : data.cameras) {
    views.emplace_back(cameraOf(camera), views.size());
    requirePhotograph(data, views.size() - 1, views.back().first);
  }
  std::ranges::stable_sort(views, {}, [](const auto& view) { return view.first.name; });
  const auto is_test = [](const auto& view) { return view.first.test; };
  if (data.test_every > 0 && views.size() > 1 && std::ranges::none_of(views, is_test)) {
    for (std::size_t i = 0; i < views.size(); i += static_cast<std::size_t>(data.test_every))
      views[i].first.test = true;
  }
  if (std::ranges::all_of(views, is_test)) refuseData("every photograph is held out (expected one to train on)");
  std::ranges::stable_partition(views, std::not_fn(is_test));
  return views;
}

tg::Image imageOf(const ByteImage& bytes) {
  tg::Image image(bytes.width, bytes.height, bytes.channels);
  std::ranges::transform(bytes.data, image.data.begin(), [](std::uint8_t v) { return static_cast<float>(v) / 255.0f; });
  return image;
}

// The image's bytes are moved where they are the photograph's own.
tg::Photograph photographOf(ByteImage& image, std::vector<std::uint8_t> mask, const glm::vec3& background) {
  if (image.channels != 3) return tg::photographOf(imageOf(image), std::move(mask), background);
  tg::Photograph photograph;
  photograph.pixels = {image.width, image.height, std::move(image.data), std::move(mask)};
  return photograph;
}

// Throws tg::Error.
tg::Dataset made(DatasetData&& data) {
  tg::DatasetOptions options;
  options.test_every = data.test_every;
  tg::checkDatasetOptions(options);
  const std::size_t count = data.images.size();
  if (count == 0) refuseData("images: expected at least one");
  if (data.cameras.empty()) refuseData("cameras: expected one an image");
  requireLength(data.cameras, count, "cameras");
  requireLength(data.masks, count, "masks");
  tg::Dataset dataset;
  dataset.name = "the data set";
  if (data.background) dataset.background = finiteColorOf(*data.background);
  dataset.points = pointsOf(data);
  noteAboveWhite(data.images, dataset.notes);
  std::vector<std::size_t> places;
  for (auto& [camera, place] : viewsOf(data)) {
    places.push_back(place);
    dataset.files.push_back(camera.name);
    dataset.views.push_back(std::move(camera));
  }
  std::vector<tg::Photograph> photographs(count);
  const auto transparent = std::make_shared<std::vector<ByteImage>>(count);  // empty where the photograph is opaque
  tg::parallelFor(static_cast<std::int64_t>(count), 1, [&](std::int64_t i) {
    const std::size_t view = static_cast<std::size_t>(i), place = places[view];
    ByteImage image = std::move(data.images[place]);
    std::vector<std::uint8_t> mask;
    if (!data.masks.empty()) mask = std::move(data.masks[place].data);
    for (std::uint8_t& value : mask) value = value == 0 ? 0 : 255;
    photographs[view] = photographOf(image, std::move(mask), dataset.background);
    if (image.channels == 4) (*transparent)[view] = std::move(image);
  });
  const std::shared_ptr<tg::PhotographStore> store = tg::storeInMemory(std::move(photographs));
  dataset.photographs = store;
  dataset.decode = [store, transparent](std::size_t view, const glm::vec3& background) {
    const std::shared_ptr<const tg::Photograph> kept = store->get(view);
    const ByteImage& image = (*transparent)[view];
    return image.data.empty() ? *kept : tg::photographOf(imageOf(image), kept->pixels.mask, background);
  };
  for (std::string& note : tg::notesOnPlace(dataset, "")) dataset.notes.push_back(std::move(note));
  return dataset;
}

}  // namespace

Dataset::Dataset(DatasetData data)
    : parts_(guarded([&] {
        const bool chose_background = data.background.has_value();
        return std::make_shared<const Parts>(Parts{made(std::move(data)), chose_background});
      })) {}

Dataset Dataset::load(const std::filesystem::path& folder, const DatasetOptions& options) {
  return guarded([&] {
    requirePath(folder);
    tg::DatasetOptions own;
    own.downscale = options.downscale;
    own.test_every = options.test_every;
    own.normalize = options.normalize;
    own.normalize_by = "normalize";
    if (options.background) own.background = finiteColorOf(*options.background);
    return Dataset(std::make_shared<const Parts>(Parts{loaded(folder, own), own.background.has_value()}));
  });
}

std::size_t Dataset::size() const { return parts_->dataset.views.size(); }

std::vector<Camera> Dataset::cameras() const {
  std::vector<Camera> cameras;
  for (const tg::Camera& camera : parts_->dataset.views) cameras.push_back(cameraOf(camera));
  return cameras;
}

std::array<float, 3> Dataset::background() const { return colorOf(parts_->dataset.background); }

std::vector<std::string> Dataset::warnings() const {
  std::vector<std::string> warnings;
  for (const std::string& note : parts_->dataset.notes) warnings.push_back(tg::printable(note));
  return warnings;
}

Image Dataset::photograph(std::size_t index) const {
  return guarded([&] {
    if (index >= size()) {
      throw tg::Error(
          tg::ErrorKind::usage, "photograph",
          "no such one (expected 0 to " + std::to_string(size() - 1) + ", found " + std::to_string(index) + ")");
    }
    tg::Image image = parts_->dataset.pixels(index)->image();
    return Image{image.width, image.height, image.channels, std::move(image.data)};
  });
}

}  // namespace textured_gaussians
