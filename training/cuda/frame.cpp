// SPDX-License-Identifier: Apache-2.0
// Buffers are made once and grow; a frame launches six kernels, two sorts and a scan, its gradient three kernels.
#include "training/cuda/frame.h"

#include <string>

#include "core/error.h"
#include "render/cpu/project.h"
#include "training/cuda/finish.h"

namespace tg::cuda {

View makeView(const GaussianModel& model, const Camera& camera, const RenderSettings& settings) {
  const cpu::View from = cpu::makeView(model, camera, settings);
  const auto tiles = [](int pixels) {
    return (pixels + static_cast<int>(kTileSize) - 1) / static_cast<int>(kTileSize);
  };
  View view{from.camera_from_world_rotation,
            from.camera_from_world_translation,
            from.position,
            from.focal_center,
            from.background,
            from.width,
            from.height,
            tiles(from.width),
            tiles(from.height),
            static_cast<std::uint32_t>(from.intersection),
            from.texture_rgb,
            from.texture_alpha};
  if (view.width > 65535 || view.height > 65535) {
    throw Error(ErrorKind::usage, "camera " + camera.name,
                "too large for the CUDA trainer (expected at most 65535 pixels a side, found " +
                    std::to_string(view.width) + " x " + std::to_string(view.height) + ")");
  }
  if (model.atlas.rects.empty()) view.texture_rgb = view.texture_alpha = false;
  return view;
}

void DeviceModel::upload(const GaussianModel& model) {
  count_ = model.size();
  sh_count_ = model.shCount();
  mean_.upload(model.mean);
  rotation_.upload(model.rotation);
  log_scale_.upload(model.log_scale);
  opacity_logit_.upload(model.opacity_logit);
  sh_.upload(model.sh);
  texels_.upload(model.atlas.texels);
  rects_.upload(model.atlas.rects);
}

void DeviceModel::resizeLike(const DeviceModel& other) {
  count_ = other.count_;
  sh_count_ = other.sh_count_;
  mean_.resize(other.mean_.size());
  rotation_.resize(other.rotation_.size());
  log_scale_.resize(other.log_scale_.size());
  opacity_logit_.resize(other.opacity_logit_.size());
  sh_.resize(other.sh_.size());
  texels_.resize(other.texels_.size());
}

void DeviceModel::download(ModelGradient& gradient) const {
  const auto get = [](const Buffer<float>& from, auto& to, std::size_t floats) {
    to.resize(from.size() / floats);
    from.download(to);
  };
  get(mean_, gradient.v_mean, 3);
  get(rotation_, gradient.v_rotation, 4);
  get(log_scale_, gradient.v_log_scale, 3);
  get(opacity_logit_, gradient.v_opacity_logit, 1);
  get(sh_, gradient.v_sh, 3);
  get(texels_, gradient.v_texels, 4);
}

void DeviceModel::download(GaussianModel& model) const {
  mean_.download(model.mean);
  rotation_.download(model.rotation);
  log_scale_.download(model.log_scale);
  opacity_logit_.download(model.opacity_logit);
  sh_.download(model.sh);
  texels_.download(model.atlas.texels);
}

Parameters DeviceModel::parameters() const {
  return {count_,     sh_count_,      mean_.data(),  rotation_.data(),  log_scale_.data(), opacity_logit_.data(),
          sh_.data(), texels_.data(), rects_.data(), texels_.size() / 4};
}

BlendInput Frame::blendInput(const Parameters& model) const {
  return {view_, screen_.splats.data(), screen_.frames.data(), model.texels, lists_.lists()};
}

void Frame::forward(const View& view, const Parameters& model) {
  view_ = view;
  const std::size_t pixels = static_cast<std::size_t>(view.width) * view.height;
  projectGaussians(view, model, screen_);
  buildLists(view, screen_, primitives_, lists_);
  picture_.resize(3 * pixels);
  transmittance_.resize(pixels);
  end_.resize(pixels);
  blendForward(blendInput(model), record(), picture_.data());
}

void Frame::backward(const float* v_picture, const GradientOptions& options, const Parameters& model,
                     const Parameters& gradient) {
  const bool textured = view_.texture_rgb || view_.texture_alpha;
  sums_.resize(lists_.pairs * pairSums(textured, options.statistics));
  shows_.resize(lists_.pairs);
  shows_.zero();
  texel_sums_.resize(4 * model.texel_count);
  texel_sums_.zero();
  screen_gradient_.resize(model.count);
  screen_gradient_abs_.resize(model.count);
  blendBackward(blendInput(model), record(), v_picture, options, {sums_.data(), shows_.data(), texel_sums_.data()});
  finishGradients({view_, model, screen_.splats.data(), screen_.tile_counts.data(), lists_.pair_begin.data(),
                   sums_.data(), shows_.data(), options.statistics},
                  gradient, screen_gradient_.data(), screen_gradient_abs_.data());
  finishTexels(texel_sums_.data(), model.texels, gradient.texels, model.texel_count);
}

}  // namespace tg::cuda
