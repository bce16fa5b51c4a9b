// SPDX-License-Identifier: Apache-2.0
#include "textured_gaussians/dataset.h"

#include "library/access.h"

namespace textured_gaussians {

Dataset Dataset::load(const std::filesystem::path& folder, const DatasetOptions& options) {
  return guarded([&] {
    requirePath(folder);
    tg::DatasetOptions own;
    own.downscale = options.downscale;
    own.test_every = options.test_every;
    if (options.background) own.background = finiteColorOf(*options.background);
    return Dataset(std::make_shared<const Parts>(Parts{tg::loadDataset(folder, own), own.background.has_value()}));
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
