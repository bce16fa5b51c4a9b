// SPDX-License-Identifier: Apache-2.0
// Draws pictures for the window: by Vulkan, or on the CPU with the result handed to the device. No threads here.
#pragma once
#include <list>
#include <memory>

#include "viewer/picture.h"

namespace tg {

class PictureMaker {
 public:
  // `device` must outlive this and every picture. cpu: the CPU renderer, whose pictures are uploaded.
  PictureMaker(VulkanDevice& device, bool cpu);
  ~PictureMaker();

  // Throws Error(device), std::bad_alloc.
  Picture draw(const PictureRequest& request);

 private:
  struct Loaded;
  Loaded& loaded(const std::shared_ptr<const GaussianModel>& model);
  std::shared_ptr<PictureImage> freeImage(glm::ivec2 size);
  void drawVulkan(Loaded& loaded, const PictureRequest& request, const PictureImage& target);
  void drawCpu(Loaded& loaded, const PictureRequest& request, const PictureImage& target);

  VulkanDevice& device_;
  const bool cpu_;
  Commands commands_;
  Buffer staging_;
  std::list<Loaded> loaded_;                           // the last one used first
  std::vector<std::shared_ptr<PictureImage>> images_;  // those that nobody else holds are free
};

}  // namespace tg
