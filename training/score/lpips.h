// SPDX-License-Identifier: Apache-2.0
// LPIPS: distance of two pictures in the features of a trained network (Zhang et al., CVPR 2018). The weights come from
// a file of the user's.
#pragma once
#include <memory>

#include "core/file/safetensors.h"
#include "core/image/image.h"
#include "core/system/names.h"

namespace tg {

enum class LpipsNetwork { vgg16, alexNet };
constexpr auto namesOf(LpipsNetwork) { return enumNames("vgg", "alex"); }

// What [0, 1] becomes before the network: [-1, 1], for which the weights were made, or [0, 1] as it is, which many
// papers report by mistake. Numbers of the two cannot be compared.
enum class LpipsRange { symmetric, unit };
constexpr auto namesOf(LpipsRange) { return enumNames("[-1,1]", "[0,1]"); }

class Lpips {
 public:
  // Tensors named as in the published package's state_dict: net.slice1.0.weight ... and lin0.model.1.weight ... The
  // first convolution tells the network: 11 x 11 is AlexNet, 3 x 3 VGG16. Channel counts are taken from the shapes.
  // Throws Error(badData) for missing tensors and shapes that do not follow from each other.
  explicit Lpips(const Safetensors& weights);
  ~Lpips();
  Lpips(Lpips&&) noexcept;

  LpipsNetwork network() const;
  // Pictures of 3 channels, clamped to [0, 1]. Throws Error(badData) when they are too small for the network.
  double distance(const Image& reference, const Image& picture, LpipsRange range) const;

 private:
  struct Layers;
  std::unique_ptr<Layers> layers_;
};

}  // namespace tg
