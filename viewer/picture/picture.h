// SPDX-License-Identifier: Apache-2.0
// What a picture is drawn from, and what comes of it.
#pragma once
#include <chrono>
#include <filesystem>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/renderer.h"
#include "viewer/picture/device.h"
#include "viewer/view/compare.h"

namespace tg {

// What a picture is compared with: a model or a photograph.
struct OtherPicture {
  std::shared_ptr<const GaussianModel> model;  // null: the photograph
  std::optional<CropBox> crop;                 // of the model, instead of the settings' own
  std::filesystem::path photograph;
  Camera taken;    // the photograph's
  Comparison how;  // what comes of both: the difference or the FLIP map where it is one of these
};

struct PictureRequest {
  std::shared_ptr<const GaussianModel> model;  // not null
  Camera camera;                               // the picture's size is the camera's
  RenderSettings settings;
  Output output = Output::final;
  std::optional<OtherPicture> other;  // seen by the same camera
  bool in_run = false;                // of a benchmark or recording: a device that failed is not tried again for it
};

// Whether both yield the same picture.
bool same(const PictureRequest& a, const PictureRequest& b);

inline double milliseconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

struct Picture {
  PictureRequest request;
  std::shared_ptr<const PictureImage> image;
  std::shared_ptr<const PictureImage> other, error;  // where asked for; error: what OtherPicture::how says
  std::optional<ValueScale> scale;                   // of an output of kNumberOutputs
  std::shared_ptr<const PicturePair> pair;           // both on the host as shown, where there is another one
  std::shared_ptr<const Image> photograph;           // as its file has it, where the other one is one
  std::string problem;                               // why `other` is not there although asked for; "" = it is
  std::vector<PassTime> passes;
  double milliseconds = 0;  // wall time of all of it
  std::string device;       // what drew it
  std::string backend;      // as --backend has it
};

// Whether PSNR and the like say something of it.
bool hasFigures(const Picture& picture);

}  // namespace tg
