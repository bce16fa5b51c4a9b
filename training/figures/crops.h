// SPDX-License-Identifier: Apache-2.0
// Which parts of which views show best how models differ.
#pragma once
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/image/image.h"

namespace tg {

struct PixelBox {
  glm::ivec2 corner{0}, size{0};  // [px]
  bool operator==(const PixelBox&) const = default;
};

// What a user asks to see: a box of one view, or of the view where it shows most.
struct CropWish {
  PixelBox box;
  std::string view;  // its name, with or without folders and extension; empty: any
};
// "x,y,w,h" or "x,y,w,h@VIEW". Throws Error(usage): `what: expected X, found "text"`.
CropWish parseCropWish(const std::string& text, const std::string& what);

// Whether a view of that name and size [px] can show it.
bool grants(const std::string& view, glm::ivec2 size, const CropWish& wish);
// "--crop 1,2,3,4@VIEW: no view holds it"
[[noreturn]] void refuseWish(const CropWish& wish);

// A view that all models have drawn, and where they err.
struct DrawnView {
  const std::string& name;
  const Image& photograph;
  std::span<const Image> pictures;  // one a model
  std::span<const Image> errors;    // FLIP maps
};

struct Crop {
  std::string view;
  PixelBox box;
  bool asked = false;                   // not found by the program
  double difference = 0;                // mean over the box: see differenceMap
  Image photograph;                     // of the box alone, as all that follow
  std::vector<Image> pictures, errors;  // one a model
  Image overview;                       // the whole photograph, smaller, with the box drawn in
};

// How far apart the models' errors are at every pixel, the first model against the one that differs most from it; of
// one model its error.
Image differenceMap(std::span<const Image> errors);
// The box of that size with the largest mean, the first from the top left among equals. `size` fits into the map.
PixelBox largestBox(const Image& map, glm::ivec2 size);
// A quarter of the shorter side, square, at least 16 px where the picture has them.
glm::ivec2 cropSize(const Image& picture);

// Sees one view after the other and keeps what a report shows of them.
class CropChooser {
 public:
  CropChooser(std::vector<CropWish> wishes, int most)
      : wishes_(std::move(wishes)), asked_(wishes_.size()), most_(most) {}
  void see(const DrawnView& view);
  // Those asked for in their order, without those that no view could show; then the others, the largest difference
  // first.
  std::vector<Crop> finish();

 private:
  std::vector<CropWish> wishes_;
  std::vector<std::optional<Crop>> asked_;  // one a wish
  std::vector<Crop> found_;                 // largest difference first
  int most_;
};

}  // namespace tg
