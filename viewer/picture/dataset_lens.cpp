// SPDX-License-Identifier: Apache-2.0
// Distortion coefficients in the files of cameras.
#include "viewer/picture/dataset_lens.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <locale>
#include <nlohmann/json.hpp>
#include <span>
#include <sstream>
#include <string_view>
#include <vector>

#include "core/bundle/colmap_camera.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kMaxDescriptionBytes = std::uint64_t{256} << 20;

bool bends(const ColmapCameraModel& model, std::span<const double> parameters) {
  if (model.fisheye || !model.parameters) return true;
  const std::size_t of_pinhole = std::string_view(model.parameters).find_last_of("fxyc") + 1;
  const std::span<const double> lens = parameters.subspan(std::min(of_pinhole, parameters.size()));
  return std::ranges::any_of(lens, [](double coefficient) { return coefficient != 0; });
}

// cameras.bin: a count; of each camera id, model, width, height, parameters.
bool anyBendsBinary(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t kCount = 8, kModel = 4, kHead = 24;
  std::size_t at = kCount;
  while (at + kHead <= bytes.size()) {
    std::int32_t id = 0;
    std::memcpy(&id, bytes.data() + at + kModel, sizeof id);
    if (id < 0 || id >= static_cast<std::int32_t>(kColmapCameraModels.size())) return false;
    const ColmapCameraModel& model = kColmapCameraModels[static_cast<std::size_t>(id)];
    std::vector<double> parameters(model.count);
    const std::size_t size = parameters.size() * sizeof(double);
    at += kHead;
    if (size > bytes.size() - at) return false;
    std::memcpy(parameters.data(), bytes.data() + at, size);
    at += size;
    if (bends(model, parameters)) return true;
  }
  return false;
}

bool anyBendsText(std::span<const std::uint8_t> bytes) {
  std::istringstream lines(std::string(bytes.begin(), bytes.end()));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    words.imbue(std::locale::classic());
    std::string id, name;
    double width = 0, height = 0;
    if (!(words >> id >> name >> width >> height) || id.starts_with('#')) continue;
    std::vector<double> parameters;
    for (double value = 0; words >> value;) parameters.push_back(value);
    const auto model = std::ranges::find(kColmapCameraModels, name, &ColmapCameraModel::name);
    if (model != kColmapCameraModels.end() && bends(*model, parameters)) return true;
  }
  return false;
}

// As training: beside the files of text, and without its images.bin.
bool isStray(const fs::path& file) {
  const fs::path model = file.parent_path();
  return file.extension() == ".bin" && !isFile(model / "images.bin") && isFile(model / "cameras.txt");
}

// A key of a frame, or else of all of them; null where neither has it.
nlohmann::json said(const nlohmann::json& top, const nlohmann::json& frame, const char* key) {
  for (const nlohmann::json* object : {&frame, &top}) {
    const auto found = object->find(key);
    if (found != object->end() && !found->is_null()) return *found;
  }
  return nullptr;
}

bool anyBendsJson(std::span<const std::uint8_t> bytes, const std::string& path) {
  const nlohmann::json top = parseJson(bytes, path);
  const nlohmann::json frames = top.is_object() ? top.value("frames", nlohmann::json()) : nlohmann::json();
  if (!frames.is_array()) return false;
  return std::ranges::any_of(frames, [&](const nlohmann::json& frame) {
    if (!frame.is_object()) return false;
    const nlohmann::json model = said(top, frame, "camera_model");
    if (model.is_null() ? said(top, frame, "is_fisheye") == true : model == "OPENCV_FISHEYE") return true;
    return std::ranges::any_of(std::array{"k1", "k2", "k3", "k4", "p1", "p2"}, [&](const char* key) {
      const nlohmann::json coefficient = said(top, frame, key);
      return coefficient.is_number() && coefficient != 0;
    });
  });
}

}  // namespace

bool hasLens(const fs::path& dataset) {
  for (const char* name :
       {"sparse/0/cameras.bin", "sparse/0/cameras.txt", "sparse/cameras.bin", "sparse/cameras.txt",
        "transforms_train.json", "transforms.json", "colmap/sparse/0/cameras.bin", "colmap/sparse/0/cameras.txt"}) {
    const fs::path file = dataset / name;
    if (!isFile(file) || isStray(file)) continue;
    try {
      const std::vector<std::uint8_t> bytes = readFile(file, kMaxDescriptionBytes);
      if (file.extension() == ".bin") return anyBendsBinary(bytes);
      if (file.extension() == ".txt") return anyBendsText(bytes);
      return anyBendsJson(bytes, file.string());
    } catch (const Error&) {
      return false;
    }
  }
  return false;
}

}  // namespace tg
