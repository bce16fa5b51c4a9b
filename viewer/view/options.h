// SPDX-License-Identifier: Apache-2.0
// What the command line asks for; flags.cpp reads it.
#pragma once
#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/system/names.h"
#include "render/renderer.h"
#include "viewer/view/camera_controller.h"
#include "viewer/view/compare.h"

namespace tg {

// automatic: Vulkan on a GPU, else OpenGL on a GPU, else the CPU renderer: where these run on the CPU themselves, they
// are slower.
enum class Backend { automatic, vulkan, opengl, cpu };
constexpr auto namesOf(Backend) { return enumNames("auto", "vulkan", "opengl", "cpu"); }

// Of a scene with levels of detail, in Gaussians. docs/lod.md has what they cost.
constexpr std::size_t kUsualSplatBudget = 1'000'000;
constexpr std::size_t kLeastSplatBudget = 1, kMostSplatBudget = 100'000'000;

// What the command line asks for, in a window or to a file.
struct ViewOptions {
  std::filesystem::path model;                     // empty: a window that waits for one
  std::vector<std::filesystem::path> more_models;  // to open beside it in a window
  std::filesystem::path compare;                   // another model, to compare with
  std::filesystem::path photographs;               // a folder of the data set's, to compare with
  CompareMode compare_mode = CompareMode::side;
  float difference_gain = 1;     // --gain where the comparison is a difference; else it is of the settings
  bool legend = false;           // drawn into pictures
  std::filesystem::path out;     // .png, .jpg: a picture; .exr: the numbers. Empty: a window
  std::filesystem::path script;  // drives the window; may be empty
  bool follow = false;           // the model is a file or a run folder that changes
  std::string serve;             // [ADDRESS:]PORT: a page for browsers instead of a window; "": none
  std::string serve_token;       // what the page's address must bring
  std::string camera;            // "": the model's first test camera, else the whole model in view
  Output show = Output::final;
  RenderSettings settings;                  // all but outputs and background
  std::optional<glm::ivec2> size;           // default: the camera's
  std::optional<glm::vec3> background;      // default: the model's
  std::optional<std::size_t> splat_budget;  // Gaussians drawn of a streamed scene, at most; default: kUsualSplatBudget
  Backend backend = Backend::automatic;
  std::string device;  // a number of --list-devices, or part of a device's name
  bool validation = false;
  std::optional<int> frames_in_flight;              // 1 or 2; default: 2 where a Vulkan device has two queues
  bool quiet = false;                               // without a window: errors alone are said
  bool timings = false;                             // say how long it took from the start to the first pictures
  std::filesystem::path session;                    // keeps the window's state between runs; empty: nothing is kept
  bool show_given = false, textures_given = false;  // else the session's, where there is one
  UpAxis up = UpAxis::cameras;
  bool up_given = false;

  std::filesystem::path record;     // --output: a video, pictures; empty: none
  std::filesystem::path path;       // a camera path; may be empty
  int turntable = 0;                // frames of a turn; 0: none
  std::optional<double> elevation;  // [rad] of the turntable above the horizon, looking at the model's centre
  std::optional<double> radius;     // [world units] of the turntable
  double fps = 30;
  std::optional<glm::ivec2> inspect;  // the pixel to list the splats of
  bool benchmark = false;             // time the path's frames
};

}  // namespace tg
