// SPDX-License-Identifier: Apache-2.0
// A photograph as its camera left it, turned upright, with what its EXIF says.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "core/image/image.h"
#include "training/photos/scan.h"

namespace tg {

struct Place {
  double latitude = 0;   // [degrees], north positive
  double longitude = 0;  // [degrees], east positive
};

struct ExifFacts {
  int orientation = 1;  // 1 to 8, as TIFF numbers them
  std::string camera;   // make and model; "" not said
  double focal_per_diagonal = 0;  // of the lens, over the diagonal of the picture that the camera took; 0: not known
  bool focal_refused = false;     // what is said is of no lens, or of the picture before it was cropped
  std::optional<Place> place;
};

// From an EXIF block, with or without "Exif\0\0" before it. `width` and `height` are the picture's [px], of either
// orientation. What is broken says nothing.
ExifFacts readExif(std::span<const std::uint8_t> block, int width, int height);

struct TakenPhotograph {
  Image image;  // 1, 3 or 4 channels, upright
  ExifFacts facts;
  // JPEG, or PNG of 8 bits, that nothing had to be done to: it is upright, and COLMAP may read its EXIF; else `none`.
  PictureFormat as_stored = PictureFormat::none;
};

// Throws Error(cannotRead / badData).
TakenPhotograph readPhotograph(const std::filesystem::path& file);
TakenPhotograph decodePhotograph(std::span<const std::uint8_t> bytes, const std::string& path);

// The picture, turned or mirrored as `orientation` asks for; 1 and what is no orientation leave it.
Image turned(Image image, int orientation);

// The mean over the area of each new pixel; neither side grows.
Image reducedTo(Image image, int width, int height);

}  // namespace tg
