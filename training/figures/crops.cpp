// SPDX-License-Identifier: Apache-2.0
// Sums over boxes, and the boxes that win.
#include "training/figures/crops.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

constexpr int kOverviewWidth = 360;  // [px] at most
constexpr int kSmallestCrop = 16;    // [px]

// Sums of everything above and left of a pixel: a box is four of them.
class BoxSums {
 public:
  explicit BoxSums(const Image& map) : stride_(static_cast<std::size_t>(map.width) + 1) {
    TG_ASSERT(map.channels == 1 && hasImageShape(map), "a map has one number a pixel");
    sums_.resize(stride_ * (static_cast<std::size_t>(map.height) + 1));
    for (int y = 0; y < map.height; ++y) {
      double row = 0;
      for (int x = 0; x < map.width; ++x) {
        row += map.at(x, y, 0);
        sums_[at(x + 1, y + 1)] = sums_[at(x + 1, y)] + row;
      }
    }
  }
  double mean(const PixelBox& box) const {
    const glm::ivec2 end = box.corner + box.size;
    const double sum = sums_[at(end.x, end.y)] - sums_[at(box.corner.x, end.y)] - sums_[at(end.x, box.corner.y)] +
                       sums_[at(box.corner.x, box.corner.y)];
    return sum / (static_cast<double>(box.size.x) * box.size.y);
  }

 private:
  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y) * stride_ + static_cast<std::size_t>(x); }
  std::size_t stride_;
  std::vector<double> sums_;
};

PixelBox largestBox(const BoxSums& sums, glm::ivec2 picture, glm::ivec2 size) {
  PixelBox best{{0, 0}, size};
  double most = sums.mean(best);
  for (int y = 0; y + size.y <= picture.y; ++y) {
    for (int x = 0; x + size.x <= picture.x; ++x) {
      const double mean = sums.mean({{x, y}, size});
      if (mean > most) {
        most = mean;
        best.corner = {x, y};
      }
    }
  }
  return best;
}

Image cut(const Image& image, const PixelBox& box) {
  Image result(box.size.x, box.size.y, image.channels);
  for (int y = 0; y < box.size.y; ++y) {
    for (int x = 0; x < box.size.x; ++x) {
      for (int c = 0; c < image.channels; ++c) result.at(x, y, c) = image.at(box.corner.x + x, box.corner.y + y, c);
    }
  }
  return result;
}

Image overviewOf(const Image& photograph, const PixelBox& box) {
  const int factor = (photograph.width + kOverviewWidth - 1) / kOverviewWidth;
  Image small = factor > 1 && photograph.height >= factor ? downsample(photograph, factor) : photograph;
  const double scale = static_cast<double>(small.width) / photograph.width;
  const auto place = [&](int pixel, int limit) {
    return std::clamp(static_cast<int>(std::lround(pixel * scale)), 0, limit - 1);
  };
  const int left = place(box.corner.x, small.width), right = place(box.corner.x + box.size.x, small.width);
  const int top = place(box.corner.y, small.height), bottom = place(box.corner.y + box.size.y, small.height);
  const auto dot = [&](int x, int y) {
    constexpr std::array kOutline = {1.0f, 0.35f, 0.0f};
    for (int c = 0; c < 3; ++c) small.at(x, y, c) = kOutline[static_cast<std::size_t>(c)];
  };
  for (int x = left; x <= right; ++x) {
    dot(x, top);
    dot(x, bottom);
  }
  for (int y = top; y <= bottom; ++y) {
    dot(left, y);
    dot(right, y);
  }
  return small;
}

bool isCalled(const std::string& view, const std::string& wanted) {
  const std::filesystem::path path(view);
  return wanted == view || wanted == path.filename().string() || wanted == path.stem().string();
}

}  // namespace

