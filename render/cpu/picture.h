// SPDX-License-Identifier: Apache-2.0
// The final picture alone, in the order of the means: what a viewer draws all day, and what the general stages
// (project.h, tiles.h, blend.h) spend too much memory and set-up on. Float instead of double, a cache line a splat,
// depths sorted tile by tile where they lie in the cache, and flat lists of (splat, vector of pixels).
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <type_traits>
#include <vector>

#include "render/cpu/blend.h"
#include "render/cpu/pages.h"
#include "render/cpu/project.h"

namespace tg::cpu {

// Memory that is kept from frame to frame, uninitialised: pages that nobody writes cost nothing.
template <typename T>
class Room {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  Room() = default;
  Room& operator=(Room&&) = delete;
  ~Room() { freePages(data_, size_ * sizeof(T)); }
  T* reserve(std::size_t count) {
    if (count > size_) {
      freePages(data_, size_ * sizeof(T));
      data_ = nullptr;
      size_ = 0;
      data_ = static_cast<T*>(allocatePages(count * sizeof(T)));
      size_ = count;
    }
    return data_;
  }
  T* data() const { return data_; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

// Splat (project.h) without what other outputs and gradients need.
struct alignas(64) PictureSplat {
  float center_x, center_y;  // [px]
  float log2_opacity;
  float w_xx, w_xy, w_yy;
  float d_xx, d_xy, d_x1, d_yy, d_y1;
  float d_11;  // negative where blending must look at PictureHit
  glm::vec3 base;
  std::uint16_t y0, y1;  // [px] rows of the screen box clipped to the image, y1 exclusive
};
static_assert(sizeof(PictureSplat) == 64);

// What splats need that have a texture or may cross the near plane. Names are Splat's.
struct PictureHit {
  glm::vec3 wx, wy, dx, dy, d0;
  float t_x, t_y, t_1;
  float near;  // [world units] camera z that hits must lie behind; below all of them where all do
  std::uint32_t gaussian;
  std::uint32_t texel_offset;
  std::uint16_t texture_width, texture_height;  // 0 = no texture applies
  float texel_density;
};

// [tiles] x1 and y1 exclusive
struct PictureTiles {
  std::uint16_t x0, y0, x1, y1;
};

// One frame's data. Gaussians come in chunks of `chunk`; the visible ones of a chunk lie at its beginning, in their
// order, in every array of [Gaussians].
struct PictureScene {
  std::size_t chunk = 0;
  std::vector<std::uint32_t> visible;  // [chunks] visible Gaussians in it
  Room<PictureSplat> splats;           // [Gaussians]
  Room<PictureHit> hits;               // [Gaussians]
  Room<std::uint32_t> depths;          // [Gaussians] bits of the camera z of the mean
  Room<PictureTiles> tiles;            // [Gaussians]
  int tiles_x = 0, tiles_y = 0;
  std::vector<std::uint32_t> next;   // [chunks, tiles]
  std::vector<std::uint32_t> begin;  // [tiles + 1] into `pairs`
  Room<std::uint64_t> pairs;         // depth << 32 | splat
  std::uint64_t pixel_splats = 0;    // evaluated by blendPicture
};

// The largest image side [px] that the 16-bit fields above have room for.
constexpr int kMaxPictureSide = 65535;

void projectPicture(const View& view, const GaussianModel& model, PictureScene& scene);
// Throws Error(badData) beyond 2^32 pairs.
void listPicture(PictureScene& scene);
// picture and alpha, as far as the frame has room for them
void blendPicture(const View& view, PictureScene& scene, Texels texels, Frame& frame);

}  // namespace tg::cpu
