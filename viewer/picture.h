// SPDX-License-Identifier: Apache-2.0
// What a picture is drawn from, and what comes of it.
#pragma once
#include <vulkan/vulkan.h>
#include <glm/glm.hpp>
#include <memory>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/model.h"
#include "render/renderer.h"
#include "render/vulkan/buffer.h"

namespace tg {

struct PictureRequest {
  std::shared_ptr<const GaussianModel> model;  // not null
  Camera camera;                               // the picture's size is the camera's
  RenderSettings settings;
  Output output = Output::final;
};

// Whether both yield the same picture.
bool same(const PictureRequest& a, const PictureRequest& b);

// RGBA8, layout GENERAL, all writes finished.
struct PictureImage {
  PictureImage(const VulkanDevice& device, glm::ivec2 size_)
      : storage(device, static_cast<std::uint32_t>(size_.x), static_cast<std::uint32_t>(size_.y)), size(size_) {}
  StorageImage storage;
  glm::ivec2 size;  // [px]
};

struct Picture {
  PictureRequest request;
  std::shared_ptr<const PictureImage> image;
  std::vector<PassTime> passes;
  double milliseconds = 0;  // wall time of all of it
  std::string device;       // what drew it
};

}  // namespace tg
