// SPDX-License-Identifier: Apache-2.0
// Any bytes are a file of a data set or an Error: transforms.json, and each file of a COLMAP model beside sound ones,
// in both encodings. What was read has cameras whose lenses can be taken out, or not. The first byte chooses the file.
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <utility>

#include "core/system/error.h"
#include "training/data/dataset.h"

namespace {

namespace fs = std::filesystem;

void write(const fs::path& path, std::span<const std::uint8_t> bytes) {
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
}
void write(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

struct Folders {
  const fs::path root = fs::temp_directory_path() / ("fuzz_read_dataset_" + std::to_string(::getpid()));
  const fs::path text = root / "text", binary = root / "binary", json = root / "json";
  // Sound files around the one that is fuzzed. Binary ones are empty: no cameras, images and points.
  const std::pair<fs::path, std::string> sound[6] = {
      {text / "sparse/cameras.txt", "1 OPENCV 64 48 60 60 32 24 0.1 0.01 0.001 0.001\n"},
      {text / "sparse/images.txt", "1 1 0 0 0 0 0 0 1 a.png\n\n"},
      {text / "sparse/points3D.txt", "1 0 0 1 255 0 0 0\n"},
      {binary / "sparse/cameras.bin", std::string(8, '\0')},
      {binary / "sparse/images.bin", std::string(8, '\0')},
      {binary / "sparse/points3D.bin", std::string(8, '\0')}};
  Folders() {
    for (const fs::path& folder : {text / "sparse", binary / "sparse", json}) fs::create_directories(folder);
    for (const auto& [path, content] : sound) write(path, content);
  }
  ~Folders() {
    std::error_code ignored;
    fs::remove_all(root, ignored);
  }
};

void undistort(const tg::DatasetIndex& index) {
  constexpr std::size_t kMostPictures = 2;  // of a file of many: they take the time
  for (std::size_t k = 0; k < std::min(kMostPictures, index.entries.size()); ++k) {
    const tg::DatasetIndex::Entry& entry = index.entries[k];
    tg::Camera camera = entry.camera;
    camera.size = {64, 48};
    if (!(camera.focal.x > 1e-3 && camera.focal.x < 1e9 && camera.focal.y > 1e-3 && camera.focal.y < 1e9)) continue;
    try {
      const tg::Undistortion undistortion(entry.lens, camera, "a.png");
      const auto result = undistortion.apply(tg::Image(64, 48, 3, 0.5f), {});
      for (const float value : result.image.data) {
        if (!(value >= 0 && value <= 1)) std::abort();
      }
    } catch (const tg::Error&) {
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Folders folders;
  if (size == 0) return 0;
  const unsigned choice = data[0];
  const std::span bytes(data + 1, size - 1);
  try {
    switch (choice) {
      case 0:
      case 1:
      case 2:
      case 3:
      case 4:
      case 5:
        write(folders.sound[choice].first, bytes);
        undistort(tg::readColmap(choice < 3 ? folders.text : folders.binary));
        break;
      case 6:
        write(folders.json / "transforms.json", bytes);
        undistort(tg::readTransforms(folders.json));
        break;
      default:
        break;
    }
  } catch (const tg::Error&) {
  }
  if (choice < std::size(folders.sound)) write(folders.sound[choice].first, folders.sound[choice].second);
  return 0;
}
