// SPDX-License-Identifier: Apache-2.0
// Draws pictures for the window: by Vulkan, or on the CPU with the result handed to the device. No threads here.
#pragma once
#include <list>
#include <memory>

#include "render/vulkan/vulkan_renderer.h"
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
  // `pixels`, which may be null, receives the picture on the host.
  void drawModel(Loaded& loaded, const PictureRequest& request, const PictureImage& target, Image* pixels);
  void drawVulkan(Loaded& loaded, const PictureRequest& request, const PictureImage& target);
  void drawOther(const PictureRequest& request, Picture& picture, PicturePair& pair);
  void upload(const Image& picture, const PictureImage& target);
  Image download(const PictureImage& source);
  std::byte* staging(glm::ivec2 size);

  VulkanDevice& device_;
  const bool cpu_;
  Commands commands_;
  Buffer staging_;
  std::filesystem::path photograph_path_;  // of the photograph read last
  Image photograph_;
  std::list<Loaded> loaded_;                           // the last one used first
  std::vector<std::shared_ptr<PictureImage>> images_;  // those that nobody else holds are free
};

}  // namespace tg
