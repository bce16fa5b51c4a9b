// SPDX-License-Identifier: Apache-2.0
// What stands behind the public classes, for the library's own sources.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <type_traits>
#include <utility>

#include "core/bundle/bundle.h"
#include "core/system/error.h"
#include "core/system/shortened.h"
#include "render/settings.h"
#include "textured_gaussians/dataset.h"
#include "textured_gaussians/error.h"
#include "textured_gaussians/model.h"
#include "training/data/dataset.h"

namespace textured_gaussians {

struct Model::Parts {
  tg::Bundle bundle;
};

struct Dataset::Parts {
  tg::Dataset dataset;
  bool chose_background = false;  // whoever loaded it
};

struct Access {
  static std::shared_ptr<const tg::Bundle> bundle(const Model& model) { return {model.parts_, &model.parts_->bundle}; }
  static std::shared_ptr<const tg::Dataset> dataset(const Dataset& dataset) {
    return {dataset.parts_, &dataset.parts_->dataset};
  }
  static bool choseBackground(const Dataset& dataset) { return dataset.parts_->chose_background; }
  static Model model(tg::Bundle bundle);
};

// Calls `body`; what it throws leaves as the public Error.
template <typename Body>
decltype(auto) guarded(const Body& body) {
  try {
    return body();
  } catch (const tg::Error& error) {
    throw Error(static_cast<ErrorKind>(error.kind), error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    throw Error(ErrorKind::cannotRead, tg::printable(error.what()));
  } catch (const std::system_error& error) {
    const bool again = error.code() == std::errc::resource_unavailable_try_again;  // of a thread, as in the programs
    throw Error(ErrorKind::device, std::string(again ? "no thread can be started: " : "") + error.what());
  }
}

// Throws tg::Error(usage), of `what`, for a path that no file has, and for one of which the system sees a part.
inline void requirePath(const std::filesystem::path& path, const std::string& what = "path") {
  if (path.empty()) throw tg::Error(tg::ErrorKind::usage, what, "an empty file name");
  constexpr std::size_t longest = 4095;  // that the system takes
  if (path.native().size() > longest) {
    throw tg::Error(tg::ErrorKind::usage, what,
                    "a name of " + std::to_string(path.native().size()) + " bytes (expected at most " +
                        std::to_string(longest) + ")");
  }
  if (path.native().find('\0') != std::string::npos) {
    throw tg::Error(tg::ErrorKind::usage, what, "a name holds a NUL byte");
  }
}

// Settings and edits may be named as messages name them, by the programs' flags.
inline std::string withoutDashes(const std::string& name) { return name.starts_with("--") ? name.substr(2) : name; }
// What a message calls one: by its name, or what was given in quotes where that is none.
inline std::string calledBy(const std::string& given) {
  const std::string name = tg::shortened(withoutDashes(given));
  return name.empty() ? '"' + given + '"' : name;
}

// The first throws Error(usage) for a camera that is none.
tg::Camera cameraOf(const Camera& camera);
Camera cameraOf(const tg::Camera& camera);

template <typename T, std::size_t kCount>
bool allFinite(const std::array<T, kCount>& numbers) {
  return std::ranges::all_of(numbers, [](T number) { return std::isfinite(number); });
}

inline bool isChannels(int channels) { return channels == 1 || channels == 3 || channels == 4; }
// Of sides above 0: how many numbers a picture has.
inline std::size_t lengthOf(int width, int height, int channels) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * static_cast<std::size_t>(channels);
}

inline glm::vec3 colorOf(const std::array<float, 3>& color) { return {color[0], color[1], color[2]}; }
// Of a background that is asked for. Throws Error(usage).
inline glm::vec3 finiteColorOf(const std::array<float, 3>& color) {
  if (!allFinite(color)) throw tg::Error(tg::ErrorKind::usage, "background", "is not finite");
  return colorOf(color);
}
inline std::array<float, 3> colorOf(const glm::vec3& color) { return {color.x, color.y, color.z}; }

// The enumerations have the same values. Throws tg::Error(usage) for a number that is none of them, from 0 to `last`.
template <typename To, typename From>
To enumOf(From value, From last, const char* what) {
  const auto number = static_cast<std::underlying_type_t<From>>(value);
  const auto most = static_cast<std::underlying_type_t<From>>(last);
  if (number < 0 || number > most) {
    throw tg::Error(tg::ErrorKind::usage, what,
                    "no such one (expected 0 to " + std::to_string(most) + ", found " + std::to_string(number) + ")");
  }
  return static_cast<To>(value);
}
inline tg::TextureMode modeOf(TextureMode mode) {
  return enumOf<tg::TextureMode>(mode, TextureMode::rgba, "texture mode");
}

}  // namespace textured_gaussians
