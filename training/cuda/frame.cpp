// SPDX-License-Identifier: Apache-2.0
// Buffers are made once and grow; a frame launches seven kernels, two sorts and a scan, its gradient four kernels and
// more for each range of depths.
#include "training/cuda/frame.h"

#include <algorithm>
#include <string>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "render/cpu/project.h"
#include "training/cuda/finish.h"

namespace tg::cuda {
namespace {

constexpr std::size_t kFirstRoom = 1 << 8;  // [pairs]: the first picture says how many there are

}  // namespace

std::size_t roomFor(PairCount pairs) {
  return static_cast<std::size_t>(std::max<PairCount>(kFirstRoom, pairs + pairs / 4));
}

PairCount countPairs(const GaussianModel& model, const Camera& camera) {
  DeviceModel device;
  device.upload(model);
  Frame frame;
  frame.forward(makeView(model, camera, {}), device.parameters());
  PairCount pairs = 0;
  copyToHost(&pairs, frame.pairs(), sizeof(pairs));
  return pairs;
}

View makeView(const GaussianModel& model, const Camera& camera, const RenderSettings& settings) {
  const cpu::View from = cpu::makeView(model, camera, settings);
  const auto tiles = [](int pixels) {
    return (pixels + static_cast<int>(kTileSize) - 1) / static_cast<int>(kTileSize);
  };
  View view{from,
            from.eye,
            from.background,
            tiles(from.size.x),
            tiles(from.size.y),
            static_cast<std::uint32_t>(from.intersection),
            from.texture_rgb,
            from.texture_alpha,
            static_cast<std::uint32_t>(from.outside)};
  if (view.size.x > 65535 || view.size.y > 65535) {
    throw Error(ErrorKind::usage, "camera " + camera.name,
                "too large for the CUDA trainer (expected at most 65535 pixels a side, found " +
                    std::to_string(view.size.x) + " x " + std::to_string(view.size.y) + ")");
  }
  if (model.atlas.rects.empty()) view.texture_rgb = view.texture_alpha = false;
  return view;
}

void DeviceModel::upload(const GaussianModel& model, const TextureAtlas& atlas) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  count = model.size();
  sh_count = static_cast<int>(model.shCount());
  forEachField([](const Field&, Buffer<float>& to, const auto& from) { to.upload(from); }, *this, model);
  texels.upload(atlas.texels);
  rects.upload(atlas.rects);
  largest_rect = 0;
  for (const TextureRect& rect : atlas.rects) {
    largest_rect = std::max<std::size_t>(largest_rect, rect.texelCount());
  }
}

void DeviceModel::resizeLike(const DeviceModel& other) { resizeLike(other, other.count, other.texels.size() / 4); }

void DeviceModel::resizeLike(const DeviceModel& other, std::size_t gaussians, std::size_t texel_count) {
  count = gaussians;
  sh_count = other.sh_count;
  forEachField([&](const Field& field, Buffer<float>& values) { values.resize(field.row(sh_count) * gaussians); },
               *this);
  texels.resize(4 * texel_count);
}

Parameters DeviceModel::parameters() const {
  Parameters parameters{};
  forEachParameter([](const Field&, float*& to, const Buffer<float>& from) { to = from.data(); }, parameters, *this);
  parameters.count = count;
  parameters.sh_count = sh_count;
  parameters.rects = rects.data();
  parameters.texel_count = texels.size() / 4;
  parameters.largest_rect = largest_rect;
  return parameters;
}

BlendInput Frame::blendInput(const Parameters& model) const {
  return {view_, screen_.splats.data(), screen_.frames.data(), model.texels, lists_.lists()};
}

void Frame::forward(const View& view, const Parameters& model) {
  forwardAhead(view, model);
  const PairCount pairs = lists_.pairs.read(0);
  if (pairs <= room()) return;
  makeRoom(roomFor(pairs));
  forwardAhead(view, model);
}

void Frame::forwardAhead(const View& view, const Parameters& model) {
  view_ = view;
  if (room() == 0) makeRoom(kFirstRoom);
  const std::size_t pixels = static_cast<std::size_t>(view.size.x) * view.size.y;
  projectGaussians(view, model, screen_);
  buildLists(view, screen_, primitives_, lists_);
  picture_.resize(3 * pixels);
  transmittance_.resize(pixels);
  end_.resize(pixels);
  blendForward(blendInput(model), record(), picture_.data());
}

void Frame::backward(const float* v_picture, const GradientOptions& options, const Parameters& model,
                     const Parameters& gradient) {
  backward(v_picture, options, model, model.texel_count,
           [&](const TexelSums& sums) { finishTexels(sums, model, gradient.texels); });
  finish(model, 0, gradient);
}

void Frame::backward(const float* v_picture, const GradientOptions& options, const Parameters& model,
                     std::size_t texels_at_a_time, const TakeTexels& take) {
  const bool textured = view_.texture_rgb || view_.texture_alpha;
  const std::size_t tiles = lists_.tile_begin.size() - 1;
  statistics_ = options.statistics;
  lists_.sums.resizeExactly(room() * pairSums(textured, statistics_));
  shows_.resizeExactly(room());
  shows_.zero();
  screen_gradient_.resize(model.count);
  screen_gradient_abs_.resize(model.count);
  cutRanges(model, texels_at_a_time, tiles, primitives_, lists_, ranges_);
  if (texel_sums_.size() != 4 * ranges_.texels) {
    texel_sums_.resizeExactly(4 * ranges_.texels);
    texel_sums_.zero();
  }
  const bool cut = ranges_.count > 1;
  if (cut) along_.resize(transmittance_.size());
  for (std::size_t range = ranges_.count; range-- > 0;) {
    const std::uint32_t* places = ranges_.list_places.data() + range * tiles;
    const ListPart part =
        cut ? ListPart{places, places + tiles, along_.data(), range + 1 == ranges_.count} : ListPart{};
    const std::uint32_t* texel_places = cut ? ranges_.texel_places : nullptr;
    blendBackward(blendInput(model), record(), v_picture, options, part,
                  {lists_.sums.data(), shows_.data(), texel_sums_.data(), texel_places});
    if (model.texel_count == 0) continue;
    take({texel_sums_.data(), screen_.tile_counts.data(), cut ? lists_.order.data() : nullptr,
          cut ? ranges_.ranks.data() + range : nullptr, texel_places});
  }
  addRuns({lists_.pair_gaussian.data(), screen_.tile_counts.data(), lists_.pair_begin.data(), lists_.pairs.data(),
           room(), pairSums(textured, statistics_), lists_.sums.data(), shows_.data()});
}

void Frame::finish(const Parameters& model, std::size_t first, const Parameters& gradient) {
  finishGradients(
      {view_, slice(model, first, gradient.count), screen_.splats.data() + first, screen_.tile_counts.data() + first,
       lists_.pair_begin.data() + first, lists_.sums.data(), shows_.data(), lists_.pairs.data(), room(), statistics_},
      gradient, screen_gradient_.data() + first, screen_gradient_abs_.data() + first);
}

}  // namespace tg::cuda
