// SPDX-License-Identifier: Apache-2.0
// Draws pictures for the window: on its device, or on the CPU with the result handed to the device. No threads here.
#pragma once
#include <list>
#include <memory>

#include "viewer/picture.h"

namespace tg {

class PictureMaker {
 public:
  // `device` must outlive this. backend: as --backend has it; "cpu": the CPU renderer, whose pictures are uploaded.
  PictureMaker(PictureDevice& device, std::string backend);
  ~PictureMaker();

  // Throws Error(device), std::bad_alloc.
  Picture draw(const PictureRequest& request);

 private:
  struct Loaded;
  Loaded& loaded(const std::shared_ptr<const GaussianModel>& model);
  std::shared_ptr<PictureImage> freeImage(glm::ivec2 size);
  // `pixels`, which may be null, receives the picture on the host.
  void drawModel(Loaded& loaded, const PictureRequest& request, PictureImage& target, Image* pixels);
  void drawOnDevice(Loaded& loaded, const PictureRequest& request, PictureImage& target);
  void drawOther(const PictureRequest& request, Picture& picture, PicturePair& pair);

  PictureDevice& device_;
  const std::string backend_;
  std::filesystem::path photograph_path_;  // of the photograph read last
  Image photograph_;
  std::list<Loaded> loaded_;                           // the last one used first
  std::vector<std::shared_ptr<PictureImage>> images_;  // those that nobody else holds are free
};

}  // namespace tg
