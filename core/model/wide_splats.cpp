// SPDX-License-Identifier: Apache-2.0
// Gaussians that are wide for their distance, in pieces.
#include "core/model/wide_splats.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

// A Gaussian of sigma 1 as the sum of three of sigma kPieceSigma at -kPieceShift, 0 and +kPieceShift: DeMars, Bishop,
// Jah (2013), whose library minimises the integrated square error and the sigma together.
constexpr double kPieceSigma = 0.6715664864, kPieceShift = 1.0575150485;
constexpr double kSideMass = 0.2252246249, kMiddleMass = 0.5495507502;

constexpr double kMostSigma = 1e30;  // [world units]

struct Piece {
  glm::dvec3 mean, log_scale;
  double opacity = 0;
};

// Opacities of the two outer pieces and of the middle one. Blended, one behind the other, they let through what the
// whole does, in the mean over its profile.
class Opacities {
 public:
  Opacities() {
    for (std::size_t k = 0; k < kSamples; ++k) {
      const double x = 3.0 * static_cast<double>(k) / (kSamples - 1);
      const auto at = [&](double mean, double sigma) {
        return std::exp(-0.5 * (x - mean) * (x - mean) / (sigma * sigma));
      };
      whole_[k] = at(0, 1);
      middle_[k] = at(0, kPieceSigma);
      near_[k] = at(kPieceShift, kPieceSigma);
      far_[k] = at(-kPieceShift, kPieceSigma);
    }
  }

  std::array<double, 2> of(double opacity) const {
    std::array<double, 2> best = {opacity * kSideMass / kPieceSigma, opacity * kMiddleMass / kPieceSigma};
    double least = error(opacity, best);
    for (double step = 0.1; step > 1e-4;) {
      bool better = false;
      for (int k = 0; k < 4; ++k) {
        std::array<double, 2> trial = best;
        double& moved = trial[static_cast<std::size_t>(k / 2)];
        moved = std::clamp(moved + (k % 2 == 0 ? step : -step), 0.0, kMostOpacity);
        const double found = error(opacity, trial);
        if (found < least) least = found, best = trial, better = true;
      }
      if (!better) step *= 0.5;
    }
    return best;
  }

 private:
  static constexpr std::size_t kSamples = 25;
  static constexpr double kMostOpacity = 0.999;
  static constexpr std::array<double, 4> kAcross = {1.0, 0.75, 0.5, 0.25};  // the value of the other axes

  double error(double opacity, std::array<double, 2> pieces) const {
    double sum = 0;
    for (const double across : kAcross) {
      const double side = pieces[0] * across, middle = pieces[1] * across;
      for (std::size_t k = 0; k < kSamples; ++k) {
        const double through = (1 - side * near_[k]) * (1 - middle * middle_[k]) * (1 - side * far_[k]);
        const double difference = through - (1 - opacity * across * whole_[k]);
        sum += difference * difference;
      }
    }
    return sum;
  }

  std::array<double, kSamples> whole_{}, middle_{}, near_{}, far_{};
};

// Beyond floats' reach pieces have no place.
bool isWide(double sigma, double distance, double bound) { return sigma > bound * distance && sigma < kMostSigma; }

int widestAxis(glm::dvec3 log_scale) {
  int axis = 0;
  for (int k = 1; k < 3; ++k) axis = log_scale[k] > log_scale[axis] ? k : axis;
  return axis;
}

std::vector<Piece> piecesOf(const Piece& whole, const glm::dmat3& axes, std::span<const glm::dvec3> eyes,
                            const WideLimits& limits, const Opacities& opacities) {
  std::vector<Piece> pieces = {whole};
  for (int round = 0; round < limits.rounds; ++round) {
    std::vector<Piece> next;
    for (const Piece& piece : pieces) {
      const int axis = widestAxis(piece.log_scale);
      const double sigma = std::exp(piece.log_scale[axis]);
      if (!isWide(sigma, nearestDistance(piece.mean, eyes.data(), eyes.size()), limits.bound)) {
        next.push_back(piece);
        continue;
      }
      const auto [side, middle] = opacities.of(piece.opacity);
      for (int place = -1; place <= 1; ++place) {
        Piece part = piece;
        part.mean += place * kPieceShift * sigma * axes[axis];
        part.log_scale[axis] += std::log(kPieceSigma);
        part.opacity = place == 0 ? middle : side;
        next.push_back(part);
      }
    }
    if (next.size() == pieces.size()) break;
    pieces = std::move(next);
  }
  return pieces;
}

}  // namespace

WidePieces splitWide(const GaussianModel& model, std::span<const glm::dvec3> eyes, const WideLimits& limits) {
  TG_ASSERT(limits.bound > 0 && limits.rounds >= 1, "a bound, and a round to reach it");
  std::vector<std::uint8_t> wide(model.size());
  parallelFor(static_cast<std::int64_t>(model.size()), 256, [&](std::int64_t item) {
    const auto i = static_cast<std::size_t>(item);
    const glm::dvec3 sigma = sigmaOf(model, i);
    wide[i] =
        !eyes.empty() && isWide(std::max({sigma.x, sigma.y, sigma.z}),
                                nearestDistance(glm::dvec3(model.mean[i]), eyes.data(), eyes.size()), limits.bound);
  });
  WidePieces result;
  std::vector<Piece> all;
  const Opacities opacities;
  for (std::uint32_t i = 0; i < model.size(); ++i) {
    if (wide[i] == 0) continue;
    const Piece whole{glm::dvec3(model.mean[i]), glm::dvec3(model.log_scale[i]), opacityOf(model, i)};
    const glm::dmat3 axes(rotationFromQuaternion(model.rotation[i]));
    const std::vector<Piece> pieces = piecesOf(whole, axes, eyes, limits, opacities);
    if (all.size() + pieces.size() > limits.most_pieces) break;
    result.wide.push_back(i);
    result.source.insert(result.source.end(), pieces.size(), i);
    all.insert(all.end(), pieces.begin(), pieces.end());
  }
  result.pieces = select(withoutTextures(model), result.source);
  for (std::size_t k = 0; k < all.size(); ++k) {
    result.pieces.mean[k] = glm::vec3(all[k].mean);
    result.pieces.log_scale[k] = glm::vec3(all[k].log_scale);
    result.pieces.opacity_logit[k] = logitFromOpacity(all[k].opacity);
  }
  return result;
}

}  // namespace tg
