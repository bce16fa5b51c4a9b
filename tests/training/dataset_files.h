// SPDX-License-Identifier: Apache-2.0
// Tiny data sets on disk, sound and broken.
#pragma once
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/image/image.h"
#include "core/system/error.h"
#include "training/data/dataset.h"

namespace tg::test {

namespace fs = std::filesystem;
using Json = nlohmann::json;

inline void writeText(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

// Left half red, right half green; alpha (if any) half.
inline void writePicture(const fs::path& path, int width, int height, int channels = 3) {
  fs::create_directories(path.parent_path());
  tg::Image image(width, height, channels);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.at(x, y, x < width / 2 ? 0 : 1) = 1.0f;
      if (channels == 4) image.at(x, y, 3) = 128.0f / 255.0f;
    }
  }
  tg::writeImage(path, image);
}

inline const Json kIdentity = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};

inline Json frame(const std::string& file, const Json& matrix = kIdentity) {
  return {{"file_path", file}, {"transform_matrix", matrix}};
}

// A vector, since clang takes Json{frame} for a copy of the frame.
inline Json pinhole(std::vector<Json> frames) {
  return {
      {"fl_x", 20.0}, {"fl_y", 21.0}, {"cx", 7.5}, {"cy", 6.5}, {"w", 16}, {"h", 12}, {"frames", std::move(frames)}};
}

// The message of the error that `action` throws, with its exit code in front.
template <typename Action>
std::string refusal(Action action) {
  try {
    action();
  } catch (const tg::Error& error) {
    return std::to_string(tg::exitCode(error)) + " " + error.what();
  }
  return "accepted";
}
inline std::string refusal(const fs::path& folder, const DatasetOptions& options = {}) {
  return refusal([&] { loadDataset(folder, options); });
}

// A COLMAP model of ten images on one PINHOLE camera, in either encoding.
struct ColmapText {
  std::string cameras = "# comment\n1 PINHOLE 16 12 20 21 7.5 6.5\n";
  std::string images;
  std::string points = "# comment\n1 0.5 -1 4 255 0 51 0.1 1 0\n7 1 2 3 0 255 0 0.1\n";
  ColmapText() {
    for (int i = 0; i < 10; ++i) {
      // A quarter turn about y, not normalised; even images have no 2D points, hence an empty line.
      images += std::to_string(i + 1) + " 2 0 2 0 " + std::to_string(i) + " 0 5 1 image" + std::to_string(9 - i) +
                ".png\n" + (i % 2 ? "3.5 4.5 1 6 7 -1\n" : "\n");
    }
  }
  void write(const fs::path& folder, const std::string& model = "sparse/0") const {
    writeText(folder / model / "cameras.txt", cameras);
    writeText(folder / model / "images.txt", images);
    writeText(folder / model / "points3D.txt", points);
    for (int i = 0; i < 10; ++i) writePicture(folder / "images" / ("image" + std::to_string(i) + ".png"), 16, 12);
  }
};

class Bytes {
 public:
  template <typename T>
  Bytes& add(T value) {
    data_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  Bytes& text(const std::string& value) {
    data_.append(value.c_str(), value.size() + 1);
    return *this;
  }
  const std::string& data() const { return data_; }

 private:
  std::string data_;
};

struct ColmapBinary {
  std::string cameras, images, points;
  explicit ColmapBinary(std::int32_t model = 1) {
    Bytes c;
    c.add<std::uint64_t>(1).add<std::uint32_t>(1).add(model).add<std::uint64_t>(16).add<std::uint64_t>(12);
    for (double value : {20.0, 21.0, 7.5, 6.5}) c.add(value);
    cameras = c.data();
    Bytes i;
    i.add<std::uint64_t>(10);
    for (std::uint32_t n = 0; n < 10; ++n) {
      i.add(n + 1);
      for (double value : {2.0, 0.0, 2.0, 0.0, double(n), 0.0, 5.0}) i.add(value);
      i.add<std::uint32_t>(1).text("image" + std::to_string(9 - n) + ".png").add<std::uint64_t>(n % 2);
      if (n % 2) i.add(3.5).add(4.5).add<std::int64_t>(1);
    }
    images = i.data();
    Bytes p;
    p.add<std::uint64_t>(2);
    p.add<std::uint64_t>(1).add(0.5).add(-1.0).add(4.0).add<std::uint8_t>(255).add<std::uint8_t>(0).add<std::uint8_t>(
        51);
    p.add(0.1).add<std::uint64_t>(1).add<std::int32_t>(1).add<std::int32_t>(0);
    p.add<std::uint64_t>(7).add(1.0).add(2.0).add(3.0).add<std::uint8_t>(0).add<std::uint8_t>(255).add<std::uint8_t>(0);
    p.add(0.1).add<std::uint64_t>(0);
    points = p.data();
  }
  void write(const fs::path& folder) const {
    writeText(folder / "sparse/0/cameras.bin", cameras);
    writeText(folder / "sparse/0/images.bin", images);
    writeText(folder / "sparse/0/points3D.bin", points);
    for (int i = 0; i < 10; ++i) writePicture(folder / "images" / ("image" + std::to_string(i) + ".png"), 16, 12);
  }
};

}  // namespace tg::test
