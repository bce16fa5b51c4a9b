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

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kMaxDescriptionBytes = std::uint64_t{256} << 20;

// COLMAP's camera models by id: how many parameters each has, and how many of them a pinhole has, too.
struct ColmapModel {
  std::string_view name;
  std::size_t count, of_pinhole;
  bool fisheye = false;
};
constexpr std::array<ColmapModel, 12> kColmapModels = {{{"SIMPLE_PINHOLE", 3, 3},
                                                        {"PINHOLE", 4, 4},
                                                        {"SIMPLE_RADIAL", 4, 3},
                                                        {"RADIAL", 5, 3},
                                                        {"OPENCV", 8, 4},
                                                        {"OPENCV_FISHEYE", 8, 4, true},
                                                        {"FULL_OPENCV", 12, 4},
                                                        {"FOV", 5, 4},
                                                        {"SIMPLE_RADIAL_FISHEYE", 4, 3, true},
                                                        {"RADIAL_FISHEYE", 5, 3, true},
                                                        {"THIN_PRISM_FISHEYE", 12, 4, true},
                                                        {"RAD_TAN_THIN_PRISM_FISHEYE", 16, 4, true}}};

bool bends(const ColmapModel& model, std::span<const double> parameters) {
  if (model.fisheye) return true;
  const std::span<const double> lens = parameters.subspan(std::min(model.of_pinhole, parameters.size()));
  return std::ranges::any_of(lens, [](double coefficient) { return coefficient != 0; });
}

// cameras.bin: a count; of each camera id, model, width, height, parameters.
bool anyBendsBinary(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t kCount = 8, kModel = 4, kHead = 24;
  std::size_t at = kCount;
  while (at + kHead <= bytes.size()) {
    std::int32_t id = 0;
    std::memcpy(&id, bytes.data() + at + kModel, sizeof id);
    if (id < 0 || id >= static_cast<std::int32_t>(kColmapModels.size())) return false;
    const ColmapModel& model = kColmapModels[static_cast<std::size_t>(id)];
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
    const auto model = std::ranges::find(kColmapModels, name, &ColmapModel::name);
    if (model != kColmapModels.end() && bends(*model, parameters)) return true;
  }
  return false;
}

// The intrinsics at the top of transforms.json, or a frame's own.
bool anyBends(const nlohmann::json& intrinsics) {
  if (!intrinsics.is_object()) return false;
  const auto isFisheye = [&](const char* key) { return intrinsics.contains(key) && intrinsics[key] == true; };
  if (isFisheye("is_fisheye") || intrinsics.value("camera_model", nlohmann::json()) == "OPENCV_FISHEYE") return true;
  return std::ranges::any_of(std::array{"k1", "k2", "k3", "k4", "p1", "p2"}, [&](const char* key) {
    return intrinsics.contains(key) && intrinsics[key].is_number() && intrinsics[key] != 0;
  });
}

bool anyBendsJson(std::span<const std::uint8_t> bytes, const std::string& path) {
  const nlohmann::json transforms = parseJson(bytes, path);
  if (anyBends(transforms)) return true;
  const nlohmann::json frames =
      transforms.is_object() ? transforms.value("frames", nlohmann::json()) : nlohmann::json();
  return std::any_of(frames.begin(), frames.end(), anyBends);
}

}  // namespace

bool hasLens(const fs::path& dataset) {
  for (const char* name : {"sparse/0/cameras.bin", "sparse/0/cameras.txt", "sparse/cameras.bin", "sparse/cameras.txt",
                           "transforms.json", "transforms_train.json"}) {
    const fs::path file = dataset / name;
    std::error_code ignored;
    if (!fs::is_regular_file(file, ignored)) continue;
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
