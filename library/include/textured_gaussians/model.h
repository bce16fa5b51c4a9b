// SPDX-License-Identifier: Apache-2.0
// A trained scene: Gaussians with textures, read, looked at, made and saved.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "textured_gaussians/camera.h"

namespace textured_gaussians {

// What the textures of a model hold.
enum class TextureMode { none, alpha, rgb, rgba };
// Where a ray meets a Gaussian.
enum class Intersection { plane, maxResponse };
// What is drawn of a textured Gaussian beyond +-3 sigma: its base colour, nothing, or its border's texels.
enum class TextureOutside { base, clip, edge };

// A Gaussian's texture: texel (i, j), i along u, j along v, is texel offset + j * width + i of the model. 0 x 0: none.
struct TextureRect {
  std::uint32_t offset = 0;  // [texels]
  std::uint16_t width = 0;   // [texels]
  std::uint16_t height = 0;  // [texels]
};

// Everything a model is made of, N Gaussians. World space is the data set's, right-handed; nothing is rescaled.
struct ModelData {
  std::vector<float> means;           // [N, 3] [world units]
  std::vector<float> rotations;  // [N, 4] quaternions w, x, y, z: world from Gaussian; of lengths from 1e-22 to 1e19
  std::vector<float> log_scales;      // [N, 3] ln(sigma), sigma in [world units], along the Gaussian's axes
  std::vector<float> opacity_logits;  // [N] opacity = 1 / (1 + exp(-logit))
  std::vector<float> sh;              // [N, K, 3] RGB, K = (sh_degree + 1)^2; colour = 0.5 + sum of sh times basis
  int sh_degree = 0;                  // 0 to 3
  TextureMode texture_mode = TextureMode::none;  // none has no texture_rects and no texels
  Intersection intersection = Intersection::maxResponse;
  TextureOutside outside = TextureOutside::base;
  std::vector<TextureRect> texture_rects;  // [N], or empty: no Gaussian has a texture
  std::vector<float>
      texels;  // [T, 4] RGB, added to the base colour, and a factor on alpha in [0, 1]; neutral: 0, 0, 0, 1
  std::vector<Camera> cameras;                  // of the photographs that it was trained on; may be empty
  std::array<float, 3> background = {0, 0, 0};  // RGB that it was trained against
};

// A model that does not change: copies share its memory, and may be used by several threads at once. One that was moved
// from is still the same.
class Model {
 public:
  Model(const Model&) = default;
  Model& operator=(const Model&) = default;
  // Throws Error(badData) naming the member whose length is wrong, texels or rectangles that lack the other or a
  // texture mode, or the first Gaussian with numbers that are not finite, a quaternion without a length or a rectangle
  // beyond the texels; Error(usage) for cameras and enumerators that are none.
  explicit Model(const ModelData& data);
  // From any file that tgconvert reads (docs/formats.md), such as a .tgz, .glb, .ply or .spz, told by its content where
  // its format has a mark of its own, else by its extension. Throws Error: cannotRead, badData.
  static Model load(const std::filesystem::path& path);
  // In the format of the extension, which may hold less than the model (docs/formats.md). Half-float texels at most. A
  // file that is there is replaced once the new one is complete. Throws Error: cannotWrite; usage for another
  // extension, or that of pictures; badData for what makes no file of the format, as no Gaussians for most, or too
  // large textures. Returns what the format does not hold, a line each.
  std::vector<std::string> save(const std::filesystem::path& path) const;

  std::size_t size() const;  // N
  int shDegree() const;      // 0 to 3
  TextureMode textureMode() const;
  Intersection intersection() const;
  TextureOutside outside() const;
  std::vector<TextureRect> textureRects() const;
  std::array<float, 3> background() const;
  std::vector<Camera> cameras() const;
  // What reading repaired or passed over, a line each.
  std::vector<std::string> warnings() const;

  // Views of the members of ModelData with these names; they live as long as a copy of the model does.
  std::span<const float> means() const;
  std::span<const float> rotations() const;
  std::span<const float> logScales() const;
  std::span<const float> opacityLogits() const;
  std::span<const float> sh() const;
  std::span<const float> texels() const;
  // A copy, to change and make another model of.
  ModelData data() const;

 private:
  friend struct Access;
  struct Parts;
  explicit Model(std::shared_ptr<const Parts> parts) : parts_(std::move(parts)) {}
  std::shared_ptr<const Parts> parts_;
};

}  // namespace textured_gaussians
