// SPDX-License-Identifier: Apache-2.0
// The training loss: (1 - w) mean |x - y| + w (1 - SSIM(x, y)), w = 0.2, and its gradient (docs/math.md 7).
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace tg {

struct LossValue {
  double total = 0;
  double l1 = 0;                  // mean absolute difference
  double ssim = 0;                // mean over pixels and channels
  double mean_squared_error = 0;  // after clamping the picture to [0, 1], for PSNR
};

// What a row of pixels adds in one channel, or all rows in all.
struct LossRowSums {
  double l1 = 0, ssim = 0, squared = 0;
};
// Of a picture's sums, to which `counted` values add.
LossValue lossOf(const LossRowSums& sums, double counted, float ssim_weight);

// Rows [first, end) of a picture, by whoever has them and their surroundings.
struct LossRows {
  int first = 0;
  int end = 0;
};
// Those that the loss and its gradient in `rows` are made of.
LossRows lossSurroundings(LossRows rows, int height);

// Keeps its scratch space between calls. Results do not depend on the thread count.
class PhotometricLoss {
 public:
  explicit PhotometricLoss(float ssim_weight = 0.2f) : ssim_weight_(ssim_weight) {}
  // picture, v_picture: [height * width]; target: [height * width * 3], 8 bit. v_picture receives dL/d(picture).
  // mask: [height * width], 0: ignored; empty: all pixels count. An ignored pixel is black in both for the windows that
  // overlap it, as if it lay beyond the border; it has no window of its own, no gradient, and no share in the means.
  LossValue evaluate(int width, int height, std::span<const glm::vec3> picture, std::span<const std::uint8_t> target,
                     std::span<glm::vec3> v_picture, std::span<const std::uint8_t> mask = {});

  // The same for some rows of a picture of `height`, of which `ignored` pixels are; picture, target and mask are those
  // of the rows' surroundings, v_picture and row_sums [3, rows] of the rows alone.
  void evaluateRows(int width, int height, LossRows rows, std::size_t ignored, std::span<const glm::vec3> picture,
                    std::span<const std::uint8_t> target, std::span<glm::vec3> v_picture,
                    std::span<const std::uint8_t> mask, std::span<LossRowSums> row_sums);
  // Of the sums of all rows, [3, height].
  LossValue total(int width, int height, std::size_t ignored, std::span<const LossRowSums> row_sums) const;

 private:
  float ssim_weight_;
  std::vector<float> planes_;          // [2, surroundings, width] a channel of picture and target
  std::vector<float> v_moments_;       // [3, rows and kSsimRadius around, width] dSSIM/d mean, variance, covariance
  std::vector<LossRowSums> row_sums_;  // [3, height]
  std::vector<std::vector<float>> scratch_;  // one a worker
};

}  // namespace tg
