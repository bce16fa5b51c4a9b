// SPDX-License-Identifier: Apache-2.0
// A model on the device, and one view of it: forward, then backward.
#pragma once
#include <functional>

#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/renderer.h"
#include "training/cuda/blend.h"
#include "training/cuda/memory.h"
#include "training/cuda/project.h"
#include "training/cuda/texels.h"
#include "training/cuda/types.h"
#include "training/step/gradient.h"

namespace tg::cuda {

// Throws Error(usage) as a renderer does, and for pictures of more than 65535 pixels a side.
View makeView(const GaussianModel& model, const Camera& camera, const RenderSettings& settings);

template <typename>
using FloatBuffer = Buffer<float>;
// Parameters, or gradients in their shapes.
struct DeviceModel : ModelFields<FloatBuffer> {
  std::size_t count = 0;
  int sh_count = 1;              // coefficients of each
  std::size_t largest_rect = 0;  // [texels]
  Buffer<TextureRect> rects;

  void upload(const GaussianModel& model) { upload(model, model.atlas); }
  // Its Gaussians with another atlas' textures.
  void upload(const GaussianModel& model, const TextureAtlas& atlas);
  void resizeLike(const DeviceModel& other);  // contents undefined
  // Room for so many Gaussians of the other's kind, and texels; contents undefined.
  void resizeLike(const DeviceModel& other, std::size_t gaussians, std::size_t texel_count);
  // A gradient, or a model whose sh_degree must be the device's; rectangles do not change.
  template <typename Model>
  void download(Model& model) const {
    forEachParameter([](const Field&, const auto& from, auto& to) { from.downloadAll(to); }, *this, model);
  }
  Parameters parameters() const;
};

// A quarter more than a picture's pairs: what other views may need.
std::size_t roomFor(PairCount pairs);
// The (tile, splat) pairs of a model's picture; uploads the model for it.
PairCount countPairs(const GaussianModel& model, const Camera& camera);

class Frame {
 public:
  // The picture, not clamped, stays on the device: [height, width, 3]. Waits for the number of (tile, splat) pairs.
  void forward(const View& view, const Parameters& model);
  // The same, without waiting: where there are more pairs than room, picture and gradient are wrong.
  void forwardAhead(const View& view, const Parameters& model);
  const PairCount* pairs() const { return lists_.pairs.data(); }  // [1] on the device, of the last picture
  std::size_t room() const { return lists_.room; }
  void makeRoom(std::size_t pairs) { cuda::makeRoom(pairs, lists_); }
  // Of the last forward(), for the same parameters. v_picture: as the picture, on the device.
  void backward(const float* v_picture, const GradientOptions& options, const Parameters& model,
                const Parameters& gradient);
  // The same in parts: first the sums that the others need. Those of texels exist for one range of depths at a time
  // (cutRanges()), when `take` gets them; it may move the range's texels. It is not called where there are no texels.
  using TakeTexels = std::function<void(const TexelSums&)>;
  void backward(const float* v_picture, const GradientOptions& options, const Parameters& model,
                std::size_t texels_at_a_time, const TakeTexels& take);
  // Then the gradients of gradient.count Gaussians from `first` on; they begin with that of the first.
  void finish(const Parameters& model, std::size_t first, const Parameters& gradient);

  const Buffer<float>& picture() const { return picture_; }
  // As in ModelGradient, of the last backward(), where finish() was.
  const Buffer<float>& screenGradient() const { return screen_gradient_; }
  const Buffer<float>& screenGradientAbs() const { return screen_gradient_abs_; }
  const Buffer<float>& screenRadius() const { return screen_.screen_radius; }

 private:
  BlendInput blendInput(const Parameters& model) const;
  PixelRecord record() const { return {transmittance_.data(), end_.data()}; }

  View view_{};
  Primitives primitives_;
  ScreenSplats screen_;
  TileLists lists_;
  Buffer<float> picture_, transmittance_;
  Buffer<std::uint32_t> end_;
  bool statistics_ = false;  // in the sums
  Buffer<std::uint8_t> shows_;
  DepthRanges ranges_;
  Buffer<long long> texel_sums_;  // zeros between uses
  Buffer<float> along_;           // ListPart::along
  Buffer<float> screen_gradient_, screen_gradient_abs_;
};

}  // namespace tg::cuda
