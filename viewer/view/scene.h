// SPDX-License-Identifier: Apache-2.0
// A model with what the viewer knows of it.
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/file/identity.h"
#include "core/model/model.h"
#include "viewer/view/camera_controller.h"

namespace tg {

struct Scene {
  std::filesystem::path path;
  std::string format;                          // the file's, by what is in it (Bundle::format); "" = not known
  std::optional<FileIdentity> file;            // what was read, or written last; none: not known
  std::shared_ptr<const GaussianModel> model;  // null: none yet
  bool partial = false;                        // a part of the model, to look at while the rest is read
  // Gaussians of all finest levels of a scene that is streamed: `model` is what is drawn of it now. 0: not streamed.
  std::size_t streamed_from = 0;
  std::vector<Camera> cameras;
  int camera_lists = 0;  // how often `cameras` have been replaced by others
  std::size_t gaussians = 0;
  std::size_t textured = 0;  // Gaussians with a texture rectangle
  std::size_t texels = 0;
  int sh_degree = 0;
  TextureMode texture_mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  TextureOutside outside = TextureOutside::base;
  glm::vec3 background{0.0f};
  bool knows_background = true;  // false: a file does not say (Bundle::knows_background)
  std::vector<std::string> warnings;
  glm::dvec3 up{0, -1, 0};
  SceneBounds bounds;
  std::string training_json;  // of its bundle, to be saved with it; "" = none
  std::string training;       // how far its training is: "plain 1200 / 7000, 24.31 dB"; "" = not said
  std::vector<Camera> views;  // its file's named ones, to be saved with it
};

// What `training` ends with where the model has been edited since.
inline constexpr const char* kBeforeEdits = " before edits";

// Whether its model is all there is of it: what is edited and saved.
inline bool isWhole(const Scene& scene) { return scene.model && !scene.partial && scene.streamed_from == 0; }
// Counts and bounds of its model, which is there.
void measure(Scene& scene);

}  // namespace tg
