// SPDX-License-Identifier: Apache-2.0
#include "textured_gaussians/dataset.h"

#include <cstddef>
#include <string>
#include <system_error>

#include "library/access.h"

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

}  // namespace

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