CropWish parseCropWish(const std::string& text, const std::string& what) {
  const std::size_t at = text.find('@');
  std::array<int, 4> numbers{};
  const bool sound = parseList<int>(std::string_view(text).substr(0, at), numbers) && numbers[0] >= 0 &&
                     numbers[1] >= 0 && numbers[2] > 0 && numbers[3] > 0 &&
                     (at == std::string::npos || at + 1 < text.size());
  if (!sound) refuseValue(what, text, "x,y,w,h or x,y,w,h@VIEW in pixels");
  return {{{numbers[0], numbers[1]}, {numbers[2], numbers[3]}}, at == std::string::npos ? "" : text.substr(at + 1)};
}

bool grants(const std::string& view, glm::ivec2 size, const CropWish& wish) {
  const auto& [box, name] = wish;
  if (box.size.x > size.x || box.size.y > size.y) return false;
  if (box.corner.x > size.x - box.size.x || box.corner.y > size.y - box.size.y) return false;
  return name.empty() || isCalled(view, name);
}

void refuseWish(const CropWish& wish) {
  const auto& [box, name] = wish;
  const std::string numbers = formatted("%d,%d,%d,%d", box.corner.x, box.corner.y, box.size.x, box.size.y);
  throw Error(ErrorKind::usage, "--crop " + numbers + (name.empty() ? "" : "@" + name), "no view holds it");
}

Image differenceMap(std::span<const Image> errors) {
  TG_ASSERT(!errors.empty(), "there is a model");
  Image map = errors.front();
  if (errors.size() == 1) return map;
  for (std::size_t i = 0; i < map.data.size(); ++i) {
    float most = 0;
    for (const Image& other : errors.subspan(1))
      most = std::max(most, std::abs(other.data[i] - errors.front().data[i]));
    map.data[i] = most;
  }
  return map;
}

PixelBox largestBox(const Image& map, glm::ivec2 size) {
  TG_ASSERT(size.x > 0 && size.y > 0 && size.x <= map.width && size.y <= map.height, "the box fits into the map");
  return largestBox(BoxSums(map), {map.width, map.height}, size);
}

glm::ivec2 cropSize(const Image& picture) {
  const int shorter = std::min(picture.width, picture.height);
  return glm::ivec2(std::min(std::max(shorter / 4, kSmallestCrop), shorter));
}

void CropChooser::see(const DrawnView& view) {
  const Image map = differenceMap(view.errors);
  const BoxSums sums(map);
  const auto cropOf = [&](const PixelBox& box, bool asked, double difference) {
    Crop crop{view.name, box, asked, difference, cut(view.photograph, box), {}, {}, overviewOf(view.photograph, box)};
    for (const Image& picture : view.pictures) crop.pictures.push_back(cut(picture, box));
    for (const Image& error : view.errors) crop.errors.push_back(cut(error, box));
    return crop;
  };
  for (std::size_t i = 0; i < wishes_.size(); ++i) {
    if (!grants(view.name, {map.width, map.height}, wishes_[i])) continue;
    const PixelBox& box = wishes_[i].box;
    const double difference = sums.mean(box);
    if (!asked_[i] || difference > asked_[i]->difference) asked_[i] = cropOf(box, true, difference);
  }
  if (most_ == 0) return;
  const PixelBox box = largestBox(sums, {map.width, map.height}, cropSize(map));
  const double difference = sums.mean(box);
  const bool full = found_.size() == static_cast<std::size_t>(most_);
  if (full && found_.back().difference >= difference) return;
  if (full) found_.pop_back();
  const auto place =
      std::find_if(found_.begin(), found_.end(), [&](const Crop& crop) { return crop.difference < difference; });
  found_.insert(place, cropOf(box, false, difference));
}

std::vector<Crop> CropChooser::finish() {
  std::vector<Crop> crops;
  for (std::optional<Crop>& crop : asked_) {
    if (crop) crops.push_back(std::move(*crop));
  }
  std::move(found_.begin(), found_.end(), std::back_inserter(crops));
  return crops;
}

}  // namespace tg
