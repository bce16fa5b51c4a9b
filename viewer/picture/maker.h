// SPDX-License-Identifier: Apache-2.0
// Draws pictures for the window: on its device, or on the CPU with the result handed to the device. No threads here.
#pragma once
#include <chrono>
#include <deque>
#include <list>
#include <memory>
#include <optional>

#include "viewer/picture/picture.h"

namespace tg {

class PictureMaker {
 public:
  // `device` must outlive this. backend: as --backend has it; "cpu": the CPU renderer, whose pictures are uploaded.
  PictureMaker(PictureDevice& device, std::string backend);
  ~PictureMaker();

  // Pictures are finished in the order in which they were begun. All throw Error(device), std::bad_alloc.
  //
  // Whether it was begun: on a device it may be under way while others are, or it has been drawn. False: others must be
  // finished first.
  bool begin(const PictureRequest& request);
  std::size_t underWay() const { return begun_.size(); }
  // Lets go of models that nobody else holds; with the last one, of images, too.
  void tidy();
  // [ms] until the device is expected to be done with all that is under way; infinite where nothing tells.
  double expectedRest() const;
  // The oldest; waits at most so long [ms] for the device.
  std::optional<Picture> finish(double milliseconds);

 private:
  using Clock = std::chrono::steady_clock;
  struct Loaded;
  struct Begun {
    Picture picture;
    Loaded* model;                         // of one that the device draws, else null
    std::shared_ptr<PictureImage> target;  // likewise
    Clock::time_point start;
  };
  void forgetPhotograph();
  void draw(Picture& picture);
  bool beginOnDevice(Loaded& model, const PictureRequest& request, const std::shared_ptr<PictureImage>& target);
  std::optional<bool> finishOldest(double milliseconds_at_most);
  void describe(Picture& picture, const Loaded& model) const;
  Loaded& loaded(const std::shared_ptr<const GaussianModel>& model);
  std::shared_ptr<PictureImage> freeImage(glm::ivec2 size);
  // `pixels`, which may be null, receives the picture on the host. Returns the scale of an output that has one.
  std::optional<ValueScale> drawModel(Loaded& loaded, const PictureRequest& request, PictureImage& target,
                                      Image* pixels);
  OutputRange drawOnDevice(Loaded& loaded, const PictureRequest& request, PictureImage& target,
                           const OutputRange& beside = {});
  OutputRange drawParts(Loaded& loaded, const PictureRequest& request, PictureImage& target, const OutputRange& beside,
                        int most);
  void drawBoth(const PictureRequest& request, Picture& picture, PicturePair& pair);
  void drawOther(const PictureRequest& request, Picture& picture, PicturePair& pair);
  void drawError(const PictureRequest& request, Picture& picture, const PicturePair& pair);

  PictureDevice& device_;
  const std::string backend_;
  std::filesystem::path photograph_path_;  // of the photograph that the last picture was beside
  std::shared_ptr<const Image> photograph_;
  std::list<Loaded> loaded_;                           // the last one used first
  std::vector<std::shared_ptr<PictureImage>> images_;  // those that nobody else holds are free
  std::deque<Begun> begun_;
  Clock::time_point device_free_;  // when the last picture was finished
  std::optional<double> last_ms_;  // of the device, for one that was drawn beside others or could have been
};

}  // namespace tg
